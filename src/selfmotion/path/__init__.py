"""Tool motion over time: what the tool frame is to do, as pose and twist at any time."""

from selfmotion.path.base import (
    STILL as STILL,
    Path as Path,
    PathSamples as PathSamples,
    PathSeries as PathSeries,
    check_duration as check_duration,
    check_oriented as check_oriented,
    path_pose as path_pose,
    path_series as path_series,
    rotations_about as rotations_about,
)
from selfmotion.path.derived import (
    Placed as Placed,
    Retimed as Retimed,
    Reversed as Reversed,
    Section as Section,
    section_at_rest as section_at_rest,
)
from selfmotion.path.feed import Feed as Feed, FeedPossible as FeedPossible
from selfmotion.path.feed_kept import FeedKept as FeedKept
from selfmotion.path.joined import (
    Dwell as Dwell,
    Joined as Joined,
    Stroke as Stroke,
    with_leads as with_leads,
    with_run_ups as with_run_ups,
)
from selfmotion.path.pace import Pace as Pace, times_when as times_when
from selfmotion.path.polyline import Polyline as Polyline, merged as merged
from selfmotion.path.rates import (
    edges_of as edges_of,
    spread_along as spread_along,
    twist_rates as twist_rates,
)
from selfmotion.path.shapes import (
    Circle as Circle,
    Line as Line,
    Spiral as Spiral,
    TimeLaw as TimeLaw,
)
from selfmotion.path.twist import TwistPath as TwistPath
from selfmotion.path.waypoints import Waypoints as Waypoints
from selfmotion.path.weave import Weave as Weave
from selfmotion.path.written_poses import (
    ORIENTATIONS as ORIENTATIONS,
    TURN_NOTE as TURN_NOTE,
    from_normal as from_normal,
    pose_of as pose_of,
)

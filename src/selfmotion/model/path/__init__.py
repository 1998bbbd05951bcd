"""Tool motions over time: pose and twist of the tool frame at any time."""

from selfmotion.model.path.base import (
    REST_SPEED as REST_SPEED,
    Path as Path,
    PathSamples as PathSamples,
    PathSeries as PathSeries,
    check_duration as check_duration,
    check_oriented as check_oriented,
    path_pose as path_pose,
    path_series as path_series,
    rotations_about as rotations_about,
)
from selfmotion.model.path.derived import Placed as Placed, Reversed as Reversed
from selfmotion.model.path.feed import Feed as Feed, FeedPossible as FeedPossible
from selfmotion.model.path.feed_profile import FeedProfile as FeedProfile
from selfmotion.model.path.joined import (
    Dwell as Dwell,
    Joined as Joined,
    with_leads as with_leads,
)
from selfmotion.model.path.length import path_length as path_length
from selfmotion.model.path.pace import Pace as Pace, times_when as times_when
from selfmotion.model.path.polyline import Polyline as Polyline
from selfmotion.model.path.rates import (
    edges_of as edges_of,
    spread_along as spread_along,
    twist_rates as twist_rates,
)
from selfmotion.model.path.retimed import (
    Retimed as Retimed,
    Section as Section,
    section_at_rest as section_at_rest,
)
from selfmotion.model.path.run_ups import (
    Stroke as Stroke,
    with_run_ups as with_run_ups,
)
from selfmotion.model.path.shapes import (
    Circle as Circle,
    Line as Line,
    Spiral as Spiral,
    TimeLaw as TimeLaw,
)
from selfmotion.model.path.simplified import merged as merged
from selfmotion.model.path.twist import TwistPath as TwistPath
from selfmotion.model.path.waypoints import Waypoints as Waypoints
from selfmotion.model.path.weave import Weave as Weave
from selfmotion.model.path.written_poses import (
    ORIENTATIONS as ORIENTATIONS,
    TURN_NOTE as TURN_NOTE,
    from_normal as from_normal,
    pose_of as pose_of,
)

__all__ = [
    "Circle",
    "Dwell",
    "Feed",
    "Joined",
    "Line",
    "Path",
    "PathSamples",
    "Placed",
    "Polyline",
    "Retimed",
    "Reversed",
    "Section",
    "Spiral",
    "Stroke",
    "TwistPath",
    "Waypoints",
    "Weave",
    "section_at_rest",
    "with_leads",
    "with_run_ups",
]

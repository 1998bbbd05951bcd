"""Tool motion over time: what the tool frame is to do, as pose and twist at any time."""

from selfmotion.path.base import (
    STILL,
    Path,
    PathSamples,
    PathSeries,
    TimeLaw,
    check_oriented,
    path_pose,
    path_series,
)
from selfmotion.path.feed import Feed
from selfmotion.path.joined import Dwell, Joined, with_leads
from selfmotion.path.pace import Pace, times_along
from selfmotion.path.placed import Placed
from selfmotion.path.polyline import Polyline
from selfmotion.path.ramped import Ramped
from selfmotion.path.retimed import Retimed
from selfmotion.path.section import Section, section_at_rest
from selfmotion.path.shapes import Circle, Line
from selfmotion.path.truncated import Truncated
from selfmotion.path.twist import TwistPath
from selfmotion.path.waypoints import Waypoints

__all__ = [
    "STILL",
    "Circle",
    "Dwell",
    "Feed",
    "Joined",
    "Line",
    "Pace",
    "Path",
    "PathSamples",
    "PathSeries",
    "Placed",
    "Polyline",
    "Ramped",
    "Retimed",
    "Section",
    "TimeLaw",
    "Truncated",
    "TwistPath",
    "Waypoints",
    "check_oriented",
    "path_pose",
    "path_series",
    "section_at_rest",
    "times_along",
    "with_leads",
]

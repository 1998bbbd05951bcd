"""Tool motion over time: what the tool frame is to do, as pose and twist at any time."""

from selfmotion.path.base import STILL, Path, PathSamples, TimeLaw, path_pose
from selfmotion.path.joined import Dwell, Joined
from selfmotion.path.placed import Placed
from selfmotion.path.ramped import Ramped
from selfmotion.path.retimed import Retimed
from selfmotion.path.shapes import Circle, Line
from selfmotion.path.truncated import Truncated
from selfmotion.path.twist import TwistPath
from selfmotion.path.waypoints import Waypoints

__all__ = [
    "STILL",
    "Circle",
    "Dwell",
    "Joined",
    "Line",
    "Path",
    "PathSamples",
    "Placed",
    "Ramped",
    "Retimed",
    "TimeLaw",
    "Truncated",
    "TwistPath",
    "Waypoints",
    "path_pose",
]

"""A path whose tool passes where a planar arm is stretched out, as a file of few digits has it."""

import numpy as np
import pinocchio as pin

import selfmotion as sm
from selfmotion.basics import Array
from support.arms import robot_named

DURATION = 4.0
# Beside the pose in the middle rounding may be beyond reach, by less than this [m].
_DIGITS = 7


def stretching(t: Array) -> Array:
    """Return a motion of the planar arm that is stretched out in the middle, (K, 3)."""
    s = t / DURATION - 0.5
    return np.stack([0.55 + 0.5 * s, 0.6 * s, -0.9 * s], axis=-1)


def rounded_problem(count: int = 33, **options) -> sm.Problem:
    """Return the problem of following it through so many rounded waypoints, the middle one too."""
    robot = robot_named("planar_3r")
    t = np.linspace(0.0, DURATION, count)
    known = [robot.pose(q) for q in stretching(t)]
    poses = [pin.SE3(pose.rotation, np.round(pose.translation, _DIGITS)) for pose in known]
    path = sm.paths.Waypoints.from_poses(t, poses)
    return sm.Problem(robot, path, "planar", rest=False, clearance=None, **options)

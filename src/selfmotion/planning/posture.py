"""Of motions that cost the same, the one that people expect: near home, its joints not wound up."""

import numpy as np

from selfmotion.basics import Array, RobotError
from selfmotion.robot import RobotModel

_WHOLE, _ROUNDING = 2.0 * np.pi, 1e-9


def usual_posture(robot: RobotModel) -> Array:
    """Return home (n,) where it is known, else the middle of the joints' limits [rad or m]."""
    try:
        return robot.home
    except RobotError:
        return np.asarray(0.5 * np.add(*robot.finite_limits()))


def far_from_usual(robot: RobotModel, motions: Array) -> Array:
    """Return how far motions (K, N, n) are from the usual posture on average, (K,) [rad]."""
    away = np.abs(motions - usual_posture(robot)) @ robot.joint_weights
    return np.asarray(away.mean(axis=1))


def wound_back(robot: RobotModel, motion: Array) -> Array:
    """Return a motion (N, n) with joints turned by whole turns, as near to usual as limits allow.

    The tool is where it was. What fits nowhere within its limits is put in the middle of them.
    """
    lowest, highest = motion.min(axis=0), motion.max(axis=0)
    middle, shift = 0.5 * (lowest + highest), np.zeros(robot.dof)
    usual = usual_posture(robot)
    for joint in np.flatnonzero(robot.is_revolute):
        lower, upper = robot.lower[joint], robot.upper[joint]
        wanted = round((usual[joint] - middle[joint]) / _WHOLE)
        # Rounding must not take a joint that stands on its limit round to the other side.
        least = np.ceil((lower - lowest[joint]) / _WHOLE - _ROUNDING)
        most = np.floor((upper - highest[joint]) / _WHOLE + _ROUNDING)
        if least <= most:
            shift[joint] = np.clip(wanted, least, most)
        elif np.isfinite(lower) and np.isfinite(upper):
            shift[joint] = round((0.5 * (lower + upper) - middle[joint]) / _WHOLE)
    return np.asarray(motion + _WHOLE * shift)

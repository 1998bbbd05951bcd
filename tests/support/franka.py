"""Limits of speed by position of the Franka Research 3, restated from its maker's publication.

Source: libfranka 0.21.2, include/franka/rate_limiting.h, `computeUpperLimitsJointVelocity` and
`computeLowerLimitsJointVelocity`, without the tolerance that is subtracted there. Nothing of the
product is used.
"""

import math

import numpy as np

import selfmotion as sm
from selfmotion.basics import Array

# Per joint: largest speed [rad/s], offset [rad/s], twice the deceleration [rad/s²], and where the
# square roots are 0 at the upper and at the lower end [rad].
TABLE = (
    (2.62, 0.30, 12.0, 2.7501, -2.7501),
    (2.62, 0.20, 5.17, 1.7918, -1.7918),
    (2.62, 0.20, 7.0, 2.9065, -2.9065),
    (2.62, 0.30, 8.0, -0.1458, -3.0481),
    (5.26, 0.35, 34.0, 2.8101, -2.8101),
    (4.18, 0.35, 11.0, 4.5205, 0.54092),
    (5.26, 0.35, 34.0, 3.0196, -3.0196),
)
# Documented limits of position [rad] (Franka Control Interface documentation, robot and interface
# specifications, limits for Franka Research 3).
LOWER = np.array([-2.7437, -1.7837, -2.9007, -3.0421, -2.8065, 0.5445, -3.0159])
UPPER = np.array([2.7437, 1.7837, 2.9007, -0.1518, 2.8065, 4.5169, 3.0159])
# And of acceleration [rad/s²] and jerk [rad/s³], of every joint.
ACCELERATION, JERK = 10.0, 5000.0


def velocity_limits(q: Array) -> tuple[Array, Array]:
    """Return the least and the largest velocity at configurations (K, 7), (K, 7) each [rad/s]."""
    lower, upper = np.empty_like(q), np.empty_like(q)
    for row, each in enumerate(q):
        for k, (most, offset, twice, last, first) in enumerate(TABLE):
            up = -offset + math.sqrt(max(0.0, twice * (last - each[k])))
            down = offset - math.sqrt(max(0.0, twice * (each[k] - first)))
            upper[row, k] = min(most, max(0.0, up))
            lower[row, k] = max(-most, min(0.0, down))
    return lower, upper


def refusals(q: Array, qd: Array, tolerance: float = 0.0) -> int:
    """Return at how many samples (K, 7) a velocity is beyond its limit by more than a tolerance."""
    lower, upper = velocity_limits(q)
    return int(((qd < lower - tolerance) | (qd > upper + tolerance)).any(axis=1).sum())


# Share of a joint's highest speed that a drawn motion reaches, and how far its joints go [rad].
FAST, FAR = 0.6, 1.2
# Distance of both its ends from the limits of position, at least [rad].
_INSIDE = 0.02
# The largest speed of a rest-to-rest quintic, times its duration over its way.
_QUINTIC = 1.875


def fast_line(robot: sm.RobotModel, seed: int) -> sm.Problem:
    """Return a line of an FR3's tool that a random motion of its joints would go about along.

    From rest to rest, in the time in which that motion reaches a share of some joint's highest
    speed. The joints' own limits of acceleration are left out of the choice.
    """
    rng = np.random.default_rng(seed)
    lower, upper = LOWER + _INSIDE, UPPER - _INSIDE
    start = rng.uniform(lower, upper)
    end = np.clip(start + rng.uniform(-FAR, FAR, 7), lower, upper)
    most = np.array([row[0] for row in TABLE])
    seconds = float(_QUINTIC * (np.abs(end - start) / (FAST * most)).max())
    path = sm.paths.Line(robot.pose(start), robot.pose(end), max(seconds, 0.3))
    return sm.Problem(robot, path, "position", start, clearance=None)

"""What an arm's controller accepts: limits of finite differences at 1 kHz, from and to standstill.

Shares no code with the planner: the motion comes as arrays and is interpolated by scipy; limits are
those that the makers publish (Franka Control Interface documentation, limits for Panda; UFACTORY
xArm user manual).
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BPoly

# A controller's cycle [s].
CYCLE = 1e-3


@dataclass(frozen=True)
class Limits:
    """Speed, acceleration and jerk, (n,) each [rad/s, rad/s², rad/s³]."""

    speed: np.ndarray
    acceleration: np.ndarray
    jerk: np.ndarray


LIMITS = {
    "panda": Limits(
        np.array([2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61]),
        np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]),
        np.array([7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0]),
    ),
    "xarm7": Limits(np.full(7, np.pi), np.full(7, 20.0), np.full(7, np.inf)),
}


def commanded(t: np.ndarray, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Return the positions of each cycle, with some at rest before and after, (K, n)."""
    spline = BPoly.from_derivatives(t, np.stack([q, qd, qdd], axis=1))
    cycles = np.arange(np.ceil((t[-1] - t[0]) / CYCLE) + 1) * CYCLE + t[0]
    moving = spline(np.minimum(cycles, t[-1]))
    return np.concatenate([np.tile(q[0], (4, 1)), moving, np.tile(q[-1], (4, 1))])


def shares(positions: np.ndarray, limits: Limits) -> np.ndarray:
    """Return the largest shares used of the limits of speed, acceleration and jerk, (3,)."""
    used, rates = [], positions
    for limit in (limits.speed, limits.acceleration, limits.jerk):
        rates = np.diff(rates, axis=0) / CYCLE
        used.append(float((np.abs(rates) / limit).max()))
    return np.array(used)

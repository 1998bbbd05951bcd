"""Segments through tool poses, and the joint motion that a controller makes of them.

Between two poses the position is linear, the orientation follows slerp (K. Shoemake, "Animating
rotation with quaternion curves", 1985), external axes are linear; joints follow by inverse
kinematics. ``MoveL``, ``LIN`` and ``movel`` are documented so; ``SPLINE`` interpolates smoothly.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, Ints
from selfmotion.shop.controllers.segments import Segment, subdivided
from selfmotion.shop.controllers.tool_frames import ToolFrames

# Sample points of an interval between two poses, as shares of it: joints curve in between.
_POSE_SAMPLES = np.linspace(0.0, 1.0, 16, endpoint=False)
# Sine of an angle below which slerp is replaced by linear interpolation.
_SMALL_SINE = 1e-9


@dataclass(frozen=True, eq=False, kw_only=True)
class PoseSegment(Segment):
    """A motion from rest to rest through tool poses.

    Attributes
    ----------
    positions, quaternions : (K + 1, 3), (K + 1, 4)
        Tool poses in the work object: positions [m], and quaternions x, y, z, w, each with the sign
        that is nearer to the previous one.
    frames : ToolFrames
    near : callable
        Times → initial guesses of inverse kinematics (K, n), in the robot's order.
    order : (n,)
        Index of the robot's joint for each column of `q`.
    """

    positions: Array
    quaternions: Array
    frames: ToolFrames
    near: Callable[[Array], Array]
    order: Ints

    sample_shares: ClassVar[Array] = _POSE_SAMPLES
    knot_shares: ClassVar[Array] = _POSE_SAMPLES

    @override
    def in_order(self, order: Sequence[int]) -> "PoseSegment":
        return replace(self, q=self.q[:, order], order=self.order[list(order)])

    @property
    @override
    def rows(self) -> Array:
        """Positions, quaternions and external axes, (K + 1, 7 + m)."""
        by_robot = self.q[:, np.argsort(self.order)]
        return np.hstack([self.positions, self.quaternions, by_robot[:, self.frames.external]])

    @override
    def between(self, times: Array, t: Array, rows: Array) -> Array:
        return linear_poses(times, t, rows)

    @override
    def spline(self, times: Array) -> Array:
        rows = super().spline(times)
        rows[:, 3:7] /= np.linalg.norm(rows[:, 3:7], axis=1, keepdims=True)
        return rows

    @override
    def joints(self, rows: Array, times: Array) -> Array:
        q = np.array(self.near(times))
        q[:, self.frames.external] = rows[:, 7:]
        joints, converged = self.frames.inverse_kinematics(rows[:, :3], rows[:, 3:7], q)
        return np.where(converged[:, None], joints, np.nan)[:, self.order]


def linear_poses(times: Array, t: Array, rows: Array) -> Array:
    """Return rows (K, 7 + m) at times: orientations by slerp; positions, external axes linear."""
    k = np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(t) - 2)
    share = ((times - t[k]) / (t[k + 1] - t[k]))[:, None]
    values: Array = (1.0 - share) * rows[k] + share * rows[k + 1]
    first, last = rows[k, 3:7], rows[k + 1, 3:7]
    # The angle between quaternions is at most 90°: consecutive ones have the nearer sign.
    difference = np.linalg.norm(first - last, axis=1, keepdims=True)
    total = np.linalg.norm(first + last, axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(difference, total)
    sine = np.sin(angle)
    is_small = sine < _SMALL_SINE
    sine = np.where(is_small, 1.0, sine)
    first_weight, last_weight = np.sin((1.0 - share) * angle) / sine, np.sin(share * angle) / sine
    slerp = np.where(is_small, values[:, 3:7], first_weight * first + last_weight * last)
    values[:, 3:7] = slerp / np.linalg.norm(slerp, axis=1, keepdims=True)
    return values


def largest_tool_speeds(t: Array, positions: Array, quaternions: Array) -> tuple[float, float]:
    """Return the largest linear and angular speed of the tool through timed poses [m/s, rad/s].

    By linear interpolation, and on the clamped cubic spline.
    """
    from scipy.interpolate import CubicSpline

    steps = np.diff(t)
    linear = float((np.linalg.norm(np.diff(positions, axis=0), axis=1) / steps).max())
    chords = np.linalg.norm(np.diff(quaternions, axis=0), axis=1)
    angular = float((4.0 * np.arcsin(np.minimum(0.5 * chords, 1.0)) / steps).max())
    spline = CubicSpline(t, np.hstack([positions, quaternions]), bc_type="clamped")
    rates = spline(subdivided(t, _POSE_SAMPLES), 1)
    linear = max(linear, float(np.linalg.norm(rates[:, :3], axis=1).max()))
    # The rate of a unit quaternion is half the angular speed.
    return linear, max(angular, 2.0 * float(np.linalg.norm(rates[:, 3:], axis=1).max()))


def aligned_quaternions(quaternions: Array) -> Array:
    """Return quaternions (K, 4), each with the sign that is nearer to the previous one."""
    aligned = np.array(quaternions)
    for k in range(1, len(aligned)):
        if aligned[k] @ aligned[k - 1] < 0.0:
            aligned[k] *= -1.0
    return aligned

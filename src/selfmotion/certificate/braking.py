"""Velocity limits that depend on the position of the joint, at all times.

A joint that is v away from standing still is to stop before the end of its range: makers allow

    v ≤ v_upper(q) = max(0, sqrt(2 a max(0, upper - q)) - o),
    v ≥ v_lower(q) = min(0, o - sqrt(2 a max(0, q - lower)))

with a deceleration a and an offset o (libfranka 0.21.2, include/franka/rate_limiting.h and
src/joint_velocity_limits.cpp, of the Franka Research 3, where a constant limit of speed applies
besides). For v > 0 the first one is

    e(q, v) = max(0, v + o)² / (2 a) + q - upper ≤ 0,

a convex function of (q, v). On an interval of time the curve (q, q̇) lies in the convex hull of its
Bernstein control points (G. Farin, Curves and Surfaces for CAGD, 5th ed. 2002, ch. 4 and 5: degree
elevation, convex hull property), so that e is nowhere above its largest value at these. Where q̇ has
no control point above 0, the upper limit is kept whatever q is. The lower one is the mirror image.
"""

from dataclasses import dataclass

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, Flags, ProblemError, read_only, series
from selfmotion.certificate.bounding import halves
from selfmotion.certificate.quantity import Column, Quantity
from selfmotion.certificate.requirement import Finding, FinishedMotion, Requirement, of_some
from selfmotion.model.motion import Trajectory

NAME = "position-dependent velocity limits"
# What a verdict says of them.
_COVERED = "velocities by position"
# Largest number of halvings of an interval: below 1e-6 s of a sample period of 10 ms.
_DEPTH = 16
# Largest number of intervals at once, which bounds memory: more stay undecided.
_MANY = 100_000
# Speed that counts as standing still [rad/s or m/s]: rounding of a motion that ends at rest.
_STILL = 1e-9
# Excess that counts as rounding [rad or m].
_ROUNDING = 1e-12
# Places of an interval at which shares are measured, for the report.
_PLACES = np.linspace(-1.0, 1.0, 9)
# Times at which the largest share is looked for around the worst of these …
_AROUND = 33
# … and how often, each time between the neighbours of the worst.
_CLOSER = 4
# Limit that counts where a joint may not move, for the least time of a path [rad/s or m/s].
_SLOWEST = 1e-3
# Shares above this are reported as this: the limit is 0 there.
_MAX_SHARE = 1e6


@dataclass(frozen=True, eq=False)
class BrakingCurves:
    """The curves v_upper(q) and v_lower(q) of n joints.

    Attributes
    ----------
    deceleration : (n,)
        a [rad/s² or m/s²].
    offset : (n,)
        o [rad/s or m/s], no less than 0.
    lower, upper : (n,)
        Where the square roots are 0 [rad or m]; ±inf for a joint without a curve.
    """

    deceleration: Array
    offset: Array
    lower: Array
    upper: Array

    def __post_init__(self) -> None:
        for name in ("deceleration", "offset", "lower", "upper"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        # Written so that NaN is refused.
        kept = (self.deceleration > 0.0) & (self.offset >= 0.0) & (self.lower < self.upper)
        if not np.all(kept & np.isfinite(self.deceleration) & np.isfinite(self.offset)):
            raise ProblemError(
                f"{NAME}: deceleration {self.deceleration.tolist()}, offset "
                f"{self.offset.tolist()}, lower {self.lower.tolist()}, upper "
                f"{self.upper.tolist()}, expected decelerations above 0, offsets of 0 or more, and "
                f"lower below upper"
            )

    @property
    def limited(self) -> Flags:
        """Which joints have a curve, (n,)."""
        return np.isfinite(self.lower) | np.isfinite(self.upper)

    @property
    def resting(self) -> tuple[Array, Array]:
        """The range of positions at which a joint may move at all, (n,) each [rad or m]."""
        reserve = self.offset**2 / (2.0 * self.deceleration)
        return self.lower + reserve, self.upper - reserve

    def extended(self, more: int) -> "BrakingCurves":
        """Return the curves with `more` joints after them that have none."""
        ends = (1.0, 0.0, -np.inf, np.inf)
        own = self.deceleration, self.offset, self.lower, self.upper
        rows = (np.append(row, np.full(more, end)) for row, end in zip(own, ends, strict=True))
        return BrakingCurves(*rows)

    def excess(self, q: Array, qd: Array) -> Array:
        """Return e of the upper and of the lower curve, (2, …, n) [rad or m], for (…, n) each."""
        above = self._stopping(qd) + q - self.upper
        below = self._stopping(-qd) - q + self.lower
        return np.stack([above, below])

    def slopes(self, qd: Array) -> tuple[Array, Array]:
        """Return ∂e/∂q̇ of both curves, (…, n) each [s]; ∂e/∂q are 1 and -1."""
        above = np.maximum(qd + self.offset, 0.0) / self.deceleration
        below = -np.maximum(self.offset - qd, 0.0) / self.deceleration
        return above, below

    def velocities(self, q: Array) -> tuple[Array, Array]:
        """Return v_lower(q) and v_upper(q), (…, n) each [rad/s or m/s]."""
        room = 2.0 * self.deceleration * np.maximum(np.stack([q - self.lower, self.upper - q]), 0.0)
        below, above = np.maximum(np.sqrt(room) - self.offset, 0.0)
        return -below, above

    def shares(self, q: Array, qd: Array) -> Array:
        """Return the share of their limits that velocities use, (…, n); 0 of a joint at rest."""
        lower, upper = self.velocities(q)
        limit = np.where(qd > 0.0, upper, -lower)
        size = np.abs(qd)
        used = np.minimum(size, _MAX_SHARE * limit) / np.where(limit > 0.0, limit, 1.0)
        return np.where(size <= _STILL, 0.0, np.where(limit > 0.0, used, _MAX_SHARE))

    def _stopping(self, qd: Array) -> Array:
        return np.asarray(np.maximum(qd + self.offset, 0.0) ** 2 / (2.0 * self.deceleration))


@dataclass(frozen=True, eq=False)
class VelocityByPosition(Requirement):
    """v_lower(q) ≤ q̇ ≤ v_upper(q) of each joint, at all times.

    Attributes
    ----------
    curves : BrakingCurves
    joint_names, units : tuple of str
        Of the joints, and of their coordinates.
    """

    curves: BrakingCurves
    joint_names: tuple[str, ...]
    units: tuple[str, ...]
    name: str = NAME

    @property
    def quantity(self) -> Quantity:
        """The shares of their limits that velocities use, with the limit 1, for other paces.

        Where a joint may not move, its limit counts as a small one.
        """
        columns = [
            Column(name, f"velocity by position of joint '{name}'", "", 1)
            for name in self.joint_names
        ]

        def inverse(q: Array, qd: Array) -> Array:
            lower, upper = self.curves.velocities(q)
            return np.asarray(1.0 / np.maximum(np.where(qd > 0.0, upper, -lower), _SLOWEST))

        def by_state(q: Array, qd: Array, qdd: Array) -> tuple[Array, ...]:
            """At the same positions: the derivative by q is left out."""
            by_rate = inverse(q, qd)[:, :, None] * np.eye(q.shape[1])
            return np.zeros_like(by_rate), by_rate

        limit = np.where(self.curves.limited, 1.0, np.inf)
        return Quantity(
            self.name,
            columns,
            lambda q, qd, qdd: qd * inverse(q, qd),
            by_state,
            limit,
            of_pace=True,
        )

    @property
    @override
    def covers(self) -> tuple[str, ...]:
        limited = self.curves.limited
        return (_COVERED if limited.all() else of_some(_COVERED),) if limited.any() else ()

    @override
    def judge(self, motion: FinishedMotion) -> Finding:
        """Return the largest share of a limit that was measured.

        Whether it is satisfied is proved by control points on intervals that are halved.
        """
        given = motion.trajectory
        pending = np.stack([given.t[:-1], given.t[1:]], axis=1)
        broken = False
        share, time, joint = 0.0, float(given.t[0]), 0
        for _ in range(_DEPTH + 1):
            used, times = self._measured(given, pending)
            # Written so that NaN is worse than any.
            which = np.unravel_index(
                int(np.argmax(np.where(np.isnan(used), np.inf, used))), used.shape
            )
            if not used[which] <= share:
                share, time, joint = float(used[which]), float(times[which[:2]]), int(which[2])
            broken = not share <= 1.0
            pending = pending[~self._kept(given, pending)]
            if broken or not 0 < len(pending) <= _MANY:
                break
            pending = halves(pending)
        kept = not broken and not len(pending)
        if broken:
            share, time = self._peak(given, joint, time, share)
        elif not kept:
            time = float(pending[0, 0])
        return self._finding(motion, joint, time, share, kept)

    def _kept(self, motion: Trajectory, intervals: Array) -> Flags:
        """Return on which intervals (I, 2) both limits of all joints are kept for certain, (I,)."""
        half = 0.5 * (intervals[:, 1] - intervals[:, 0])
        table = motion.polynomials(intervals.mean(axis=1), half)
        # Of s from 0 to 1, in place of u from -1 to 1.
        table = series.recentred(table, np.full((1, 1), -1.0), np.full((1, 1), 2.0))
        degree = len(table) - 1
        rates = table[1:] * np.arange(1.0, degree + 1.0)[:, None, None] / (2.0 * half[:, None])
        into = series.bernstein(degree)
        q = np.tensordot(into, table, 1)
        qd = np.tensordot(into[:, :degree], rates, 1)
        excess = self.curves.excess(q, qd).max(axis=1)
        safe = np.stack([qd.max(axis=0), -qd.min(axis=0)]) <= _STILL
        return np.asarray((safe | (excess <= _ROUNDING)).all(axis=(0, 2)))

    def _measured(self, motion: Trajectory, intervals: Array) -> tuple[Array, Array]:
        """Return shares at places of intervals (I, P, n), and when (I, P)."""
        first, last = intervals[:, :1], intervals[:, 1:]
        times = np.clip(0.5 * (first + last) + 0.5 * (last - first) * _PLACES, first, last)
        q, qd = (motion(times.ravel(), order) for order in range(2))
        return self.curves.shares(q, qd).reshape(*times.shape, -1), times

    def _peak(
        self, motion: Trajectory, joint: int, time: float, share: float
    ) -> tuple[float, float]:
        """Return the largest share of a joint's limit near a time, and when it is."""
        near = float(np.diff(motion.t)[max(int(np.searchsorted(motion.t, time)) - 1, 0)])
        for _ in range(_CLOSER):
            first, last = max(time - near, motion.t[0]), min(time + near, motion.t[-1])
            t = np.append(np.linspace(first, last, _AROUND), time)
            used = self.curves.shares(motion(t), motion(t, 1))[:, joint]
            worst = int(np.argmax(used))
            if not used[worst] <= share:
                share, time = float(used[worst]), float(t[worst])
            near *= 2.0 / (_AROUND - 1)
        return share, time

    def _finding(
        self, motion: FinishedMotion, joint: int, time: float, share: float, kept: bool
    ) -> Finding:
        name, unit = self.joint_names[joint], self.units[joint]
        at = np.array([time])
        q, qd = motion.trajectory(at)[0], motion.trajectory(at, 1)[0]
        limit = self.curves.velocities(q)[1 if qd[joint] > 0.0 else 0][joint]
        text = (
            f"joint '{name}' moves at {qd[joint]:.4g} {unit}/s at t = {time:.3f} s, where its "
            f"limit at {q[joint]:.4g} {unit} is {limit:.4g} {unit}/s"
        )
        if not kept and share <= 1.0:
            text = f"whether {self.name} hold is not decided near t = {time:.6g} s: {text}"
        # At a slower pace velocities fall, and the limits of the same positions stay.
        finite = share < _MAX_SHARE
        factor = 1.0 if kept else max(share, 1.0) if finite and share > 1.0 else np.inf
        if 1.0 < factor < np.inf:
            text += f": give it {factor:.5g} times the duration"
        return Finding(self.name, name, time, share, 1.0, kept, text, True, factor)

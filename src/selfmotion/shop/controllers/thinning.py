"""Thinning: the fewest joint targets with which a controller keeps within a tolerance of a motion.

Straight lines between targets a time h apart deviate by at most h²|Jq̈|/8. Targets are spread evenly
in ∫ √(|Jq̈|/8) dt (C. de Boor, "Good approximation by splines with variable knots", 1973); the
deviation is then measured by forward kinematics. Intervals in which the spline through the targets
exceeds a feed or a speed limit are halved.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np

from selfmotion.basics import Array, Flags, ProblemError
from selfmotion.certificate import Tolerance
from selfmotion.model.motion import Trajectory
from selfmotion.model.robot import Chain
from selfmotion.shop.controllers.deviations import (
    NO_DEVIATION,
    Deviation,
    deviation_between,
    deviation_of,
)
from selfmotion.shop.controllers.operations import Operation
from selfmotion.shop.controllers.pose_numbers import ANGLE_DIGITS, LENGTH_DIGITS, TIME_DIGITS
from selfmotion.shop.controllers.segments import Event, Segment

# Share of a feed's tolerance that targets may use at the evaluated times: the error is larger in
# between.
_FEED_SHARE = 0.8
# Share of a speed limit that the spline may use if the motion uses no more.
_SPEED_SHARE = 0.9995
# Shortest step [s]: no controller has a shorter cycle, and rounded angles would be jumps of speed.
_MIN_STEP = 2e-3
# Times at which the acceleration is evaluated, per interval between two samples.
_SAMPLES_PER_INTERVAL = 4
# Targets per interval without acceleration, against division by zero.
_BASE_TARGETS = 1e-3
# Shortest interval over which these are spread, against division by zero [s].
_MIN_INTERVAL = 1e-6
# Largest number of refinements of the targets.
_MAX_REFINEMENTS = 20
# Smallest growth of the density of targets from one trial to the next.
_MIN_DENSITY_GROWTH = 1.05
# Safety factor of the density that the measured deviation asks for.
_DENSITY_SAFETY = 1.02
# Largest number of targets that a controller takes.
_MAX_TARGETS = 100_000
# How far inside of a feed's interval its ends are looked at [s].
_INSIDE = 1e-6
# Smallest margin of a feed, against division by zero [m²/s²].
_MIN_FEED_MARGIN = 1e-12
# Number of times at which rest is tested.
_REST_SAMPLES = 33
# Change of the joints below which they rest [rad or m].
_REST_CHANGE = 1e-9


@dataclass(frozen=True, eq=False)
class Section:
    """Section of an operation between two rests.

    Attributes
    ----------
    operation : Operation
    slides : (n,)
        Whether each joint is prismatic.
    first, last : float
        Start and end [s].
    """

    operation: Operation
    slides: Flags
    first: float
    last: float
    # Smallest density of targets, as a share of the largest one.
    min_density: ClassVar[float] = 0.1
    # Smallest number of targets between two events or rests.
    min_targets: ClassVar[int] = 4

    @property
    def events(self) -> list[tuple[float, str]]:
        """Times of the section's events [s], and their names."""
        start, end = float(self.operation.motion.t[0]), float(self.operation.motion.t[-1])
        return [
            (start + at, name)
            for at, name in self.operation.events
            if (self.first == start or self.first < start + at)
            and (self.last == end or start + at <= self.last)
        ]

    def segments(self, allowed: Tolerance) -> list[tuple[Segment, Deviation]]:
        """Return the segments of the section and their deviations.

        Subclasses divide a seam at rests of the tool.

        Raises
        ------
        ProblemError
            See `thinned`.
        """
        return [self.thinned(allowed)]

    def thinned(self, allowed: Tolerance) -> tuple[Segment, Deviation]:
        """Return the segment with the fewest targets, and its deviation.

        Raises
        ------
        ProblemError
            The digits of files are too few for the tolerance, or the targets too many.
        """
        fixed = _distinct_times(self.first, self.last, [at for at, _ in self.events])
        if is_at_rest(self.operation.motion, self.first, self.last):
            return self._segment_through(fixed, at_rest=True), NO_DEVIATION
        self._check_digits(allowed)
        t = self._target_times(allowed, fixed)
        for _ in range(_MAX_REFINEMENTS):
            segment = self._segment_through(t)
            exceeded = self._exceeds_speed(segment)
            if not exceeded.any():
                break
            # With the neighbouring intervals, so that their lengths vary slowly.
            halved = np.convolve(exceeded, np.ones(3), mode="same") > 0.0
            halved &= np.diff(t) > 2.0 * _MIN_STEP
            if not halved.any():
                break
            t = np.sort(np.append(t, 0.5 * (t[1:] + t[:-1])[halved]))
        return segment, self._deviation(segment)

    def _target_times(self, allowed: Tolerance, fixed: Array) -> Array:
        """Return times of targets with which the deviation is within the tolerance, (K,) [s]."""
        density = 1.0
        for _ in range(_MAX_REFINEMENTS):
            t = self.spread_targets(fixed, allowed, density)
            deviation = self._deviation(self._segment_through(t))
            if deviation.share(allowed) <= 1.0:
                return t
            needed = _DENSITY_SAFETY * float(np.sqrt(deviation.share(allowed)))
            density *= max(_MIN_DENSITY_GROWTH, needed)
        raise ProblemError(
            f"'{self.operation.name}' is off by {1e3 * deviation.position:.3g} mm and "
            f"{np.degrees(max(deviation.rotation, deviation.joint)):.3g}° with {len(t)} targets; "
            f"allow more than {_tolerance_text(self.operation, allowed)}"
        )

    def spread_targets(self, fixed: Array, allowed: Tolerance, density: float) -> Array:
        """Return the times of targets, (K,) [s]: the fixed ones and others between them.

        Their density is `density` times the root of the scaled acceleration.
        """
        times = [fixed[:1]]
        for begin, end in pairwise(fixed):
            t = self._samples_between(begin, end)
            rate = np.sqrt(self.scaled_acceleration(t, allowed) / 8.0)
            # A spline oscillates where interval lengths jump.
            rate = np.maximum(rate, self.min_density * float(rate.max()))
            rate += _BASE_TARGETS / max(end - begin, _MIN_INTERVAL)
            total = np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t)))
            targets = max(self.min_targets, int(np.ceil(density * total[-1])))
            # Times have few digits in programs: targets may not coincide.
            targets = min(targets, max(1, int((end - begin) * 10**TIME_DIGITS / 2)))
            times.append(np.interp(np.linspace(0.0, total[-1], targets + 1)[1:], total, t))
            times[-1][-1] = end
        return np.concatenate(times)

    def _samples_between(self, begin: float, end: float) -> Array:
        """Return times at which the acceleration is evaluated, (K,) [s]."""
        samples = self.operation.motion.t
        inside = samples[(samples > begin) & (samples < end)]
        marks = np.concatenate([[begin], inside, [end]])
        count = _SAMPLES_PER_INTERVAL * (len(marks) - 1) + 1
        shares = np.linspace(0, len(marks) - 1, count)
        return np.asarray(np.interp(shares, np.arange(len(marks)), marks))

    def scaled_acceleration(self, t: Array, allowed: Tolerance) -> Array:
        """Return accelerations of tool and joints divided by their tolerances, (K,) [1/s²]."""
        motion = self.operation.motion
        q, qdd = motion(t), motion(t, 2)
        scaled: Array = np.abs(qdd).max(axis=1) / allowed.rotation
        for chain in self.operation.chains:
            rates = np.einsum("kij,kj->ki", chain.along(q)[0], qdd)
            for rows, limit in ((slice(0, 3), allowed.position), (slice(3, 6), allowed.rotation)):
                scaled = np.maximum(scaled, np.linalg.norm(rates[:, rows], axis=1) / limit)
        return scaled

    def _segment_through(self, t: Array, *, at_rest: bool = False) -> Segment:
        """Return the segment of targets at times, rounded to the digits of the file."""
        if len(t) > _MAX_TARGETS:
            raise ProblemError(
                f"'{self.operation.name}' takes more than {_MAX_TARGETS} targets; allow a larger "
                f"deviation"
            )
        offset = np.round(t - self.first, TIME_DIGITS)
        # Configurations at the rounded times.
        q = self._rounded(self.operation.motion(np.minimum(self.first + offset, self.last)))
        if at_rest:
            q[:] = q[0]
        events = (Event(int(np.abs(t - at).argmin()), name) for at, name in self.events)
        return Segment(self.operation.name, offset, q, tuple(events))

    def _deviation(self, segment: Segment) -> Deviation:
        return deviation_of(segment, self.operation.motion, self.operation.chains, self.first)

    def _rounded(self, q: Array) -> Array:
        """Return coordinates [rad or m] rounded to the digits of files."""
        degrees = np.radians(np.round(np.degrees(q), ANGLE_DIGITS))
        return np.where(self.slides, 1e-3 * np.round(1e3 * q, LENGTH_DIGITS), degrees)

    def _check_digits(self, allowed: Tolerance) -> None:
        """Raise ProblemError for a tolerance below the rounding of targets in files."""
        q = self.operation.motion.q
        deviation = deviation_between(self._rounded(q), q, self.operation.chains)
        if deviation.share(allowed) > 1.0:
            raise ProblemError(
                f"'{self.operation.name}': programs count angles in {10.0**-ANGLE_DIGITS:g}°, "
                f"which is up to {1e3 * deviation.position:.2g} mm and "
                f"{np.degrees(deviation.rotation):.2g}° of the tool; allow more than "
                f"{_tolerance_text(self.operation, allowed)}"
            )

    def _exceeds_speed(self, segment: Segment) -> Flags:
        """Whether a feed or a speed limit is violated in each interval between targets, (K,).

        Only where the motion itself satisfies it; by each interpolation of a controller, at its
        knots and where feeds begin and end, as a run-up or run-down may share an interval with one.
        """
        largest_share = np.zeros(len(segment.t) - 1)
        last = len(largest_share) - 1
        ends = self._feed_ends()
        for knots in segment.motions():
            motion = Trajectory(*knots, self.operation.motion.joint_names)
            times = np.union1d(knots.t, ends[ends < knots.t[-1]])
            interval = np.clip(np.searchsorted(segment.t, times, side="right") - 1, 0, last)
            t = np.clip(self.first + times, self.first, self.operation.motion.t[-1])
            q, qd = motion(times), motion(times, 1)
            shares = np.maximum(self._joint_speed_shares(t, qd), self._feed_shares(t, q, qd))
            np.maximum.at(largest_share, interval, shares)
        return np.asarray(largest_share > 1.0)

    def _feed_ends(self) -> Array:
        """Return times of the section just after feeds begin and before they end, (K,) [s]."""
        windows = [feed.during for feeds in self.operation.feeds for feed in feeds]
        inside = np.concatenate([np.zeros((0, 2)), *windows]) + np.array([_INSIDE, -_INSIDE])
        ends = inside.ravel() + self.operation.motion.t[0] - self.first
        return np.asarray(ends[ends > 0.0])

    def _joint_speed_shares(self, t: Array, qd: Array) -> Array:
        """Return the largest share of its limit that a joint speed takes at times, (K,)."""
        if self.operation.speed_limits is None:
            return np.zeros(len(t))
        limits = _SPEED_SHARE * self.operation.speed_limits
        is_slow = np.abs(self.operation.motion(t, 1)) <= limits
        return np.asarray(np.where(is_slow, np.abs(qd) / limits, 0.0).max(axis=1))

    def _feed_shares(self, t: Array, q: Array, qd: Array) -> Array:
        """Return errors of the tool speed at times as shares of the margins of feeds, (K,)."""
        motion = self.operation.motion
        planned_q, planned_qd = motion(t), motion(t, 1)
        shares = np.zeros(len(t))
        # Moves have no feeds.
        for chain, feeds in zip(self.operation.chains, self.operation.feeds, strict=False):
            velocity = _tool_velocities(chain, q, qd)
            planned = _tool_velocities(chain, planned_q, planned_qd)
            # The error along the planned velocity, times its length [m²/s²].
            speed_error = np.abs(np.einsum("kc,kc->k", velocity - planned, planned))
            for feed in feeds:
                margin = max(_FEED_SHARE * feed.slowest * feed.left_over, _MIN_FEED_MARGIN)
                for begin, end in feed.during + motion.t[0]:
                    during = (t > begin) & (t < end)
                    shares = np.maximum(shares, np.where(during, speed_error / margin, 0.0))
        return shares


def _tool_velocities(chain: Chain, q: Array, qd: Array) -> Array:
    """Return linear velocities of the tool, (K, 3) [m/s]."""
    return np.asarray(np.einsum("kcn,kn->kc", chain.along(q)[0][:, :3], qd))


def _tolerance_text(operation: Operation, allowed: Tolerance) -> str:
    """Return a tolerance as a line of a file of settings."""
    key = "move_deviation" if operation.is_move else "deviation"
    return (
        f"{key} = {{ position_mm = {1e3 * allowed.position:.3g}, "
        f"rotation_deg = {np.degrees(allowed.rotation):.3g} }}"
    )


def _distinct_times(first: float, last: float, times: Sequence[float]) -> Array:
    """Return first, last and the times between them that are distinct after rounding."""
    separation, distinct = 2.0 * 10.0**-TIME_DIGITS, [first]
    for t in sorted(times):
        if distinct[-1] + separation < t < last - separation:
            distinct.append(t)
    return np.array([*distinct, last])


def is_at_rest(motion: Trajectory, first: float, last: float) -> bool:
    """Whether all joints are at rest between two times."""
    times = np.linspace(first, last, _REST_SAMPLES)
    return bool(np.abs(motion(times) - motion(first)).max() < _REST_CHANGE)

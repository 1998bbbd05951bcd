"""A motion cut into segments, each of as few tool poses or joint targets as can be."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, Flags, ProblemError, Progress, silent
from selfmotion.certificate import Tolerance
from selfmotion.model.motion import Trajectory
from selfmotion.shop.controllers.deviations import (
    NO_DEVIATION,
    SAMPLING_FACTOR,
    Deviation,
    Deviations,
)
from selfmotion.shop.controllers.operations import Operation
from selfmotion.shop.controllers.pose_numbers import Rounding
from selfmotion.shop.controllers.pose_segments import PoseSegment, aligned_quaternions
from selfmotion.shop.controllers.segments import Event, Segment, subdivided
from selfmotion.shop.controllers.thinning import Section, is_at_rest
from selfmotion.shop.controllers.tool_frames import ToolFrames

# As few tool poses as keep a controller near a motion.
#
# A straight line over a time h is off a motion by h²|a|/8, with a the acceleration of the tool in
# the work object; the joints then by |J⁻¹a| h²/8. Poses are spread evenly in the root of that, as
# joint targets are (`controllers/thinning.py`), and doubled where they are too far apart
# by inverse kinematics of what is in between.

# Largest number of refinements of the targets.
_MAX_REFINEMENTS = 16
# Shortest time between two targets: controllers do not interpolate in less [s].
_SHORTEST = 4e-3
# Number of refinements that add targets everywhere …
_EVENLY = 5
# … if no error exceeds this multiple of its tolerance.
_MUCH = 9.0
# Times at which the smallest singular value is evaluated, per interval between two samples.
_FINER = 4
# Step of the central differences for accelerations [s].
_AROUND = 2e-3
# Rounding of poses in programs and controllers, in any language [m, rad]: where that alone takes
# joints as far as is allowed, the arm is singular.
_OF_POSES = 1e-6


class NotByPosesError(ProblemError):
    """Poses do not keep a motion; the message says why."""


@dataclass(frozen=True, eq=False)
class PoseSection(Section):
    """Section of an operation between two rests, to be written as tool poses.

    Attributes
    ----------
    frames : ToolFrames
    rounding : Rounding
        Poses as they are when the file is read again.
    """

    frames: ToolFrames
    rounding: Rounding

    min_density: ClassVar[float] = 0.02
    min_targets: ClassVar[int] = 2

    @override
    def segments(self, allowed: Tolerance) -> list[tuple[Segment, Deviation]]:
        """Return the segments of a motion by poses.

        Raises
        ------
        NotByPosesError
            The arm is singular somewhere, as at an end: its joints do not follow from poses.
        """
        self.check_regular(allowed)
        return super().segments(allowed)

    def check_regular(self, allowed: Tolerance) -> None:
        """Raise NotByPosesError where the arm is singular within what is allowed."""
        motion = self.operation.motion
        if is_at_rest(motion, self.first, self.last):
            return
        inside = motion.t[(motion.t > self.first) & (motion.t < self.last)]
        marks = np.concatenate([[self.first], inside, [self.last]])
        t = subdivided(marks, np.linspace(0.0, 1.0, _FINER, endpoint=False))
        far = _OF_POSES / np.maximum(self.frames.smallest_singular_values(motion(t)), 1e-12)
        if far.max() > allowed.rotation:
            elapsed = float(t[int(far.argmax())] - motion.t[0])
            raise NotByPosesError(
                f"'{self.operation.name}': the arm is singular at t = {elapsed:.4g} s"
            )

    @override
    def thinned(self, allowed: Tolerance) -> tuple[Segment, Deviation]:
        """Return the one segment through as few poses as suffice.

        Raises
        ------
        NotByPosesError
            There are no such poses.
        """
        segment, deviation = super().thinned(allowed)
        # More targets are looked at elsewhere: near a singular pose joints swing in between.
        if isinstance(segment, PoseSegment) and deviation.share(allowed) > 1.0:
            raise self._singular(self.first, allowed)
        return segment, deviation

    @override
    def _target_times(self, allowed: Tolerance, fixed: Array) -> Array:
        """Return times at which poses are written, (K,) [s].

        Raises
        ------
        NotByPosesError
            There are no such poses.
        """
        t, more = self.spread_targets(fixed, allowed, 1.0), 1.0
        for tries in range(_MAX_REFINEMENTS):
            shares = self._shares(self._segment_through(t), allowed)
            far, worst = shares > 1.0, float(shares.max())
            if not far.any():
                return t
            if tries < _EVENLY and worst < _MUCH:
                more *= max(1.05, 1.02 * float(np.sqrt(worst)))
                t = self.spread_targets(fixed, allowed, more)
                continue
            if np.diff(t)[far].min() < _SHORTEST:
                break
            # With their neighbours, so that a smooth curve through all does not swing.
            near = np.convolve(far, np.ones(3), mode="same") > 0.0
            t = np.sort(np.append(t, (0.5 * (t[1:] + t[:-1]))[near]))
        raise self._singular(float(t[:-1][far][0]), allowed)

    def _singular(self, time: float, allowed: Tolerance) -> NotByPosesError:
        """Return the error that poses near a time of the motion [s] do not give its joints."""
        elapsed = time - self.operation.motion.t[0]
        return NotByPosesError(
            f"'{self.operation.name}': near t = {elapsed:.4g} s the joints do not "
            f"follow from poses within {1e3 * allowed.position:.3g} mm and "
            f"{np.degrees(allowed.rotation):.3g}°: it is singular there, or turns too fast"
        )

    def _check_digits(self, allowed: Tolerance) -> None:
        """Digits of poses are finer than those of joints."""

    @override
    def _segment_through(self, t: Array, *, at_rest: bool = False) -> Segment:
        segment = super()._segment_through(t, at_rest=at_rest)
        if at_rest:
            return segment
        motion = self.operation.motion
        exact = motion(np.minimum(self.first + segment.t, self.last))
        positions, quaternions = self.rounding(*self.frames.tool_poses(exact))
        # External axes in their digits, the arm's joints as they follow.
        q, arrived = self.frames.inverse_kinematics(
            positions, quaternions, self._mixed(exact, segment.q)
        )
        if not arrived.all():
            at = float(t[int(np.argmin(arrived))])
            raise NotByPosesError(
                f"'{self.operation.name}': the arm is singular at t = {at - motion.t[0]:.4g} s"
            )
        events: tuple[Event, ...] = segment.events
        return PoseSegment(
            segment.name,
            segment.t,
            q,
            events,
            positions=positions,
            quaternions=aligned_quaternions(quaternions),
            frames=self.frames,
            near=lambda times: motion(np.minimum(self.first + times, self.last)),
            order=np.arange(q.shape[1]),
        )

    def _mixed(self, exact: Array, digits: Array) -> Array:
        q, others = np.array(exact), self.frames.external
        q[:, others] = digits[:, others]
        return q

    def _shares(self, segment: Segment, allowed: Tolerance) -> Array:
        """Return how much of what is allowed each step between two targets takes, (K,)."""
        times, count = segment.evaluation_times(), len(segment.t) - 1
        motion = self.operation.motion
        exact = motion(np.clip(self.first + times, motion.t[0], motion.t[-1]))
        worst = np.zeros(count)
        lines = segment.interpolated(times)
        for line in lines:
            joints = np.abs(line - exact).max(axis=1) / allowed.rotation
            worst = np.maximum(worst, largest(joints, count))
        # Where joints are near, the tool is nearly so: only these are placed.
        for line in lines if worst.max() <= _JOINTS_FAR else []:
            for chain in self.operation.chains:
                _, rotations, positions = chain.along(line)
                _, exact_rotations, exact_positions = chain.along(exact)
                off = np.linalg.norm(positions - exact_positions, axis=1) / allowed.position
                # |R - R'| is 2√2 sin(angle / 2).
                angle = np.linalg.norm(rotations - exact_rotations, axis=(1, 2)) / np.sqrt(2.0)
                off = np.maximum(off, angle / allowed.rotation)
                worst = np.maximum(worst, largest(off, count))
        return np.where(np.isfinite(worst), SAMPLING_FACTOR * worst, np.inf)

    @override
    def scaled_acceleration(self, t: Array, allowed: Tolerance) -> Array:
        """Return accelerations of poses and joints as shares of what is allowed, (K,) [1/s²]."""
        motion = self.operation.motion
        middle = np.clip(t, motion.t[0] + _AROUND, motion.t[-1] - _AROUND)
        q = [motion(middle + side * _AROUND) for side in (-1.0, 0.0, 1.0)]
        poses = [self.frames.tool_poses(each) for each in q]
        positions = (poses[0][0] - 2.0 * poses[1][0] + poses[2][0]) / _AROUND**2
        quaternions = [self.frames.turned(poses[k][1], poses[k + 1][1]) for k in (0, 1)]
        turned = (quaternions[1] - quaternions[0]) / _AROUND**2
        joints = self.frames.joint_rates(q[1], np.hstack([positions, turned]))
        others = ((q[0] - 2.0 * q[1] + q[2]) / _AROUND**2)[:, self.frames.external]
        shares: Array = np.linalg.norm(positions, axis=1) / allowed.position
        for rates in (
            np.linalg.norm(turned, axis=1, keepdims=True),
            np.abs(joints),
            np.abs(others),
        ):
            if rates.shape[1]:
                shares = np.maximum(shares, rates.max(axis=1) / allowed.rotation)
        # Singular configurations are found where they are; they do not decide how dense all is.
        return np.asarray(np.minimum(shares, 8.0 / _SHORTEST**2))


# Joints as far off as this, of what is allowed, leave nothing to be said of the tool.
_JOINTS_FAR = 10.0


def largest(values: Array, count: int) -> Array:
    """Return the largest of the values of each step, (count,), that at its end included."""
    steps = values[:-1].reshape(count, -1)
    maxima: Array = np.maximum(steps.max(axis=1), np.append(steps[1:, 0], values[-1]))
    return np.where(np.isnan(maxima), np.inf, maxima)


# A motion cut into segments from rest to rest, as controllers pass it.
#
# A motion is cut where the arm rests, be it for an instant: controllers stop there, and what
# happens there happens on time. Which targets there are in between says
# `selfmotion.shop.controllers.thinning`.

# Operation, joints that slide, begin and end [s] → the section of tool poses.
PosedSections = Callable[[Operation, Flags, float, float], Section]
# Speed below which the arm rests [rad/s or m/s] …
_REST = 1e-7
# … if it lasts for at least this time [s].
_WHILE = 0.02
# Speed that counts as rest at the ends of a program [rad/s or m/s] …
_SLOW = 1e-4
# … and as a share of the largest one.
_SHARE = 1e-3


def segments_of(
    operations: Sequence[Operation],
    slides: Flags,
    allowed: Tolerance,
    of_moves: Tolerance | None = None,
    progress: Progress = silent,
    posed: PosedSections | None = None,
) -> tuple[list[Segment], Deviations]:
    """Return the targets of a motion, as its file has them, and how far they are off it.

    Moves through the air may be off by `of_moves`; by default as far as they keep apart. With
    `posed` they are tool poses; those of moves that poses do not keep are joint targets.

    Raises
    ------
    NotByPosesError
        Poses do not keep a seam.
    ProblemError
        It does not begin and end at rest, or takes more targets than any controller has.
    """
    segments: list[Segment] = []
    worst = Deviations(NO_DEVIATION, NO_DEVIATION)
    for k, operation in enumerate(operations):
        progress("targets", k + 1, len(operations))
        motion = operation.motion
        for when in motion.t[[0, -1]]:
            speed = np.abs(motion(when, 1))
            if speed.max() > _SLOW:
                raise ProblemError(
                    f"'{operation.name}' has joint '{motion.joint_names[int(speed.argmax())]}' at "
                    f"{speed.max():.3g} rad/s or m/s at t = {when:.6g} s; programs of controllers "
                    f"go from rest to rest: plan it with a ramp, or rest=True"
                )
        within = _allowed(operation, allowed, of_moves)
        for first, last in _moving(motion, [motion.t[0] + at for at, _ in operation.events]):
            for segment, deviation in _thinned(operation, slides, first, last, within, posed):
                both = (
                    Deviations(NO_DEVIATION, deviation)
                    if operation.is_move
                    else Deviations(deviation, NO_DEVIATION)
                )
                worst = worst.worse(both)
                segments.append(segment)
    return segments, worst


def _thinned(
    operation: Operation,
    slides: Flags,
    first: float,
    last: float,
    within: Tolerance,
    posed: PosedSections | None,
) -> list[tuple[Segment, Deviation]]:
    if posed is not None:
        try:
            return posed(operation, slides, first, last).segments(within)
        except NotByPosesError:
            # A free move goes through singular configurations where it likes.
            if not operation.is_move:
                raise
    return Section(operation, slides, first, last).segments(within)


def _allowed(operation: Operation, allowed: Tolerance, of_moves: Tolerance | None) -> Tolerance:
    """Return how far a controller may be off an operation."""
    if not operation.is_move:
        return allowed
    limit = operation.deviation_limit
    if of_moves is not None or limit is None:
        return of_moves or allowed
    return Tolerance(max(allowed.position, limit.position), max(allowed.rotation, limit.rotation))


def _moving(motion: Trajectory, events: Sequence[float]) -> list[tuple[float, float]]:
    """Return when motions from rest to rest, and rests, begin and end, in turn [s]."""
    at_rest = np.abs(motion.qd).max(axis=1) < _REST
    at_rest[:-1] &= np.abs(np.diff(motion.q, axis=0)).max(axis=1) < 1e-9
    edges = np.flatnonzero(np.diff(np.concatenate([[False], at_rest[:-1], [False]]).astype(int)))
    marks = [float(motion.t[0])]
    for begin, end in edges.reshape(-1, 2):
        if motion.t[end] - motion.t[begin] >= _WHILE:
            marks += [float(motion.t[begin]), float(motion.t[end])]
    marks.append(float(motion.t[-1]))
    for stop in _rest_times(motion, events):
        if np.abs(stop - np.array(marks)).min() >= _WHILE and not _is_paused(stop, marks, motion):
            marks.append(stop)
    marks = sorted(set(marks))
    return list(pairwise(marks))


def _is_paused(stop: float, marks: Sequence[float], motion: Trajectory) -> bool:
    """Whether a time is in one of the rests that last."""
    first, last = max(m for m in marks if m < stop), min(m for m in marks if m > stop)
    return is_at_rest(motion, first, last)


def _rest_times(motion: Trajectory, events: Sequence[float]) -> list[float]:
    """Return when the arm rests for an instant [s]: where an event is then, at that."""
    speeds = np.abs(motion.qd).max(axis=1)
    slow = min(_SLOW, _SHARE * float(speeds.max()))
    inside = np.clip(events, motion.t[0], motion.t[-1]).tolist()
    rest_times = [time for time in inside if np.abs(motion(time, 1)).max() < slow]
    edges = np.diff(np.concatenate([[False], speeds < slow, [False]]).astype(int))
    for begin, end in np.flatnonzero(edges).reshape(-1, 2):
        rest_times.append(float(motion.t[begin + int(speeds[begin:end].argmin())]))
    return rest_times

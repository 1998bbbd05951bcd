"""As few tool poses as keep a seam at its feed: straight and circular steps as long as can be.

From each target the next is as far ahead as one step keeps near the motion, where the tool has
gone as far. Its position is within the tolerance of the settings. Free rotations and the arm's
self-motion may be off by more, within all that the certificate of the seam requires.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, Flags
from selfmotion.certificate import Tolerance
from selfmotion.model.motion import Trajectory
from selfmotion.shop.controllers.arc_length import ArcLength
from selfmotion.shop.controllers.arcs import arc_through, step_lengths
from selfmotion.shop.controllers.deviations import SAMPLING_FACTOR, Deviation
from selfmotion.shop.controllers.feed_segments import FeedSegment, nominal_target_times
from selfmotion.shop.controllers.operations import Operation
from selfmotion.shop.controllers.pose_numbers import Rounding
from selfmotion.shop.controllers.pose_segments import aligned_quaternions
from selfmotion.shop.controllers.pose_steps import (
    NoStepError,
    SampledPoses,
    Steps,
    StepSearch,
    StepTolerance,
)
from selfmotion.shop.controllers.program_texts import TIMES_HEADING
from selfmotion.shop.controllers.segments import Event, Knots, Segment, by_interpolation
from selfmotion.shop.controllers.targets import NotByPosesError, PoseSection, largest
from selfmotion.shop.controllers.thinning import is_at_rest
from selfmotion.shop.controllers.tool_frames import ToolFrames
from selfmotion.shop.controllers.work_objects import carrier_in_reference

# Tolerances of free rotation and self-motion, tried in turn [rad or m]; 0: that of the joints.
_FREE_TOLERANCES = (0.2, 0.02, 0.0)
# Shares of the position tolerance, tried in turn: blended corners reduce the feed.
_POSITION_SHARES = (1.0, 0.3)
# Smallest number of samples along a segment.
_MIN_SAMPLES = 400
# Largest number of samples along a segment.
_MAX_SAMPLES = 2000
# Length below which a segment has no feed [m].
_MIN_LENGTH = 1e-3
# Shortest step [m].
_MIN_STEP = 1e-5
# Largest number of refinements, which halve the steps that exceed their tolerance.
_MAX_REFINEMENTS = 12
# Decimals of speeds [m/s].
_SPEED_DIGITS = 8
# Duration of each ramp of a lead, which has no feed, as a share of the lead's duration.
_RAMP_SHARE = 0.25
# Largest change of the joints' deviation between samples, as a share of its tolerance.
_MAX_CHANGE = 0.1
# Change below which it is never too large, as at corners [rad or m].
_MIN_CHANGE = 3e-4
# Tolerance of the times of events [s].
_EVENT_TOLERANCE = 5e-4


@dataclass(frozen=True, eq=False)
class FeedSection(PoseSection):
    """Section of a seam at a feed between two rests, to be written as poses with speeds."""

    @override
    def segments(self, allowed: Tolerance) -> list[tuple[Segment, Deviation]]:
        """One from rest to rest of the tool, the arm's self-motion aside.

        With times where speeds do not do, and the segment says why.
        """
        if is_at_rest(self.operation.motion, self.first, self.last):
            return super().segments(allowed)
        self.check_regular(allowed)
        parts = [replace(self, first=a, last=b) for a, b in pairwise(self._rest_times)]
        travel = [part._travel for part in parts]
        why, stuck = "there is no feed where the tool hardly moves", None
        for free, share in product(_FREE_TOLERANCES, _POSITION_SHARES):
            if min(each.total for each in travel) < _MIN_LENGTH:
                break
            nearer = replace(allowed, position=share * allowed.position)
            turning = max(free, allowed.rotation)
            thinned_parts = [
                part._fewest_targets(each, nearer, turning)
                for part, each in zip(parts, travel, strict=True)
            ]
            feed_segments = [x for x in thinned_parts if isinstance(x, FeedSegment)]
            if len(feed_segments) < len(parts):
                # The time at which even the widest tolerance is exceeded.
                stuck = stuck or next(x for x in thinned_parts if not isinstance(x, FeedSegment))
                why = self._failure_text(stuck, allowed)
                continue
            why = (
                "with poses at its feed it does not keep all that it has to (limits, clearances, "
                "the feed itself): leave more room, or take a lower feed"
            )
            if not all(
                part._has_timely_events(segment)
                for part, segment in zip(parts, feed_segments, strict=True)
            ):
                why = "an event is where the tool is slower than its feed, or it is at no feed"
            elif self._is_valid(feed_segments, travel, allowed):
                pairs = zip(parts, feed_segments, strict=True)
                return [(segment, part._deviation(segment)) for part, segment in pairs]
        ((timed, deviation),) = super().segments(allowed)
        return [(replace(timed, remark=f"{TIMES_HEADING}{why}"), deviation)]

    def _failure_text(self, time: float, allowed: Tolerance) -> str:
        """Return a message: where poses at a feed exceed the tolerance, and a remedy."""
        motion = self.operation.motion
        tool = self.operation.chains[0].place(motion(time)).translation
        position = ", ".join(f"{value:.3f}" for value in tool)
        return (
            f"near t = {time - motion.t[0]:.4g} s, at ({position}) m, no poses at its feed keep it "
            f"within {1e3 * allowed.position:.3g} mm and {np.degrees(allowed.rotation):.3g}°: in "
            f"corners round them more (tolerance = 0.002), or stop there (corners = 'stop'); else "
            f"allow more (deviation), or keep away from singular poses"
        )

    @property
    def _rest_times(self) -> list[float]:
        """Times at which the tool rests, from first to last [s]."""
        rests = self.operation.motion.t[0] + np.array(self.operation.tool_rests)
        is_inside = (rests > self.first + _EVENT_TOLERANCE) & (rests < self.last - _EVENT_TOLERANCE)
        inside = rests[is_inside]
        return [self.first, *inside.tolist(), self.last]

    @property
    def _travel(self) -> ArcLength:
        return ArcLength.of_motion(self.frames, self.operation.motion, self.first, self.last)

    def _is_valid(
        self, segments: Sequence[FeedSegment], travel: Sequence[ArcLength], allowed: Tolerance
    ) -> bool:
        """Whether the seam satisfies its constraints with segments instead of its motion.

        By each interpolation of the controller.
        """
        motions = (segment.at_pace(each) for segment, each in zip(segments, travel, strict=True))
        return all(self._is_valid_by(parts, allowed) for parts in by_interpolation(motions))

    def _is_valid_by(self, parts: Sequence[Knots], allowed: Tolerance) -> bool:
        """Whether the seam satisfies its constraints with the motions of one interpolation."""
        motion, begin = self.operation.motion, self.first
        rows: list[tuple[Array, Array, Array]] = []
        for t, q, qd in parts:
            if not np.isfinite(q).all():
                return False
            after_first = slice(1 if rows else 0, None)
            rows.append((begin + t[after_first], q[after_first], qd[after_first]))
            begin += float(t[-1])
        before, after = (
            motion.t < self.first - _EVENT_TOLERANCE,
            motion.t > self.last + _EVENT_TOLERANCE,
        )
        planned = motion.t, motion.q, motion.qd
        t, q, qd = (
            np.concatenate([samples[before], *driven, samples[after]])
            for samples, driven in zip(planned, zip(*rows, strict=True), strict=True)
        )
        driven_seam = Trajectory(t, q, qd, motion.joint_names)
        return self.operation.is_valid is not None and self.operation.is_valid(driven_seam, allowed)

    def _has_timely_events(self, segment: FeedSegment) -> bool:
        """Whether there is time for the ramps, and events are on time with even ramps."""
        if not segment.ramps.each > 0.0:
            return False
        target_times = segment.ramps.times(segment.t)
        return all(
            abs(target_times[event.target] - (at - self.first)) < _EVENT_TOLERANCE
            for event, (at, _) in zip(segment.events, self.events, strict=True)
        )

    def _fewest_targets(
        self, travel: ArcLength, allowed: Tolerance, free: float
    ) -> FeedSegment | float:
        """Return the segment with the fewest targets; a time near the failure [s] if none."""
        fixed = self._fixed_lengths(travel)
        along = self._sampled(travel, fixed)
        marks = [int(np.abs(along.travel - each).argmin()) for each in fixed]
        limits = StepTolerance(allowed.position, allowed.rotation, free)
        search = StepSearch(self.frames, self.operation.rotation_task, along, limits)
        try:
            steps = search.through(marks)
        except NoStepError as error:
            return self._time_at(travel, along.travel[error.index])
        for _ in range(_MAX_REFINEMENTS):
            segment = self._segment(travel, along, steps)
            shares = self._deviation_shares(segment, limits)
            if not isinstance(shares, np.ndarray):
                return shares
            far = shares > 1.0
            if not far.any():
                return segment
            worst = steps.ends[int(shares.argmax())]
            finer = steps.halved(far)
            if len(finer.ends) == len(steps.ends):
                break
            steps = finer
        return self._time_at(travel, along.travel[worst])

    def _time_at(self, travel: ArcLength, far: float) -> float:
        """Return the time at which the tool has travelled an arc length [s]."""
        return float(np.clip(travel.times_at(np.array([far]))[0], self.first, self.last))

    def _fixed_lengths(self, travel: ArcLength) -> Array:
        """Return the arc lengths of ends, events and changes of the feed [m]."""
        start = float(self.operation.motion.t[0])
        changes = [start + item.during.ravel() for item in self.operation.feeds[0]]
        times = np.concatenate([[at for at, _ in self.events], *changes])
        inside = np.unique(travel.lengths_at(times[(times > self.first) & (times < self.last)]))
        inside = inside[(inside > _MIN_STEP) & (inside < travel.total - _MIN_STEP)]
        inside = inside[np.append(True, np.diff(inside) > _MIN_STEP)[: len(inside)]]
        return np.concatenate([[0.0], inside, [travel.total]])

    def _sampled(self, travel: ArcLength, fixed: Array) -> SampledPoses:
        motion = self.operation.motion
        inside = motion.t[(motion.t > self.first) & (motion.t < self.last)]
        inside = inside[:: max(1, len(inside) // (_MAX_SAMPLES - _MIN_SAMPLES))]
        even = np.linspace(0.0, travel.total, _MIN_SAMPLES + 1)
        others = np.unique(np.concatenate([even, travel.lengths_at(inside)]))
        others = others[np.append(True, np.diff(others) > _MIN_STEP)]
        apart = np.abs(others[:, None] - fixed).min(axis=1) > _MIN_STEP
        far = np.sort(np.concatenate([fixed, others[apart]]))
        q = self._configurations_at(travel, far)
        positions, quaternions = self.frames.tool_poses(q)
        rows = np.hstack([positions, aligned_quaternions(quaternions), q[:, self.frames.external]])
        return SampledPoses(
            far,
            q,
            rows,
            lambda lengths: self.frames.tool_poses(self._configurations_at(travel, lengths))[0],
        )

    def _configurations_at(self, travel: ArcLength, far: Array) -> Array:
        """Return the configurations at arc lengths, (K, n)."""
        return self.operation.motion(np.minimum(travel.times_at(far), self.last))

    def _segment(self, travel: ArcLength, along: SampledPoses, steps: Steps) -> FeedSegment:
        """Return the segment of targets, rounded to the digits of the file."""
        motion, ends = self.operation.motion, steps.ends
        q = self._rounded(along.q[ends])
        positions, quaternions = self.rounding(along.rows[ends, :3], along.rows[ends, 3:7])
        vias = np.full((len(ends) - 1, 3), np.nan)
        for k in np.flatnonzero(steps.is_circular):
            via = along.middle(ends[k], ends[k + 1])
            via = self.rounding(via[None], quaternions[[k]])[0][0]
            arc = arc_through(positions[k], via, positions[k + 1])
            # A halved step may be too short for an arc: it is linear then.
            if arc is not None and arc.is_programmable:
                vias[k] = via
        joints, arrived = self.frames.inverse_kinematics(
            positions, quaternions, self._mixed(along.q[ends], q)
        )
        if not arrived.all():
            at = travel.times_at(along.travel[[ends[int(np.argmin(arrived))]]])[0] - motion.t[0]
            raise NotByPosesError(f"'{self.operation.name}': the arm is singular at t = {at:.4g} s")
        speeds = self._speeds(travel, along.travel[ends])
        times = nominal_target_times(positions, vias, speeds)
        far = np.append(0.0, np.cumsum(step_lengths(positions, vias)))

        def near(step_times: Array) -> Array:
            share = np.interp(step_times, times, far) / far[-1]
            return self._configurations_at(travel, share * travel.total)

        events = [
            Event(
                int(np.abs(along.travel[ends] - travel.lengths_at(np.array([at]))).argmin()), name
            )
            for at, name in self.events
        ]
        return FeedSegment(
            self.operation.name,
            times,
            joints,
            tuple(events),
            positions=positions,
            quaternions=aligned_quaternions(quaternions),
            frames=self.frames,
            near=near,
            order=np.arange(q.shape[1]),
            speeds=speeds,
            vias=vias,
            seconds=round(self.last - self.first, 5),
        )

    def _speeds(self, travel: ArcLength, ends: Array) -> Array:
        """Return the feed of each step; for leads the speed that takes their duration [m/s]."""
        middles = travel.times_at(0.5 * (ends[1:] + ends[:-1])) - self.operation.motion.t[0]
        speeds = np.full(
            len(middles), travel.total / ((1.0 - _RAMP_SHARE) * (self.last - self.first))
        )
        for item in self.operation.feeds[0]:
            for begin, end in item.during:
                speeds[(middles >= begin) & (middles <= end)] = item.asked
        return np.round(speeds, _SPEED_DIGITS)

    def _deviation_shares(self, segment: FeedSegment, allowed: StepTolerance) -> Array | float:
        """Return the deviation of each step as a share of its tolerance, (K,).

        Where the joints' deviation jumps between samples, as near a singular pose, that time [s].
        """
        times, count = segment.evaluation_times(), len(segment.t) - 1
        exact = segment.reference(self.operation.motion, self.first)
        at, facing = self.frames.tool_poses(exact)
        worst = np.zeros(count)
        for line in segment.interpolated(times):
            off = line - exact
            change = np.abs(np.diff(off, axis=0)).max(axis=1)
            # Written so that NaN counts as a jump.
            changes = ~(change <= max(_MAX_CHANGE * allowed.free, _MIN_CHANGE))
            if changes.any():
                return float(min(self.first + times[int(changes.argmax())], self.last))
            positions, quaternions = self.frames.tool_poses(line)
            shares = np.linalg.norm(positions - at, axis=1) / allowed.position
            shares = np.maximum(shares, np.abs(off).max(axis=1) / allowed.free)
            task = self.operation.rotation_task
            rotation = allowed.rotation_shares(self.frames, task, quaternions, facing)
            worst = np.maximum(worst, largest(np.maximum(shares, rotation), count))
        return SAMPLING_FACTOR * worst


def paced_section(
    operation: Operation,
    slides: Flags,
    first: float,
    last: float,
    frames: ToolFrames,
    rounding: Rounding,
) -> PoseSection:
    """Return the section of a seam at a feed; of other parts of a motion, one with times."""
    has_feed = len(operation.feeds) == 1 and bool(operation.feeds[0])
    is_paced = has_feed and operation.is_valid is not None and _rides_along(frames)
    kind = FeedSection if is_paced else PoseSection
    return kind(operation, slides, first, last, frames, rounding)


def _rides_along(frames: ToolFrames) -> bool:
    """Whether the path is given in a frame in which the work object is at rest."""
    return carrier_in_reference(frames.robot, frames.carrier) is not None

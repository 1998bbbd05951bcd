"""Longest linear and circular steps between tool poses that keep within a tolerance of a motion."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.model.task import Task
from selfmotion.shop.controllers.arcs import MIN_LENGTH, arc_through, put_on_arcs
from selfmotion.shop.controllers.pose_segments import linear_poses
from selfmotion.shop.controllers.tool_frames import ToolFrames

# Share of the tolerance that steps use; the rest is for blended corners and rounding.
_TOLERANCE_SHARE = 0.9
# Doublings of the length of the first arc until one is within tolerance.
_MAX_DOUBLINGS = 12
# Largest rotation of a step [rad]: at π its axis is ambiguous.
_MAX_ROTATION = 3.0


class NoStepError(Exception):
    """No step from a sample is within tolerance.

    Attributes
    ----------
    index : int
        Of the sample.
    """

    def __init__(self, index: int) -> None:
        super().__init__(f"no step from sample {index} is within tolerance")
        self.index = index


class Steps(NamedTuple):
    """Steps between samples of a motion.

    Attributes
    ----------
    ends : list of int
        Sample indices of the targets, one more than there are steps.
    is_circular : list of bool
        Whether each step is an arc.
    """

    ends: list[int]
    is_circular: list[bool]

    def halved(self, exceeds: Flags) -> "Steps":
        """Return them with those halved that exceed their tolerance, and their neighbours."""
        affected = np.convolve(exceeds, np.ones(3), mode="same") > 0.0
        steps = Steps(self.ends[:1], [])
        for k, is_circular in enumerate(self.is_circular):
            first, last = self.ends[k], self.ends[k + 1]
            if affected[k] and last - first >= 2:
                steps.ends.append((first + last) // 2)
                steps.is_circular.append(is_circular)
            steps.ends.append(last)
            steps.is_circular.append(is_circular)
        return steps


class SampledPoses(NamedTuple):
    """Samples of a motion at arc lengths of its tool.

    Attributes
    ----------
    travel : (N,)
        Arc length of the tool [m].
    q : (N, n)
    rows : (N, 7 + m)
        Position, quaternion x, y, z, w and external axes.
    position_at : callable
        Arc lengths (K,) → positions (K, 3) in the work object.
    """

    travel: Array
    q: Array
    rows: Array
    position_at: Callable[[Array], Array]

    def middle(self, first: int, last: int) -> Array:
        """Return the position of the tool at the mean arc length of two samples, (3,)."""
        mean = 0.5 * (self.travel[[first]] + self.travel[[last]])
        position: Array = self.position_at(mean)[0]
        return position


class StepTolerance(NamedTuple):
    """Tolerances of steps.

    Attributes
    ----------
    position : float
        [m].
    rotation : float
        Of prescribed rotations [rad].
    free : float
        Of rotations that are not prescribed, and of joints [rad or m].
    """

    position: float
    rotation: float
    free: float

    def rotation_shares(
        self, frames: ToolFrames, task: Task, quaternions: Array, reference: Array
    ) -> Array:
        """Return rotations (K, 4) from reference ones as shares of the tolerance, (K,)."""
        angle = np.linalg.norm(frames.turned(quaternions, reference), axis=1)
        if task.tool_axes:
            deviation = np.cross(_axes(quaternions), _axes(reference))
            axis_share = np.linalg.norm(deviation, axis=1) / self.rotation
            return np.asarray(np.maximum(axis_share, angle / self.free))
        return np.asarray(angle / (self.rotation if task.angular else self.free))


@dataclass(frozen=True, eq=False)
class StepSearch:
    """Greedy search for the longest steps.

    Parameters
    ----------
    frames : ToolFrames
    task : Task
        Its rows prescribe rotation.
    samples : SampledPoses
    tolerance : StepTolerance
    """

    frames: ToolFrames
    task: Task
    samples: SampledPoses
    tolerance: StepTolerance

    def through(self, marks: list[int]) -> Steps:
        """Return steps that end at the marks and between them.

        Raises
        ------
        NoStepError
            At a sample from which no step is within tolerance.
        """
        steps = Steps(marks[:1], [])
        for first, last in pairwise(marks):
            section = self._equalised(self._longest_steps(first, last))
            steps = Steps(steps.ends + section.ends[1:], steps.is_circular + section.is_circular)
        return steps

    def _longest_steps(self, first: int, last: int) -> Steps:
        """Return steps from a sample to another, each as long as it can be; see `through`."""
        steps, start = Steps([first], []), first
        travel = self.samples.travel
        while start < last:
            line_end = self._farthest_end(start, last, is_circular=False, least=start + 1)
            arc_end = start
            if line_end < last:
                # An arc needs a sample inside, and the length that controllers accept.
                long_enough = int(np.searchsorted(travel, travel[start] + MIN_LENGTH))
                least = min(max(line_end + 1, start + 2, long_enough), last)
                arc_end = self._farthest_end(start, last, is_circular=True, least=least)
            end = max(line_end, arc_end)
            if end <= start:
                raise NoStepError(start)
            # An arc has to gain more than one sample over a line.
            steps.is_circular.append(arc_end > line_end + 1)
            steps.ends.append(end)
            start = end
        return steps

    def _farthest_end(self, start: int, last: int, *, is_circular: bool, least: int) -> int:
        """Return the farthest sample that one step can end at, from `least` on; else `start`."""
        inside = self._first_end(start, last, is_circular=is_circular, least=least)
        if inside is None:
            return start
        outside, length = last + 1, 2 * (inside - start)
        # The length doubles until a step fails; that bracket is bisected.
        while inside < last and outside - inside > 1:
            is_doubled = outside > last
            end = min(start + length, last) if is_doubled else (inside + outside) // 2
            if self._is_within_tolerance(start, end, is_circular=is_circular):
                inside, length = end, 2 * length
            else:
                outside = end
        return inside

    def _first_end(self, start: int, last: int, *, is_circular: bool, least: int) -> int | None:
        """Return the end of a first step within tolerance, of `least` or doubled lengths."""
        length = least - start
        for _ in range(_MAX_DOUBLINGS if is_circular else 1):
            end = min(start + length, last)
            if end > start and self._is_within_tolerance(start, end, is_circular=is_circular):
                return end
            if end == last:
                break
            length *= 2
        return None

    def _equalised(self, steps: Steps) -> Steps:
        """Return steps of equal length, if all are of one kind and equal ones are in tolerance."""
        count = len(steps.is_circular)
        if count < 2 or len(set(steps.is_circular)) > 1:
            return steps
        travel, is_circular = self.samples.travel, steps.is_circular[0]
        lengths = np.linspace(travel[steps.ends[0]], travel[steps.ends[-1]], count + 1)
        ends = [int(np.abs(travel - length).argmin()) for length in lengths]
        equal = all(
            self._is_within_tolerance(*pair, is_circular=is_circular) for pair in pairwise(ends)
        )
        return Steps(ends, steps.is_circular) if equal else steps

    def _is_within_tolerance(self, first: int, last: int, *, is_circular: bool) -> bool:
        """Whether one step between two samples keeps within tolerance of the motion."""
        section = slice(first, last + 1)
        exact = self.samples.rows[section]
        if 2.0 * np.arccos(min(1.0, abs(float(exact[0, 3:7] @ exact[-1, 3:7])))) > _MAX_ROTATION:
            return False
        rows = self._interpolated(first, last, is_circular=is_circular)
        if rows is None or not self._poses_within(rows, exact):
            return False
        q = self.samples.q[section]
        seeds = np.array(q)
        seeds[:, self.frames.external] = rows[:, 7:]
        solutions, converged = self.frames.inverse_kinematics(rows[:, :3], rows[:, 3:7], seeds)
        largest = np.abs(solutions - q).max()
        return bool(converged.all() and largest <= _TOLERANCE_SHARE * self.tolerance.free)

    def _interpolated(self, first: int, last: int, *, is_circular: bool) -> Array | None:
        """Return the rows of one step at the samples between; None for what is no arc."""
        section, ends = slice(first, last + 1), [first, last]
        travel, rows = self.samples.travel, self.samples.rows
        step_rows = linear_poses(travel[section], travel[ends], rows[ends])
        if is_circular:
            via = self.samples.middle(first, last)
            arc = arc_through(rows[first, :3], via, rows[last, :3])
            if arc is None or not arc.is_programmable:
                return None
            put_on_arcs(step_rows, travel[section], travel[ends], rows[ends, :3], via[None])
        return step_rows

    def _poses_within(self, rows: Array, exact: Array) -> bool:
        """Whether positions, external axes and orientations are within tolerance of exact ones."""
        tolerance = self.tolerance
        distance = np.linalg.norm(rows[:, :3] - exact[:, :3], axis=1).max()
        external = np.abs(rows[:, 7:] - exact[:, 7:]).max(initial=0.0)
        if distance > _TOLERANCE_SHARE * tolerance.position:
            return False
        if external > _TOLERANCE_SHARE * tolerance.free:
            return False
        shares = tolerance.rotation_shares(self.frames, self.task, rows[:, 3:7], exact[:, 3:7])
        return bool(shares.max() <= _TOLERANCE_SHARE)


def _axes(quaternions: Array) -> Array:
    """Return the z axes of orientations (K, 4), (K, 3)."""
    x, y, z, w = quaternions.T
    return np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1)

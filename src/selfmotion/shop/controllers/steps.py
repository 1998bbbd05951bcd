"""Straight and circular steps between tool poses, as long as a motion allows."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.model.task import Task
from selfmotion.shop.controllers.arcs import LEAST_LENGTH, arc_through, put_on_arcs
from selfmotion.shop.controllers.segments import straight
from selfmotion.shop.controllers.tool_frames import ToolFrames

# Of what is allowed, steps take this much before corners and digits.
_OF_ALLOWED = 0.9
# Largest number of doublings of the first arc that is tried, until it is one.
_DOUBLED = 12
# Half-turns have two axes [rad].
_NEARLY_HALF = 3.0


class Steps(NamedTuple):
    """Targets by their places among those that are looked at, and which steps go round."""

    ends: list[int]
    round: list[bool]

    def halved(self, far: Flags) -> "Steps":
        """Return them with those halved that are too far off, and their neighbours."""
        near = np.convolve(far, np.ones(3), mode="same") > 0.0
        found = Steps(self.ends[:1], [])
        for k, is_round in enumerate(self.round):
            first, last = self.ends[k], self.ends[k + 1]
            if near[k] and last - first >= 2:
                found.ends.append((first + last) // 2)
                found.round.append(is_round)
            found.ends.append(last)
            found.round.append(is_round)
        return found


class SampledPoses(NamedTuple):
    """A motion sampled along a segment.

    Attributes
    ----------
    travel : (N,)
        Arc length of the tool [m].
    q : (N, n)
    rows : (N, 7 + m)
        Poses and external axes.
    at : callable
        Arc lengths (K,) → positions (K, 3) in the work object.
    """

    travel: Array
    q: Array
    rows: Array
    at: Callable[[Array], Array]

    def middle(self, first: int, last: int) -> Array:
        """Return the position of the tool halfway between two places, (3,)."""
        found: Array = self.at(0.5 * (self.travel[[first]] + self.travel[[last]]))[0]
        return found


class Allowed(NamedTuple):
    """Tolerances of steps: positions [m], prescribed turning, and all else [rad or m].

    Attributes
    ----------
    position, rotation, free : float
    """

    position: float
    rotation: float
    free: float

    def turned(self, frames: ToolFrames, task: Task, quaternions: Array, facing: Array) -> Array:
        """Return how much orientations (K, 4) take of what they may be off others, (K,)."""
        whole = np.linalg.norm(frames.turned(quaternions, facing), axis=1)
        if task.tool_axes:
            leaned = np.linalg.norm(np.cross(_axes(quaternions), _axes(facing)), axis=1)
            return np.asarray(np.maximum(leaned / self.rotation, whole / self.free))
        return np.asarray(whole / (self.rotation if task.angular else self.free))


@dataclass(frozen=True, eq=False)
class StepSearch:
    """Looks for the longest steps along a motion.

    Parameters
    ----------
    frames : ToolFrames
    task : Task
        By whose rows the tool turns as it has to.
    along : SampledPoses
    allowed : Allowed
    """

    frames: ToolFrames
    task: Task
    along: SampledPoses
    allowed: Allowed

    def between(self, marks: list[int]) -> Steps | int:
        """Return steps that end at marks and in between; where none is near enough, that place."""
        found = Steps(marks[:1], [])
        for first, last in pairwise(marks):
            part = self._joined(first, last)
            if not isinstance(part, Steps):
                return part
            part = self._even(part)
            found = Steps(found.ends + part.ends[1:], found.round + part.round)
        return found

    def _joined(self, first: int, last: int) -> Steps | int:
        """Return steps as long as they can be, one after the other; see `between`."""
        steps, at = Steps([first], []), first
        while at < last:
            line = self._farthest(at, last, is_round=False, least=at + 1)
            arc = at
            if line < last:
                # The shortest arc has a place in between, and is one that controllers make.
                long = self.along.travel[at] + LEAST_LENGTH
                least = max(line + 1, at + 2, int(np.searchsorted(self.along.travel, long)))
                arc = self._farthest(at, last, is_round=True, least=min(least, last))
            if max(line, arc) <= at:
                return at
            steps.round.append(arc > line + 1)
            at = max(line, arc)
            steps.ends.append(at)
        return steps

    def _farthest(self, at: int, last: int, *, is_round: bool, least: int) -> int:
        """Return how far ahead one step may go, from `least` on; where it begins for nowhere."""
        tried = [min(at + (least - at) * 2**k, last) for k in range(_DOUBLED if is_round else 1)]
        fits = (there for there in dict.fromkeys(tried) if there > at)
        near = next((there for there in fits if self._is_near(at, there, is_round=is_round)), at)
        ahead, beyond = 2 * (near - at), last + 1
        while at < near < last and beyond - near > 1:
            there = min(at + ahead, last) if beyond > last else (near + beyond) // 2
            if self._is_near(at, there, is_round=is_round):
                near, ahead = there, 2 * ahead
            else:
                beyond = there
        return near

    def _even(self, steps: Steps) -> Steps:
        """Return as many steps of one kind as long as each other, where these do as well."""
        count = len(steps.round)
        if count < 2 or len(set(steps.round)) > 1:
            return steps
        wanted = np.linspace(
            self.along.travel[steps.ends[0]], self.along.travel[steps.ends[-1]], count + 1
        )
        ends = [int(np.abs(self.along.travel - each).argmin()) for each in wanted]
        even = all(self._is_near(*pair, is_round=steps.round[0]) for pair in pairwise(ends))
        return Steps(ends, steps.round) if even else steps

    def _is_near(
        self,
        first: int,
        last: int,
        *,
        is_round: bool,
    ) -> bool:
        """Whether one step from a place to another keeps near the motion."""
        part = slice(first, last + 1)
        travel, exact = self.along.travel[part], self.along.rows[part]
        position, _, free = (_OF_ALLOWED * each for each in self.allowed)
        if 2.0 * np.arccos(min(1.0, abs(float(exact[0, 3:7] @ exact[-1, 3:7])))) > _NEARLY_HALF:
            return False
        rows = straight(travel, travel[[0, -1]], exact[[0, -1]])
        if is_round:
            via = self.along.middle(first, last)
            arc = arc_through(exact[0, :3], via, exact[-1, :3])
            if arc is None or not arc.is_meant:
                return False
            put_on_arcs(rows, travel, travel[[0, -1]], exact[[0, -1], :3], via[None])
        if np.linalg.norm(rows[:, :3] - exact[:, :3], axis=1).max() > position:
            return False
        if rows.shape[1] > 7 and np.abs(rows[:, 7:] - exact[:, 7:]).max() > free:
            return False
        turned = self.allowed.turned(self.frames, self.task, rows[:, 3:7], exact[:, 3:7])
        if turned.max() > _OF_ALLOWED:
            return False
        near = np.array(self.along.q[part])
        near[:, self.frames.external] = rows[:, 7:]
        q, arrived = self.frames.inverse_kinematics(rows[:, :3], rows[:, 3:7], near)
        return bool(arrived.all() and np.abs(q - self.along.q[part]).max() <= free)


def _axes(quaternions: Array) -> Array:
    """Return the z axes of orientations (K, 4), (K, 3)."""
    x, y, z, w = quaternions.T
    return np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1)

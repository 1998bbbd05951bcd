"""Tool poses with the speed between them, and how far along its path a tool is."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import ceil
from typing import Any, NamedTuple

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, FileFormatError
from selfmotion.model.motion import Trajectory
from selfmotion.model.path import Path, times_when
from selfmotion.shop.controllers.arcs import put_on_arcs, step_lengths
from selfmotion.shop.controllers.pose_segments import PoseSegment, linear_poses
from selfmotion.shop.controllers.segments import Curve, Knots, subdivided
from selfmotion.shop.controllers.tool_frames import ToolFrames

# Times at which speeds are evaluated, per interval between two samples.
_BETWEEN = 4
# Smallest number of such times in all.
_MIN_TIMES = 1600


@dataclass(frozen=True, eq=False)
class ArcLength:
    """The length that a tool has passed, at times.

    Attributes
    ----------
    t : (K,)
        Times [s].
    length : (K,)
        How far it has gone since the first [m].
    speed : (K,)
        How fast it is [m/s].
    """

    t: Array
    length: Array
    speed: Array

    @classmethod
    def of_motion(
        cls, frames: ToolFrames, motion: Trajectory, first: float, last: float
    ) -> "ArcLength":
        """Return that of a joint motion, in the work object, from one time to another [s]."""

        def speeds(times: Array) -> Array:
            at = np.clip(times, motion.t[0], motion.t[-1])
            return frames.speeds(motion(at), motion(at, 1))

        return cls._integrated(speeds, motion.t, first, last)

    @classmethod
    def of_path(cls, path: Path, first: float, last: float) -> "ArcLength":
        """Return that of a path, in its own frame."""

        def speeds(times: Array) -> Array:
            twist = path.samples(np.clip(times, 0.0, path.duration)).twist
            return np.asarray(np.linalg.norm(twist[:, :3], axis=1))

        return cls._integrated(speeds, path.marks, first, last)

    @classmethod
    def _integrated(
        cls, speeds: Callable[[Array], Array], marks: Array, first: float, last: float
    ) -> "ArcLength":
        """Return the integral of a speed by Simpson's rule."""
        inside = marks[(marks > first) & (marks < last)]
        marks = np.concatenate([[first], inside, [last]])
        count = _BETWEEN * (len(marks) - 1) + 1
        t = np.interp(np.linspace(0, len(marks) - 1, count), np.arange(len(marks)), marks)
        t = np.union1d(t, np.linspace(first, last, _MIN_TIMES))
        # Two that rounding puts beside each other are one.
        t = t[np.append(np.diff(t) > 1e-9 * (last - first), True)]
        here, middle = speeds(t), speeds(0.5 * (t[1:] + t[:-1]))
        steps = np.diff(t) * (here[:-1] + 4.0 * middle + here[1:]) / 6.0
        return cls(t, np.append(0.0, np.cumsum(steps)), here)

    @property
    def whole(self) -> float:
        """Total arc length [m]."""
        return float(self.length[-1])

    def at(self, times: Array) -> Array:
        """Return how far it has gone at times (K,) [m]."""
        lengths: Array = self._spline(np.clip(times, self.t[0], self.t[-1]))
        return np.clip(lengths, 0.0, self.whole)

    def when(self, lengths: Array) -> Array:
        """Return when it has gone as far as lengths (K,) [s]; at both ends the first and last."""
        k = np.clip(np.searchsorted(self.length, lengths) - 1, 0, len(self.t) - 2)
        when = times_when(self._spline, lengths, self.t[k], self.t[k + 1])
        when = np.where(lengths <= 0.0, self.t[0], when)
        return np.asarray(np.where(lengths >= self.whole, self.t[-1], when))

    @cached_property
    def _spline(self) -> Any:
        from scipy.interpolate import CubicHermiteSpline

        return CubicHermiteSpline(self.t, self.length, self.speed)


# Tool poses with the speed between them in place of times: what a shop touches up.
#
# A controller goes along each straight or circular step at its speed, rounds corners within its
# zone, and runs up and down by its own acceleration. So a segment is compared with a motion where
# the tool has gone as far, not at equal times. Where times are needed, ramps that are even and as
# long as the planned time leaves stand for those of the controller.

# Corners are rounded within this of a target at most [m]: ABB's z0, and as much in the others.
ZONE = 3e-4
# Times at which each ramp is evaluated.
_OF_RAMP = 24
# Smallest number of times at which a whole segment is evaluated.
_LOOKS = 3200
# Smallest number of times at which a step between two targets is evaluated.
_OF_STEP = 16
# Length of path below which the tool rests [m].
_MIN_LENGTH = 1e-6
# Relative difference of speeds that counts as rounding of digits.
_SAME = 1e-4


class Ramps(NamedTuple):
    """An even run-up and an even run-down: a law of time that stands for the controller's.

    Attributes
    ----------
    whole : float
        How long it takes without them [s].
    seconds : float
        How long with them [s].
    """

    whole: float
    seconds: float

    @property
    def each(self) -> float:
        """Duration of each ramp [s]."""
        return min(self.seconds - self.whole, 0.5 * self.seconds)

    def passed(self, times: Array) -> Array:
        """Return which times without ramps are reached at times (K,) with ramps [s]."""
        ramp, top = self.each, self.whole / (self.seconds - self.each)
        begin, end = np.clip(times, 0.0, ramp), np.clip(self.seconds - times, 0.0, ramp)
        passed = top * (times - 0.5 * ramp)
        passed = np.where(times < ramp, 0.5 * top * begin**2 / ramp, passed)
        last = self.whole - 0.5 * top * end**2 / ramp
        return np.asarray(np.where(times > self.seconds - ramp, last, passed))

    def times(self, passed: Array) -> Array:
        """Return when times without ramps (K,) are reached with ramps [s]."""
        ramp, top = self.each, self.whole / (self.seconds - self.each)
        sides = passed, self.whole - passed
        up, down = (np.sqrt(2.0 * ramp * np.maximum(x, 0.0) / top) for x in sides)
        times = np.where(up < ramp, up, passed / top + 0.5 * ramp)
        return np.asarray(np.where(down < ramp, self.seconds - down, times))


@dataclass(frozen=True, eq=False, kw_only=True)
class FeedSegment(PoseSegment):
    """A motion from rest to rest by tool poses and speeds.

    `t` is when targets would be reached without ramps.

    Attributes
    ----------
    speeds : (K,)
        Of each step [m/s].
    vias : (K, 3)
        Through where a circular step goes [m]; no numbers where it is straight.
    seconds : float
        How long it was planned to take [s].
    is_spline : bool
        Whether a program says that it goes smoothly through its targets, not straight between them.
    """

    speeds: Array
    vias: Array
    seconds: float
    is_spline: bool = False

    @property
    @override
    def duration(self) -> float:
        return self.seconds

    @property
    def ramps(self) -> Ramps:
        """Ramps of the segment at its planned duration."""
        return Ramps(float(self.t[-1]), self.seconds)

    @cached_property
    def middles(self) -> PoseSegment:
        """The middles of its steps as targets: via poses of those that go round, (K,)."""
        t = 0.5 * (self.t[1:] + self.t[:-1])
        rows = self._stepped(t)
        q = self.joints(rows, t)
        positions = np.where(np.isfinite(self.vias), self.vias, rows[:, :3])
        return PoseSegment(
            self.name,
            t,
            q,
            positions=positions,
            quaternions=rows[:, 3:7],
            frames=self.frames,
            near=self.near,
            order=self.order,
        )

    def goes_round(self, target: int) -> bool:
        """Whether the step to a target, from 1 on, goes round."""
        return bool(np.isfinite(self.vias[target - 1, 0]))

    @cached_property
    def lengths(self) -> Array:
        """Arc length at each target, (K + 1,) [m]."""
        return np.append(0.0, np.cumsum(step_lengths(self.positions, self.vias)))

    @override
    def evaluation_times(self) -> Array:
        # Steps may be as long as the segment.
        count = max(_OF_STEP, ceil(_LOOKS / (len(self.t) - 1)))
        return subdivided(self.t, np.linspace(0.0, 1.0, count, endpoint=False))

    @property
    @override
    def curves(self) -> list[Curve]:
        """Its steps, with corners rounded in their zones, a smooth curve.

        The one that the program states is the first.
        """
        curves: list[Curve] = [self._stepped]
        if len(self.t) > 2:
            curves.append(self._rounded)
            if not np.isfinite(self.vias).any():
                curves.append(self.spline)
        return curves[::-1] if self.is_spline else curves

    @override
    def motions(self) -> Iterator[Knots]:
        """With its ramps."""
        times = self.ramps.times(self.evaluation_times())
        ends = np.linspace(0.0, self.ramps.each, _OF_RAMP)
        times = np.unique(np.concatenate([times, ends, self.seconds - ends]))
        times = times[np.append(np.diff(times) > 1e-9, True)]
        times[-1] = self.seconds
        return self._driven(times, self.ramps.passed(times))

    @override
    def reference(self, motion: Trajectory, first: float) -> Array:
        """Where the tool has gone as far."""
        travel = ArcLength.of_motion(self.frames, motion, first, first + self.seconds)
        shares = self._travel(self.evaluation_times()) / self.lengths[-1]
        return motion(np.clip(travel.when(shares * travel.whole), motion.t[0], motion.t[-1]))

    def at_pace(self, travel: ArcLength) -> Iterator[Knots]:
        """Return the motions of `motions`, at the pace at which something else has gone as far."""
        feed_times = np.interp(
            travel.at(travel.t) * (self.lengths[-1] / travel.whole),
            self.lengths,
            self.t,
        )
        return self._driven(travel.t - travel.t[0], feed_times)

    def along(self, path: Path, first: float) -> Iterator[Knots]:
        """Return the motions of `motions`, at the pace of a path that it begins at `first` [s].

        Raises
        ------
        FileFormatError
            A speed is not that of the path.
        """
        travel = ArcLength.of_path(path, first, first + self.seconds)
        if travel.whole < _MIN_LENGTH:
            raise FileFormatError(
                f"'{self.name}' moves where the path rests: the program is of another one"
            )
        ends = travel.when(self.lengths * (travel.whole / self.lengths[-1]))
        for k, (begin, end) in enumerate(pairwise(ends.tolist())):
            self._check_speed(path, travel, float(self.speeds[k]), (begin, end))
        return self.at_pace(travel)

    def _check_speed(
        self, path: Path, travel: ArcLength, speed: float, during: tuple[float, float]
    ) -> None:
        """Refuse a speed that is faster than all of the path, or none of the feeds it asks for."""
        here = (travel.t >= during[0]) & (travel.t <= during[1])
        fastest, slowest = float(travel.speed[here].max(initial=0.0)), 0.0
        at = 0.5 * sum(during)
        # Where less of a step than this is at another feed, its zone is.
        least = min(ZONE, 0.4 * float(np.ptp(travel.at(np.array(during)))))
        feeds = [
            (feed, *np.clip(window, *during))
            for feed in path.feeds
            for window in feed.during
            if np.ptp(travel.at(np.clip(window, *during))) > least
        ]
        for feed, first, last in feeds:
            fastest, slowest = feed.asked, (1.0 - feed.within) * feed.asked
            if not slowest <= speed <= (1.0 + _SAME) * fastest:
                at = 0.5 * (first + last)
                break
        if not slowest <= speed <= (1.0 + _SAME) * fastest:
            raise FileFormatError(
                f"'{self.name}' is at {1e3 * speed:.5g} mm/s near t = {at:.4g} s, its path at "
                f"{1e3 * fastest:.5g} mm/s: nothing has judged that speed; plan anew with it as "
                f"the feed"
            )

    def _driven(self, times: Array, feed_times: Array) -> Iterator[Knots]:
        """Yield the motion of each interpolation.

        At `times` it is where it is at `feed_times` without ramps, at the speeds of the program.
        """
        for curve in self.curves:
            yield Knots.smooth(times, self.joints(curve(feed_times), feed_times))

    def _stepped(self, times: Array) -> Array:
        rows = linear_poses(times, self.t, self.rows)
        put_on_arcs(rows, times, self.t, self.positions, self.vias)
        return rows

    def _rounded(self, times: Array) -> Array:
        """Return rows at times where corners are cut as far from their targets as zones reach."""
        reach = np.minimum(0.5 * np.diff(self.lengths), ZONE)
        cuts = [self.lengths[1:-1] - reach[:-1], self.lengths[1:-1] + reach[1:]]
        edges, travel = np.sort(np.concatenate(cuts)), self._travel(times)
        # Between two cuts of one target it goes straight, else as it does.
        rows = self._stepped(times)
        inside = np.searchsorted(edges, travel) % 2 == 1
        if inside.any():
            at_edges = self._stepped(np.interp(edges, self.lengths, self.t))
            rows[inside] = linear_poses(travel[inside], edges, at_edges)
        return rows

    def _travel(self, times: Array) -> Array:
        """Return how far the tool has gone at times [m]: its path is the same at all speeds."""
        return np.interp(times, self.t, self.lengths)

    @override
    def spline(self, times: Array) -> Array:
        """Over the length of the path."""
        from scipy.interpolate import CubicSpline

        rows: Array = CubicSpline(self.lengths, self.rows)(self._travel(times))
        rows[:, 3:7] /= np.linalg.norm(rows[:, 3:7], axis=1, keepdims=True)
        return rows


def times_at(positions: Array, vias: Array, speeds: Array | Sequence[float]) -> Array:
    """Return when targets are reached at speeds (K,) without ramps, (K + 1,) [s]."""
    return np.append(0.0, np.cumsum(step_lengths(positions, vias) / np.asarray(speeds)))

"""Tool poses with the speed between them in place of times: what a shop touches up.

A controller goes along each straight or circular step at its speed, rounds corners within its
zone, and runs up and down by its own acceleration. So a stretch is compared with a motion where
the tool has gone as far, not at equal times. Where times are needed, ramps that are even and as
long as the planned time leaves stand for those of the controller.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import ceil
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, FileFormatError
from selfmotion.controllers.circular import put_on_arcs, step_lengths
from selfmotion.controllers.passed_lengths import PassedLength
from selfmotion.controllers.pose_stretches import PoseStretch, straight
from selfmotion.controllers.stretches import finer
from selfmotion.motion import Trajectory
from selfmotion.path import Path

# Corners are rounded within this of a target at most [m]: ABB's z0, and as much in the others.
ZONE = 3e-4
# Times of a ramp that are looked at; of a whole stretch at least, and of a step.
_OF_RAMP, _LOOKS, _OF_STEP = 24, 3200, 16
# A path that goes less is at rest [m]; speeds are the same up to this share, which digits take.
_LEAST, _SAME = 1e-6, 1e-4


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
        """How long each of them takes [s]."""
        return min(self.seconds - self.whole, 0.5 * self.seconds)

    def passed(self, times: Array) -> Array:
        """Return which times without ramps are reached at times (K,) with ramps [s]."""
        ramp, top = self.each, self.whole / (self.seconds - self.each)
        begin, end = np.clip(times, 0.0, ramp), np.clip(self.seconds - times, 0.0, ramp)
        found = top * (times - 0.5 * ramp)
        found = np.where(times < ramp, 0.5 * top * begin**2 / ramp, found)
        last = self.whole - 0.5 * top * end**2 / ramp
        return np.asarray(np.where(times > self.seconds - ramp, last, found))

    def times(self, passed: Array) -> Array:
        """Return when times without ramps (K,) are reached with ramps [s]."""
        ramp, top = self.each, self.whole / (self.seconds - self.each)
        ways = passed, self.whole - passed
        up, down = (np.sqrt(2.0 * ramp * np.maximum(x, 0.0) / top) for x in ways)
        found = np.where(up < ramp, up, passed / top + 0.5 * ramp)
        return np.asarray(np.where(down < ramp, self.seconds - down, found))


@dataclass(frozen=True, eq=False, kw_only=True)
class FeedStretch(PoseStretch):
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
    def duration(self) -> float:
        """See `Stretch.duration`."""
        return self.seconds

    @property
    def ramps(self) -> Ramps:
        """How it runs up and down where times are needed."""
        return Ramps(float(self.t[-1]), self.seconds)

    @cached_property
    def middles(self) -> PoseStretch:
        """The middles of its steps as targets: via poses of those that go round, (K,)."""
        t = 0.5 * (self.t[1:] + self.t[:-1])
        rows = self._stepped(t)
        q = self._joints(rows, t)[:, self.order]
        places = np.where(np.isfinite(self.vias), self.vias, rows[:, :3])
        return PoseStretch(
            self.name,
            t,
            q,
            places=places,
            turns=rows[:, 3:7],
            frames=self.frames,
            near=self.near,
            order=self.order,
        )

    def goes_round(self, target: int) -> bool:
        """Whether the step to a target, from 1 on, goes round."""
        return bool(np.isfinite(self.vias[target - 1, 0]))

    @cached_property
    def lengths(self) -> Array:
        """How far the tool has gone at each target, (K + 1,) [m]."""
        return np.append(0.0, np.cumsum(step_lengths(self.places, self.vias)))

    def looked_at(self) -> Array:
        """See `Stretch.looked_at`: steps may be as long as the stretch."""
        count = max(_OF_STEP, ceil(_LOOKS / (len(self.t) - 1)))
        return finer(self.t, np.linspace(0.0, 1.0, count, endpoint=False))

    def ways(self, times: Array) -> list[Array]:
        """See `Stretch.ways`: its steps, with corners rounded in their zones, a smooth curve."""
        found = [self._stepped(times)]
        if len(self.t) > 2:
            found.append(self._rounded(times))
            if not np.isfinite(self.vias).any():
                found.append(self._spline(times))
        return [self._joints(rows, times)[:, self.order] for rows in found]

    def smooth(self) -> tuple[Array, Array, Array]:
        """See `Stretch.smooth`: with its ramps."""
        times = self.ramps.times(self.looked_at())
        ends = np.linspace(0.0, self.ramps.each, _OF_RAMP)
        times = np.unique(np.concatenate([times, ends, self.seconds - ends]))
        times = times[np.append(np.diff(times) > 1e-9, True)]
        times[-1] = self.seconds
        return self._driven(times, self.ramps.passed(times))

    def matched(self, motion: Trajectory, first: float) -> Array:
        """See `Stretch.matched`: where the tool has gone as far."""
        gone = PassedLength.of_motion(self.frames, motion, first, first + self.seconds)
        return motion(np.clip(gone.when(self._shares * gone.whole), motion.t[0], motion.t[-1]))

    def at_pace(self, gone: PassedLength) -> tuple[Array, Array, Array]:
        """Return what `smooth` does, at the pace at which something else has gone as far."""
        own = np.interp(gone.at(gone.t) * (self.lengths[-1] / gone.whole), self.lengths, self.t)
        return self._driven(gone.t - gone.t[0], own)

    def along(self, path: Path, first: float) -> tuple[Array, Array, Array]:
        """Return what `smooth` does, at the pace of a path that it begins at `first` [s].

        Raises
        ------
        FileFormatError
            A speed is not that of the path.
        """
        gone = PassedLength.of_path(path, first, first + self.seconds)
        if gone.whole < _LEAST:
            raise FileFormatError(
                f"'{self.name}' moves where the path rests: the program is of another one"
            )
        ends = gone.when(self.lengths * (gone.whole / self.lengths[-1]))
        for k, (begin, end) in enumerate(pairwise(ends.tolist())):
            self._check_speed(path, gone, float(self.speeds[k]), (begin, end))
        return self.at_pace(gone)

    def _check_speed(
        self, path: Path, gone: PassedLength, speed: float, during: tuple[float, float]
    ) -> None:
        """Refuse a speed that is faster than all of the path, or none of the feeds it asks for."""
        here = (gone.t >= during[0]) & (gone.t <= during[1])
        fastest, slowest = float(gone.speed[here].max(initial=0.0)), 0.0
        at = 0.5 * sum(during)
        # Where less of a step than this is at another feed, its zone is.
        least = min(ZONE, 0.4 * float(np.ptp(gone.at(np.array(during)))))
        asked = [
            (feed, *np.clip(window, *during))
            for feed in path.feeds
            for window in feed.during
            if np.ptp(gone.at(np.clip(window, *during))) > least
        ]
        for feed, first, last in asked:
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

    @property
    def _shares(self) -> Array:
        """How far the tool has gone where it is looked at, of the whole."""
        return np.asarray(self._gone(self.looked_at()) / self.lengths[-1])

    def _driven(self, times: Array, own: Array) -> tuple[Array, Array, Array]:
        from scipy.interpolate import CubicSpline

        rows = self._spline(own) if self.is_spline else self._stepped(own)
        q = self._joints(rows, own)[:, self.order]
        if not np.isfinite(q).all():
            return times, q, q
        return times, q, CubicSpline(times, q, bc_type="clamped")(times, 1)

    def _stepped(self, times: Array) -> Array:
        rows = straight(times, self.t, self._rows())
        put_on_arcs(rows, times, self.t, self.places, self.vias)
        return rows

    def _rounded(self, times: Array) -> Array:
        """Return rows at times where corners are cut as far from their targets as zones reach."""
        reach = np.minimum(0.5 * np.diff(self.lengths), ZONE)
        cuts = [self.lengths[1:-1] - reach[:-1], self.lengths[1:-1] + reach[1:]]
        edges, gone = np.sort(np.concatenate(cuts)), self._gone(times)
        # Between two cuts of one target it goes straight, else as it does.
        rows = self._stepped(times)
        inside = np.searchsorted(edges, gone) % 2 == 1
        if inside.any():
            at_edges = self._stepped(np.interp(edges, self.lengths, self.t))
            rows[inside] = straight(gone[inside], edges, at_edges)
        return rows

    def _gone(self, times: Array) -> Array:
        """Return how far the tool has gone at times [m]: its way is the same at all speeds."""
        return np.interp(times, self.t, self.lengths)

    def _spline(self, times: Array) -> Array:
        from scipy.interpolate import CubicSpline

        rows: Array = CubicSpline(self.lengths, self._rows())(self._gone(times))
        rows[:, 3:7] /= np.linalg.norm(rows[:, 3:7], axis=1, keepdims=True)
        return rows


def times_at(places: Array, vias: Array, speeds: Array | Sequence[float]) -> Array:
    """Return when targets are reached at speeds (K,) without ramps, (K + 1,) [s]."""
    return np.append(0.0, np.cumsum(step_lengths(places, vias) / np.asarray(speeds)))

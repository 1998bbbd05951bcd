"""A feed along a path: where it has to be reached, which speed is, and what limits it."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from selfmotion.basics import Array, Flags, Ints

if TYPE_CHECKING:
    from selfmotion.model.path.feed import Feed

# Times within this are the same in messages [s].
_SAME = 1e-3


@dataclass(frozen=True, eq=False)
class FeedProfile:
    """One of the feeds of a `Feed`, and the speeds that the path reaches.

    The feed has to be reached everywhere but in run-up, run-down, rounded corners and turns on the
    spot, and at least once in each of its intervals.

    Attributes
    ----------
    asked : float
        The feed [m/s].
    within : float
        Allowed relative error of the speed.
    during : (W, 2)
        First and last times of the intervals with this feed [s].
    t, speeds : (K,)
        Sample times in these intervals [s], and the speed of the tool there [m/s].
    durations : (K,)
        Duration that each sample represents [s].
    required : (K,)
        Whether the feed has to be reached at each sample.
    causes : (K,)
        What limits the speed at each sample, in words.
    path : Feed
        The original path with this feed, which has the speed between the samples.
    path_times : (K,)
        Times of the samples on that path [s].
    rows : (K,)
        Indices of the samples on that path; consecutive ones are neighbours.
    """

    asked: float
    within: float
    during: Array
    t: Array = field(repr=False)
    speeds: Array = field(repr=False)
    durations: Array = field(repr=False)
    required: Flags = field(repr=False)
    causes: tuple[str, ...] = field(repr=False)
    path: "Feed" = field(repr=False)
    path_times: Array = field(repr=False)
    rows: Ints = field(repr=False)

    @property
    def reached(self) -> float:
        """The largest speed [m/s]."""
        return float(np.max(self.speeds))

    @property
    def slowest(self) -> float:
        """Smallest speed where the feed has to be reached [m/s].

        Of an interval that is too short for it, the largest speed.
        """
        return float(self.speeds[self._worst])

    @property
    def time(self) -> float:
        """Time of the slowest speed [s]."""
        return float(self.t[self._worst])

    @property
    def slower(self) -> float:
        """Duration for which the tool is too slow where the feed has to be reached [s]."""
        slow = (self.speeds < (1.0 - self.within) * self.asked) & self.required
        return float(self.durations @ slow)

    @property
    def held_by(self) -> str:
        """What limits the slowest speed, in words."""
        return self.causes[self._worst] if self.required[self._worst] else "run-up and run-down"

    def named(self, time: float, duration: float) -> str:
        """Return the feed in words, and its interval on a path near a time [s]."""
        first, last = self.during[int(np.argmin(np.abs(self.during - time).min(axis=1)))]
        ends = 0.0, duration
        whole = len(self.during) == 1 and np.allclose((first, last), ends, rtol=0.0, atol=_SAME)
        interval = "" if whole else f" from t = {first:.3f} to {last:.3f} s"
        return f"the feed of {self.asked:g} m/s{interval}"

    @property
    def kept(self) -> bool:
        """Whether the feed is reached wherever it has to be."""
        return self.slowest >= (1.0 - self.within) * self.asked

    @property
    def left_over(self) -> float:
        """Speed margin: how much the tool may differ from the path's speed [m/s]."""
        most = max((1.0 + self.within) * self.asked, self.reached)
        return max(min(most - self.reached, self.slowest - (1.0 - self.within) * self.asked), 0.0)

    @cached_property
    def _worst(self) -> int:
        """Index of the sample with the slowest speed; see `slowest`."""
        chosen = []
        for interval in range(len(self.during)):
            here = self._interval == interval
            if (self.required & here).any():
                chosen.append(int(np.argmin(np.where(self.required & here, self.speeds, np.inf))))
            elif here.any():
                # Too short to run up and down.
                chosen.append(int(np.argmax(np.where(here, self.speeds, -np.inf))))
        return min(chosen, key=lambda k: float(self.speeds[k]))

    @cached_property
    def _interval(self) -> Ints:
        """Index of each sample's interval, (K,)."""
        return np.maximum(np.searchsorted(self.during[:, 0], self.t, side="right") - 1, 0)

    def timed(self, when: Callable[[Array], Array]) -> "FeedProfile":
        """Return the same with other times, given by a function of these."""
        during = np.sort(when(self.during.ravel()).reshape(-1, 2), axis=1)
        return replace(self, during=during[np.argsort(during[:, 0])], t=when(self.t))

    @property
    def pieces(self) -> tuple[Array, Flags]:
        """Intervals between neighbouring samples, and whether the feed has to be reached there.

        On `path`: (I, 2) [s], and (I,), true where it has to be reached at both ends.
        """
        order = np.argsort(self.rows)
        rows, times, required = self.rows[order], self.path_times[order], self.required[order]
        are_neighbours = (np.diff(rows) == 1) & (np.diff(times) > 0.0)
        ends = np.stack([times[:-1], times[1:]], axis=1)
        return ends[are_neighbours], (required[:-1] & required[1:])[are_neighbours]

    def later(self, seconds: float) -> "FeedProfile":
        """Return the same, started later."""
        return self.timed(lambda t: t + seconds)

    def between(self, first: float, last: float) -> "FeedProfile | None":
        """Return it between two times [s]; None if the feed need not be reached there."""
        profile = self.where((self.t >= first) & (self.t <= last))
        return profile and replace(profile, during=np.clip(profile.during, first, last))

    def where(self, rows: Flags) -> "FeedProfile | None":
        """Return it at samples of a mask (K,); None if the feed need not be reached there.

        Intervals without a sample where it has to be are left out.
        """
        if rows.all():
            return self
        intervals = np.unique(self._interval[self.required & rows])
        if not len(intervals):
            return None
        rows = rows & np.isin(self._interval, intervals)
        names = ("t", "speeds", "durations", "required", "path_times", "rows")
        chosen = {name: getattr(self, name)[rows] for name in names}
        causes = tuple(np.array(self.causes)[rows].tolist())
        return replace(self, during=self.during[intervals], **chosen, causes=causes)

"""Feeds of a path with their errors: given and reached speeds, and limiting causes."""

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
class FeedKept:
    """Errors of one of the feeds of a `Feed`, in its intervals.

    The feed counts everywhere but in run-up, run-down, rounded corners and turns on the spot; each
    interval has to reach it.

    Attributes
    ----------
    asked : float
        [m/s].
    within : float
        Allowed relative error.
    during : (W, 2)
        First and last times of its intervals [s].
    t, speeds : (K,)
        Times of these [s], and how fast the tool is then [m/s].
    lasts : (K,)
        Duration that each time represents [s].
    counts : (K,)
        Whether the feed counts at each time.
    causes : (K,)
        Limiting cause at each time, in words.
    path : Feed
        The original path at this feed: its own speed between these times.
    own : (K,)
        The times on that path [s].
    rows : (K,)
        Their numbers there: consecutive ones are neighbours.
    """

    asked: float
    within: float
    during: Array
    t: Array = field(repr=False)
    speeds: Array = field(repr=False)
    lasts: Array = field(repr=False)
    counts: Flags = field(repr=False)
    causes: tuple[str, ...] = field(repr=False)
    path: "Feed" = field(repr=False)
    own: Array = field(repr=False)
    rows: Ints = field(repr=False)

    @property
    def reached(self) -> float:
        """The largest speed [m/s]."""
        return float(np.max(self.speeds))

    @property
    def slowest(self) -> float:
        """Smallest speed where it counts [m/s]; of an interval without any, the largest."""
        return float(self.speeds[self._worst])

    @property
    def time(self) -> float:
        """When that is [s]."""
        return float(self.t[self._worst])

    @property
    def slower(self) -> float:
        """For how long the tool is too slow where it counts [s]."""
        slow = (self.speeds < (1.0 - self.within) * self.asked) & self.counts
        return float(self.lasts @ slow)

    @property
    def held_by(self) -> str:
        """Limiting cause at the slowest time."""
        return self.causes[self._worst] if self.counts[self._worst] else "run-up and run-down"

    def named(self, time: float, duration: float) -> str:
        """Return the feed in words, and its interval on a path near a time [s]."""
        first, last = self.during[int(np.argmin(np.abs(self.during - time).min(axis=1)))]
        ends = 0.0, duration
        whole = len(self.during) == 1 and np.allclose((first, last), ends, rtol=0.0, atol=_SAME)
        stretch = "" if whole else f" from t = {first:.3f} to {last:.3f} s"
        return f"the feed of {self.asked:g} m/s{stretch}"

    @property
    def kept(self) -> bool:
        """Whether the feed is kept where it counts, and reached at all."""
        return self.slowest >= (1.0 - self.within) * self.asked

    @property
    def left_over(self) -> float:
        """Allowed difference of the tool's speed from the path's where the feed counts [m/s]."""
        most = max((1.0 + self.within) * self.asked, self.reached)
        return max(min(most - self.reached, self.slowest - (1.0 - self.within) * self.asked), 0.0)

    @cached_property
    def _worst(self) -> int:
        """Index of the slowest time where it counts; of an interval without any, the fastest."""
        chosen = []
        for own in range(len(self.during)):
            here = self._interval == own
            if (self.counts & here).any():
                chosen.append(int(np.argmin(np.where(self.counts & here, self.speeds, np.inf))))
            elif here.any():
                # Too short to run up and down.
                chosen.append(int(np.argmax(np.where(here, self.speeds, -np.inf))))
        return min(chosen, key=lambda k: float(self.speeds[k]))

    @cached_property
    def _interval(self) -> Ints:
        """Number of each time's interval, (K,)."""
        return np.maximum(np.searchsorted(self.during[:, 0], self.t, side="right") - 1, 0)

    def timed(self, when: Callable[[Array], Array]) -> "FeedKept":
        """Return the same at other times, given by a function of these."""
        during = np.sort(when(self.during.ravel()).reshape(-1, 2), axis=1)
        return replace(self, during=during[np.argsort(during[:, 0])], t=when(self.t))

    @property
    def pieces(self) -> tuple[Array, Flags]:
        """The intervals of the path at this feed that are left of it.

        Beginnings and ends [s], (I, 2), and whether the feed counts there, (I,): at both ends.
        """
        order = np.argsort(self.rows)
        rows, own, counts = self.rows[order], self.own[order], self.counts[order]
        next_to = (np.diff(rows) == 1) & (np.diff(own) > 0.0)
        ends = np.stack([own[:-1], own[1:]], axis=1)
        return ends[next_to], (counts[:-1] & counts[1:])[next_to]

    def later(self, seconds: float) -> "FeedKept":
        """Return the same, started later."""
        return self.timed(lambda t: t + seconds)

    def between(self, first: float, last: float) -> "FeedKept | None":
        """Return it between two times [s]; None if it does not count there."""
        found = self.where((self.t >= first) & (self.t <= last))
        return found and replace(found, during=np.clip(found.during, first, last))

    def where(self, rows: Flags) -> "FeedKept | None":
        """Return it at some of the times (K,), without intervals where it counts at none of them.

        None if it counts in no interval.
        """
        if rows.all():
            return self
        counted = np.unique(self._interval[self.counts & rows])
        if not len(counted):
            return None
        rows = rows & np.isin(self._interval, counted)
        names = ("t", "speeds", "lasts", "counts", "own", "rows")
        chosen = {name: getattr(self, name)[rows] for name in names}
        causes = tuple(np.array(self.causes)[rows].tolist())
        return replace(self, during=self.during[counted], **chosen, causes=causes)

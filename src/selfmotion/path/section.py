"""A stretch of a tool motion."""

from __future__ import annotations

from typing import Any

import numpy as np

from selfmotion.basics import Array, PathError, as_number, read_only
from selfmotion.path.base import Path, PathSamples, PathSeries, _Derived, check_path, path_series
from selfmotion.path.feed_kept import FeedKept
from selfmotion.path.retimed import Retimed

# Knots this near to an end, as a share of the duration, are the end.
_CLOSE = 1e-9
# Crowding knots: the time left is halved as often, down to 6e-5 of it.
_HALVED = 14
# Of two knots this close, as a share of the time left, one is enough.
_ENOUGH = 1e-3


class Section(_Derived, kind="section"):
    """A tool motion from one of its times to another, at its own pace.

    Parameters
    ----------
    path : Path
        The whole motion.
    first, last : float
        Where the stretch begins and ends [s].
    crowding : bool
        Whether knots crowd towards the end: a motion that ends near a singular pose changes there
        faster than any equal steps resolve.

    Raises
    ------
    PathError
        The times are not in order, or outside the motion.
    """

    def __init__(self, path: Path, first: float, last: float, crowding: bool = False) -> None:
        check_path(path, "section")
        first = as_number(first, "section: first", error=PathError)
        last = as_number(last, "section: last", error=PathError)
        if not 0.0 <= first < last <= path.duration:
            raise PathError(
                f"section: goes from {first} to {last} s, expected two times in order within "
                f"0..{path.duration:.6g} s"
            )
        self._path, self._first, self._last = path, first, last
        self._crowding, self.duration = bool(crowding), last - first

    @property
    def knots(self) -> Array:
        """See `Path.knots`."""
        knots = self._within(self._path.knots)
        return self._crowded(knots) if self._crowding else knots

    @property
    def marks(self) -> Array:
        """See `Path.marks`."""
        marks = self._within(self._path.marks)
        return np.union1d(self.knots, marks) if self._crowding else marks

    def _crowded(self, knots: Array) -> Array:
        left = self.duration * 0.5 ** np.arange(1.0, _HALVED + 1.0)
        gaps = np.abs(self.duration - left[:, None] - knots[:-1]).min(axis=1)
        inner = knots[(knots > 0.0) & (knots < (1.0 - _ENOUGH) * self.duration)]
        graded = self.duration - left[gaps > _ENOUGH * left]
        return read_only([0.0, *np.union1d(inner, graded), self.duration])

    def _within(self, times: Array) -> Array:
        near = _CLOSE * self.duration
        inner = times[(times > self._first + near) & (times < self._last - near)]
        return read_only([0.0, *(inner - self._first), self.duration])

    @property
    def rounded(self) -> Array:
        """See `Path.rounded`: those in the stretch."""
        corners = np.clip(self._path.rounded, self._first, self._last) - self._first
        return read_only(corners[corners[:, 1] > corners[:, 0]])

    @property
    def feeds(self) -> tuple[FeedKept, ...]:
        """See `Path.feeds`: those that count in the stretch."""
        found = (item.between(self._first, self._last) for item in self._path.feeds)
        return tuple(item.later(-self._first) for item in found if item)

    def when(self, wanted: Array) -> Array:
        """Return when times of the original (K,) are passed, (K,) [s]; outside, they never are."""
        return wanted - self._first

    def evaluate(self, t: Array) -> PathSamples:
        """See `Path.evaluate`."""
        found = self._path.samples(np.clip(self._first + t, self._first, self._last))
        return PathSamples(t, found.translation, found.rotation, found.twist)

    def series(self, middle: Array, half: Array) -> PathSeries | None:
        """See `Path.series`."""
        return path_series(self._path, self._first + middle, half)

    def to_dict(self) -> dict[str, Any]:
        """See `Saved.to_dict`."""
        ends = {"first": self._first, "last": self._last, "crowding": self._crowding}
        return {"kind": self.kind, "path": self._path.to_dict(), **ends}


def section_at_rest(
    path: Path,
    first: float = 0.0,
    last: float | None = None,
    ramp: float = 0.5,
    ramped: tuple[bool, bool] = (True, True),
) -> Retimed:
    """Return a stretch of a motion, run up from rest and brought to rest: only its ends are slower.

    The time σ of the original has dσ/dt = u²(3 - 2u) with u = t / ramp at the start, likewise at
    the end, and 1 in between: velocity and acceleration are continuous, and nothing but the first
    and the last half ramp of the original changes its pace. It takes half a ramp longer for each.

    Parameters
    ----------
    path : Path
        The original.
    first, last : float
        Where the stretch begins and ends [s]; by default all of it.
    ramp : float
        How long each ramp lasts [s].
    ramped : (bool, bool)
        Whether its start and its end are.

    Raises
    ------
    PathError
        The times are not in order, the ramp is not above 0, or longer than the stretch.
    """
    last = check_path(path, "section at rest").duration if last is None else last
    section = path if (first, last) == (0.0, path.duration) else Section(path, first, last)
    ramp = as_number(ramp, "section at rest: ramp", above=0.0, error=PathError)
    end = section.duration
    if ramp > end:
        raise PathError(
            f"section at rest: ramp is {ramp} s, expected a time above 0 and up to the stretch's "
            f"duration, {end:.6g} s"
        )
    up, down = (ramp if asked else 0.0 for asked in ramped)
    t = np.array([0.0, up, end + 0.5 * (up - down), end + 0.5 * (up + down)])
    sigma = np.array([0.0, 0.5 * up, end - 0.5 * down, end])
    rate = np.array([0.0 if ramped[0] else 1.0, 1.0, 1.0, 0.0 if ramped[1] else 1.0])
    # Without a ramp, or between two that fill the stretch, there is nothing.
    kept = np.append(True, np.diff(t) > _CLOSE * end)
    return Retimed(section, t[kept], sigma[kept], rate[kept], np.zeros(int(kept.sum())))

"""A tool motion at another pace, and sections of one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, PathError, as_number, as_numbers, read_only
from selfmotion.model.path.base import (
    Path,
    PathSamples,
    PathSeries,
    _Derived,
    check_path,
    path_series,
)
from selfmotion.model.path.feed_profile import FeedProfile
from selfmotion.model.path.pace import Pace, times_when

# Relative difference of paces that count as the original's own.
_OWN = 1e-9


class Retimed(_Derived, kind="retimed"):
    """The same geometric path at another pace: pose(t) is that of the original at σ(t).

    σ is a Hermite spline that does not fall, cubic, or quintic with `bend`.

    Parameters
    ----------
    path : Path
        The original.
    t : (N,)
        New times [s], increasing from 0.
    sigma : (N,)
        Original times [s], from 0 to the original's duration, or to where the motion ends before.
    rate : (N,)
        dσ/dt ≥ 0.
    bend : (N,), optional
        d²σ/dt² [1/s], for a path as smooth as the original.
    """

    def __init__(
        self,
        path: Path,
        t: npt.ArrayLike,
        sigma: npt.ArrayLike,
        rate: npt.ArrayLike,
        bend: npt.ArrayLike | None = None,
    ) -> None:
        self._path = check_path(path, "retimed path")
        given = {"t": t, "sigma": sigma, "rate": rate} | ({} if bend is None else {"bend": bend})
        numbers = {
            name: as_numbers(values, f"retimed path: {name}", error=PathError)
            for name, values in given.items()
        }
        shapes = {values.shape for values in numbers.values()}
        if len(shapes) > 1 or numbers["t"].ndim != 1 or len(numbers["t"]) < 2:
            found = ", ".join(f"{name} {values.shape}" for name, values in numbers.items())
            raise PathError(
                f"retimed path: shapes are {found}, expected (N,) each with the same N ≥ 2"
            )
        if not (np.all(np.diff(numbers["t"]) > 0) and np.all(np.diff(numbers["sigma"]) >= 0)):
            raise PathError("retimed path: times must increase and σ must not fall")
        times, passed, whole = numbers["t"], numbers["sigma"], self._path.duration
        if times[0] != 0.0 or passed[0] != 0.0 or passed[-1] > (1.0 + _OWN) * whole:
            raise PathError(
                f"retimed path: goes from {passed[0]:.6g} to {passed[-1]:.6g} s of the original "
                f"from t = {times[0]:.6g} s on, expected from 0 at t = 0 to {whole:.6g} s at most; "
                f"take a Section of it"
            )
        self._pace = Pace(**numbers)
        back = self._pace.falls_at()
        if back is not None:
            raise PathError(
                f"retimed path: σ falls between its samples near t = {back:.6g} s: rates there are "
                f"too large for how far it goes; give more samples, or smaller rates"
            )
        self.duration = float(self._pace.t[-1])

    @property
    @override
    def knots(self) -> Array:
        """The samples of a cubic pace; else when the original's are passed."""
        return self._pace.t if self._pace.bend is None else self._passed(self._path.knots)

    @property
    @override
    def marks(self) -> Array:
        """The samples of the pace, and when the original's are passed."""
        return np.union1d(self._pace.t, self._passed(self._path.marks))

    @property
    @override
    def rounded(self) -> Array:
        """When corners of the original are passed."""
        corners = self._path.rounded
        return read_only(self.when(corners.ravel()).reshape(corners.shape))

    @property
    @override
    def feeds(self) -> tuple[FeedProfile, ...]:
        """Those of the original, where it is run through at its own pace."""
        # At the original's pace, whole intervals between samples of the pace.
        pace = self._pace
        straight = np.abs(np.diff(pace.sigma) - np.diff(pace.t)) <= _OWN * np.diff(pace.t)
        level = np.abs(pace.rate - 1.0) <= _OWN
        if pace.bend is not None:
            level &= np.abs(pace.bend) * np.gradient(pace.t) <= _OWN
        others = ~(straight & level[:-1] & level[1:])
        before = np.append(0, np.cumsum(others))
        found = []
        for item in self._path.feeds:
            t = self.when(item.t)
            k = np.clip(np.searchsorted(pace.t, t, side="right") - 1, 0, len(others) - 1)
            # A time between two intervals belongs to both.
            at = np.isclose(t, pace.t[k], rtol=0.0, atol=_OWN * self.duration)
            # Between two rows with another piece in between nothing is known.
            separate = replace(item, rows=item.rows + before[k])
            own = separate.where(~others[k] | (at & ~others[np.maximum(k - 1, 0)]))
            found += [own.timed(self.when)] if own else []
        return tuple(found)

    def _passed(self, wanted: Array) -> Array:
        """Return when times of the original are passed, (K,), from 0 to the duration."""
        return read_only([0.0, *self.when(wanted)[1:-1], self.duration])

    def when(self, sigma: Array) -> Array:
        """Return when times of the original (K,) are passed, (K,) [s]."""
        pace = self._pace
        k = np.clip(np.searchsorted(pace.sigma, sigma) - 1, 0, len(pace.t) - 2)
        return times_when(pace, sigma, pace.t[k], pace.t[k + 1])

    @property
    def pace(self) -> Pace:
        """Time of the original as a function of time: σ(t)."""
        return self._pace

    @override
    def evaluate(self, t: Array) -> PathSamples:
        sigma = np.clip(self._pace(t), 0.0, self._path.duration)
        return self._at_pace(t, sigma, self._pace(t, 1))

    @override
    def series(self, middle: Array, half: Array) -> PathSeries | None:
        sigma = np.clip(self._pace(middle), 0.0, self._path.duration)
        return self._series_at(sigma, self._pace.series(middle, half))

    @override
    def to_dict(self) -> dict[str, Any]:
        pace = self._pace
        described = {"t": pace.t, "sigma": pace.sigma, "rate": pace.rate, "bend": pace.bend}
        numbers = {name: v.tolist() for name, v in described.items() if v is not None}
        return {"kind": self.kind, "path": self._path.to_dict(), **numbers}


# Distance of a knot from an end, as a share of the duration, that counts as the end.
_CLOSE = 1e-9
# Halvings of the remaining time for additional knots near an end, down to 6e-5 of it.
_HALVED = 14
# Smallest of these intervals [s]: jerks between knots h apart have a rounding error of 1e-14 rad /
# h³.
_MIN_LEFT = 1e-4
# Knots nearer than this, as a share of the remaining time, are merged.
_ENOUGH = 1e-3


class Section(_Derived, kind="section"):
    """A tool motion from one of its times to another, at its own pace.

    Parameters
    ----------
    path : Path
        The whole motion.
    first, last : float
        Start and end of the section [s].
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
    @override
    def knots(self) -> Array:
        knots = self._within(self._path.knots)
        return self._crowded(knots) if self._crowding else knots

    @property
    @override
    def marks(self) -> Array:
        marks = self._within(self._path.marks)
        return np.union1d(self.knots, marks) if self._crowding else marks

    def _crowded(self, knots: Array) -> Array:
        left = self.duration * 0.5 ** np.arange(1.0, _HALVED + 1.0)
        left = left[left >= _MIN_LEFT]
        gaps = np.abs(self.duration - left[:, None] - knots[:-1]).min(axis=1)
        inner = knots[(knots > 0.0) & (knots < (1.0 - _ENOUGH) * self.duration)]
        graded = self.duration - left[gaps > _ENOUGH * left]
        return read_only([0.0, *np.union1d(inner, graded), self.duration])

    def _within(self, times: Array) -> Array:
        near = _CLOSE * self.duration
        inner = times[(times > self._first + near) & (times < self._last - near)]
        return read_only([0.0, *(inner - self._first), self.duration])

    @property
    @override
    def rounded(self) -> Array:
        """Those in the section."""
        corners = np.clip(self._path.rounded, self._first, self._last) - self._first
        return read_only(corners[corners[:, 1] > corners[:, 0]])

    @property
    @override
    def feeds(self) -> tuple[FeedProfile, ...]:
        """Those that count in the section."""
        found = (item.between(self._first, self._last) for item in self._path.feeds)
        return tuple(item.later(-self._first) for item in found if item)

    def when(self, wanted: Array) -> Array:
        """Return when times of the original (K,) are passed, (K,) [s]; outside, they never are."""
        return wanted - self._first

    @override
    def evaluate(self, t: Array) -> PathSamples:
        found = self._path.samples(np.clip(self._first + t, self._first, self._last))
        return PathSamples(t, found.translation, found.rotation, found.twist)

    @override
    def series(self, middle: Array, half: Array) -> PathSeries | None:
        return path_series(self._path, self._first + middle, half)

    @override
    def to_dict(self) -> dict[str, Any]:
        ends = {"first": self._first, "last": self._last, "crowding": self._crowding}
        return {"kind": self.kind, "path": self._path.to_dict(), **ends}


def section_at_rest(
    path: Path,
    first: float = 0.0,
    last: float | None = None,
    ramp: float = 0.5,
    ramped: tuple[bool, bool] = (True, True),
) -> Retimed:
    """Return a section of a motion with ramps from and to rest: only its ends are slower.

    The time σ of the original has dσ/dt = u²(3 - 2u) with u = t / ramp at the start, likewise at
    the end, and 1 in between: velocity and acceleration are continuous, and nothing but the first
    and the last half ramp of the original changes its pace. It takes half a ramp longer for each.

    Parameters
    ----------
    path : Path
        The original.
    first, last : float
        Start and end of the section [s]; by default all of it.
    ramp : float
        How long each ramp lasts [s].
    ramped : (bool, bool)
        Whether its start and its end are.

    Raises
    ------
    PathError
        The times are not in order, the ramp is not above 0, or longer than the section.
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
    # Without a ramp, or between two that fill the section, there is none.
    kept = np.append(True, np.diff(t) > _CLOSE * end)
    return Retimed(section, t[kept], sigma[kept], rate[kept], np.zeros(int(kept.sum())))

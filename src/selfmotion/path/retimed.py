"""A tool motion run through at another pace."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, PathError, as_numbers, read_only
from selfmotion.path.base import Path, PathSamples, PathSeries, _Derived, check_path
from selfmotion.path.feed_kept import FeedKept
from selfmotion.path.pace import Pace, times_when

# The original is run through at its own pace where that is as near to it [share].
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
    def knots(self) -> Array:
        """See `Path.knots`: the samples of a cubic pace; else when the original's are passed."""
        return self._pace.t if self._pace.bend is None else self._passed(self._path.knots)

    @property
    def marks(self) -> Array:
        """See `Path.marks`: the samples of the pace, and when the original's are passed."""
        return np.union1d(self._pace.t, self._passed(self._path.marks))

    @property
    def rounded(self) -> Array:
        """See `Path.rounded`: when corners of the original are passed."""
        corners = self._path.rounded
        return read_only(self.when(corners.ravel()).reshape(corners.shape))

    @property
    def feeds(self) -> tuple[FeedKept, ...]:
        """See `Path.feeds`: those of the original, where it is run through at its own pace."""
        # At its own pace, all the way from one sample of the pace to the next.
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
            # A time between two pieces is one of each.
            at = np.isclose(t, pace.t[k], rtol=0.0, atol=_OWN * self.duration)
            # Between two rows with another piece in between nothing is known.
            apart = replace(item, rows=item.rows + before[k])
            own = apart.where(~others[k] | (at & ~others[np.maximum(k - 1, 0)]))
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
        """How fast the original is run through: σ(t)."""
        return self._pace

    def evaluate(self, t: Array) -> PathSamples:
        """See `Path.evaluate`."""
        sigma = np.clip(self._pace(t), 0.0, self._path.duration)
        return self._at_pace(t, sigma, self._pace(t, 1))

    def series(self, middle: Array, half: Array) -> PathSeries | None:
        """See `Path.series`."""
        sigma = np.clip(self._pace(middle), 0.0, self._path.duration)
        return self._series_at(sigma, self._pace.series(middle, half))

    def to_dict(self) -> dict[str, Any]:
        """See `Saved.to_dict`."""
        pace = self._pace
        described = {"t": pace.t, "sigma": pace.sigma, "rate": pace.rate, "bend": pace.bend}
        numbers = {name: v.tolist() for name, v in described.items() if v is not None}
        return {"kind": self.kind, "path": self._path.to_dict(), **numbers}

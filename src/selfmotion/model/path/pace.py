"""Paces: a time σ of a motion's own as a function of time t."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from selfmotion.basics import Array, Flags, Ints, series

# Samples within this share of a window are merged: more would add rounding to the jerk.
_CLOSE = 0.1
# The same across such shares.
_SAME = 1e-4
# A pace decreases if its rate is below minus this share of the largest …
_FALL = 1e-6
# … at this number of places of an interval.
_PLACES = 33
# Samples lie on the polynomial between their neighbours if its value, first and second derivative
# differ by no more than these shares of the largest ones: what rounding does to 1,000 samples.
_ON_IT = 1e-12, 1e-9, 1e-6
# Bisections of the time at which σ has a value.
_HALVINGS = 52


@dataclass(frozen=True, eq=False)
class Pace:
    """σ(t) at times, with interpolation.

    Quintic where the second derivative is known, cubic where it jumps.

    Attributes
    ----------
    t : (K,)
        Times [s], increasing from 0.
    sigma : (K,)
        The original time [s], not falling.
    rate : (K,)
        dσ/dt ≥ 0.
    bend : (K,), optional
        d²σ/dt² [1/s].
    """

    t: Array
    sigma: Array
    rate: Array
    bend: Array | None = None

    def slower(self, factor: float) -> "Pace":
        """Return the same, `factor` times as long."""
        bend = None if self.bend is None else self.bend / factor**2
        return Pace(factor * self.t, self.sigma, self.rate / factor, bend)

    def smoothed(self, window: float) -> "Pace":
        """Return the mean over a window in time [s]: its second derivative jumps no more.

        It rests before its start and after its end, and takes a window longer. Between two bends
        the third derivative is at most their difference divided by the window. The mean of a
        function that does not decrease does not decrease either: if fewer samples would make it, it
        has all.
        """
        thinned = self._mean(window, _CLOSE)
        thinned = thinned if thinned.falls_at() is None else self._mean(window, _SAME)
        simplified = thinned.simplified()
        return simplified if simplified.falls_at() is None else thinned

    def simplified(self) -> "Pace":
        """Return the same without the samples that lie on the polynomial between two others."""
        kept = self._breaks
        while True:
            found = self._some(kept)
            off = np.setdiff1d(np.flatnonzero(~self._lies_on(found)), kept)
            if not len(off):
                return found
            # Where one polynomial is not enough, halves of it are tried.
            intervals = np.unique(np.searchsorted(kept, off)) - 1
            kept = np.union1d(kept, (kept[intervals] + kept[intervals + 1]) // 2)

    @property
    def _breaks(self) -> Ints:
        """Samples at which the polynomial may become another one; both ends."""
        span = self.t[2:] - self.t[:-2]
        # Of two intervals the longer one's polynomial goes on into the other with less rounding.
        met = self._is_met(slice(None, -1), span, slice(2, None))
        met |= self._is_met(slice(1, None), self.t[:-2] - self.t[1:-1], slice(None, -2))
        return np.concatenate([[0], np.flatnonzero(~met) + 1, [len(self.t) - 1]])

    def _is_met(self, pieces: slice, later: Array, samples: slice) -> Flags:
        """Return whether polynomials, so much later than they begin, meet samples, (K - 2,)."""
        coefficients = self._spline.c[:, pieces]
        met = np.ones(len(later), dtype=bool)
        for share, known in zip(_ON_IT, self._known, strict=False):
            found = coefficients[0].copy()
            for each in coefficients[1:]:
                found = found * later + each
            met &= np.abs(found - known[samples]) <= share * np.abs(known).max()
            powers = np.arange(len(coefficients) - 1.0, 0.0, -1.0)
            coefficients = coefficients[:-1] * powers[:, None]
        return met

    def _lies_on(self, other: "Pace") -> Flags:
        """Return which samples lie on another pace, (K,)."""
        met = np.ones(len(self.t), dtype=bool)
        for order, (share, known) in enumerate(zip(_ON_IT, self._known, strict=False)):
            met &= np.abs(other(self.t, order) - known) <= share * np.abs(known).max()
        return met

    @property
    def _known(self) -> tuple[Array, ...]:
        """σ, its rate, and its second derivative where that is known, (K,) each."""
        return (self.sigma, self.rate, *(() if self.bend is None else (self.bend,)))

    def _some(self, rows: Ints) -> "Pace":
        bend = None if self.bend is None else self.bend[rows]
        return Pace(self.t[rows], self.sigma[rows], self.rate[rows], bend)

    def _mean(self, window: float, close: float) -> "Pace":
        """Return the mean over a window, by samples no closer than this share of it."""
        from scipy.interpolate import CubicHermiteSpline

        t = np.concatenate([[-window], self.t, [self.t[-1] + window]])
        sigma = np.concatenate([self.sigma[:1], self.sigma, self.sigma[-1:]])
        rate = np.concatenate([[0.0], self.rate, [0.0]])
        spline = CubicHermiteSpline(t, sigma, rate)
        integral = spline.antiderivative()
        new = np.union1d(self.t, self.t + window)
        new = new[np.unique(np.floor(new / (close * window)), return_index=True)[1]]
        # Neighbours on both sides of such a share are merged as well.
        new = new[np.append(True, np.diff(new) > _SAME * window)]
        new[-1] = self.t[-1] + window
        before = new - window
        mean = np.clip((integral(new) - integral(before)) / window, self.sigma[0], self.sigma[-1])
        mean[0], mean[-1] = self.sigma[0], self.sigma[-1]
        speed = np.maximum((spline(new) - spline(before)) / window, 0.0)
        return Pace(new, mean, speed, (spline(new, 1) - spline(before, 1)) / window)

    def __call__(self, t: Array, order: int = 0) -> Array:
        """Return σ (`order` 0) or a derivative (1 to 3) at times (K,), after a sample at it."""
        found: Array = self._spline(t, nu=order)
        known = (self.sigma, self.rate, self.bend, None)[order]
        if known is not None:
            # Where a motion ends at rest it does so exactly.
            found = np.where(np.asarray(t) == self.t[-1], known[-1], found)
        return np.clip(found, self.sigma[0], self.sigma[-1]) if order == 0 else found

    def falls_at(self) -> float | None:
        """Return about when σ falls most, by more than rounding; None where it never does."""
        h = np.diff(self.t)
        # dσ/dt in Bernstein form: bounds of its control points are bounds of all of it.
        coefficients = self._spline.c[::-1][1:]
        degree = len(coefficients) - 1
        powers = np.arange(degree + 1.0)
        local = coefficients * (powers + 1.0)[:, None] * h ** powers[:, None]
        points = series.bernstein(degree) @ local
        allowed = _FALL * max(float(np.max(self.rate)), self.sigma[-1] / self.t[-1])
        late = np.flatnonzero(points.min(axis=0) < -allowed)
        if not len(late):
            return None
        # Control points are below the curve: it is evaluated where they are negative.
        u = np.linspace(0.0, 1.0, _PLACES)
        rates = np.vander(u, degree + 1, increasing=True) @ local[:, late]
        place, segment = np.unravel_index(int(np.argmin(rates)), rates.shape)
        if rates[place, segment] >= -allowed:
            return None
        k = int(late[segment])
        return float(self.t[k] + u[place] * h[k])

    def series(self, middle: Array, half: Array) -> Array:
        """Return the majorants of σ on intervals between samples, (K + 1, I)."""
        spline = self._spline
        segments = series.of_pieces(spline.x, spline.c[::-1], middle, half)
        return series.of_polynomial(segments)

    @cached_property
    def _spline(self) -> Any:
        from scipy.interpolate import CubicHermiteSpline, PPoly

        if self.bend is None:
            return CubicHermiteSpline(self.t, self.sigma, self.rate)
        h, start, end = np.diff(self.t), 0.5 * self.bend[:-1], 0.5 * self.bend[1:]
        # Remainder at the end of each interval, of the value and of two derivatives.
        rise = (np.diff(self.sigma) - h * (self.rate[:-1] + h * start)) / h**3
        gain = (np.diff(self.rate) - 2.0 * h * start) / h**2
        surge = (end - start) / h
        higher = (
            (6.0 * rise - 3.0 * gain + surge) / h**2,
            (-15.0 * rise + 7.0 * gain - 2.0 * surge) / h,
            10.0 * rise - 4.0 * gain + surge,
        )
        return PPoly(np.stack([*higher, start, self.rate[:-1], self.sigma[:-1]]), self.t)


def _times_along(places: Array, rates: Array) -> Array:
    """Return when places (K,) are reached at rates (K,) whose squares are linear in between."""
    return np.append(0.0, np.cumsum(2.0 * np.diff(places) / (rates[:-1] + rates[1:])))


def largest_pace(lengths: Array, most: Array, gain: Array) -> tuple[Pace, Ints]:
    """Return the largest pace from rest to rest, its square ≤ `most`, changing by ≤ `gain`.

    And for each node which one limits its pace: itself, or one that it is run up from or down to.
    """
    limiting = np.arange(len(lengths))
    squared = most.copy()
    squared[0] = squared[-1] = 0.0
    steps = np.diff(lengths) * np.minimum(gain[:-1], gain[1:])
    for k in range(len(steps)):
        if squared[k] + steps[k] < squared[k + 1]:
            squared[k + 1], limiting[k + 1] = squared[k] + steps[k], limiting[k]
    for k in reversed(range(len(steps))):
        if squared[k + 1] + steps[k] < squared[k]:
            squared[k], limiting[k] = squared[k + 1] + steps[k], limiting[k + 1]
    rates = np.sqrt(squared)
    return Pace(_times_along(lengths, rates), lengths, rates), limiting


def times_when(
    reached: Callable[[Array], Array], wanted: Array, early: Array, late: Array
) -> Array:
    """Return when a function that does not fall reaches values (K,), between times (K,) each."""
    for _ in range(_HALVINGS if len(wanted) else 0):
        middle = 0.5 * (early + late)
        before = reached(middle) < wanted
        early, late = np.where(before, middle, early), np.where(before, late, middle)
    return late

"""Fletcher's line search: bracketing, then sectioning with cubic interpolation."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

# Evaluations of one search, by far.
_MOST = 60


@dataclass(frozen=True)
class _Point:
    """φ at a step: value, and slope where it was needed."""

    alpha: float
    value: float
    slope: float | None = None


@dataclass(frozen=True)
class LineSearch:
    """Finds a step α with sufficient decrease and a small slope (strong Wolfe conditions).

    φ(α) ≤ φ(0) + ρ α φ'(0)  and  |φ'(α)| ≤ -σ φ'(0).

    R. Fletcher, Practical Methods of Optimization, 2nd ed., chapter 2.6; `tau1` to `tau3` as there.
    A step where φ is infinite, or its slope, counts as too long.

    Parameters
    ----------
    rho, sigma : float
        0 < ρ < σ < 1. σ = 0.1 is a fairly exact search, 0.9 a weak one.
    tau1 : float
        How far, at most, bracketing extrapolates, in multiples of the last advance.
    tau2, tau3 : float
        How near to the ends of the bracket sectioning may step, as fractions of its length.
    """

    rho: float = 0.01
    sigma: float = 0.9
    tau1: float = 9.0
    tau2: float = 0.1
    tau3: float = 0.5

    def search(
        self,
        value: Callable[[float], float],
        slope: Callable[[float], float],
        value0: float,
        slope0: float,
        *,
        first: float,
        longest: float,
        more: Callable[[], bool],
    ) -> tuple[float, float] | None:
        """Search along φ from α = 0.

        Parameters
        ----------
        value, slope : callable
            φ and φ'; `slope` is only asked at the point that `value` was asked last.
        value0, slope0 : float
            φ(0) and φ'(0) < 0.
        first, longest : float
            The first step to try, and one that is accepted when φ still falls there.
        more : callable
            Whether another evaluation is allowed.

        Returns
        -------
        (α, φ(α)) or None
            None where no step decreases φ beyond rounding, or no evaluation is left.
        """
        start = _Point(0.0, value0, slope0)
        before, alpha = start, first
        for _ in range(_MOST):
            if not more():
                break
            here = _Point(alpha, value(alpha))
            if self._too_high(here, start) or here.value >= before.value:
                return self._section(value, slope, start, before, here, more)
            here = _Point(alpha, here.value, slope(alpha))
            rise = _slope(here)
            if not np.isfinite(rise):
                return self._section(value, slope, start, before, _Point(alpha, np.inf), more)
            if abs(rise) <= -self.sigma * slope0 or (alpha >= longest and rise < 0.0):
                return here.alpha, here.value
            if rise >= 0.0:
                return self._section(value, slope, start, here, before, more)
            advance = alpha - before.alpha
            nearest = min(alpha + advance, longest)
            farthest = min(alpha + self.tau1 * advance, longest)
            alpha, before = _minimizer(before, here, nearest, farthest), here
        return _decreased(before)

    def _section(
        self,
        value: Callable[[float], float],
        slope: Callable[[float], float],
        start: _Point,
        low: _Point,
        high: _Point,
        more: Callable[[], bool],
    ) -> tuple[float, float] | None:
        """Shrink a bracket; `low` is its best end, of known slope, pointing into it."""
        slope0 = _slope(start)
        rounding = 4.0 * np.finfo(float).eps * abs(start.value)
        for _ in range(_MOST):
            if not more():
                break
            length = high.alpha - low.alpha
            nearest = low.alpha + self.tau2 * length
            farthest = high.alpha - self.tau3 * length
            alpha = _minimizer(low, high, nearest, farthest)
            if (low.alpha - alpha) * _slope(low) <= rounding:
                break
            here = _Point(alpha, value(alpha))
            if self._too_high(here, start) or here.value >= low.value:
                high = here
                continue
            here = _Point(alpha, here.value, slope(alpha))
            if not np.isfinite(_slope(here)):
                high = _Point(alpha, np.inf)
                continue
            if abs(_slope(here)) <= -self.sigma * slope0:
                return here.alpha, here.value
            if length * _slope(here) >= 0.0:
                high = low
            low = here
        return _decreased(low)

    def _too_high(self, point: _Point, start: _Point) -> bool:
        bound = start.value + self.rho * point.alpha * _slope(start)
        return not point.value <= bound


def _decreased(point: _Point) -> tuple[float, float] | None:
    return (point.alpha, point.value) if point.alpha > 0.0 else None


def _slope(point: _Point) -> float:
    if point.slope is None:
        raise ValueError(f"the slope at α = {point.alpha} was not computed")
    return point.slope


def _minimizer(a: _Point, b: _Point, nearest: float, farthest: float) -> float:
    """Return where the polynomial through a and b is least between two steps.

    Cubic where both slopes are known, quadratic with a's slope alone; where b is infinite, the
    step next to a.
    """
    if not np.isfinite(b.value):
        return nearest
    length = b.alpha - a.alpha
    ends = np.array([nearest, farthest])
    z = (ends - a.alpha) / length
    rise, slope = b.value - a.value, _slope(a) * length
    if b.slope is None:
        coefficients = np.array([rise - slope, slope, 0.0])
    else:
        end_slope = b.slope * length
        cubic, square = slope + end_slope - 2.0 * rise, 3.0 * rise - 2.0 * slope - end_slope
        coefficients = np.array([cubic, square, slope, 0.0])
    stationary = np.roots(np.polyder(coefficients))
    real = stationary[np.abs(stationary.imag) < 1e-12].real
    inside = real[(real > z.min()) & (real < z.max())]
    candidates = np.concatenate([z, inside])
    best = candidates[np.argmin(np.polyval(coefficients, candidates))]
    return float(a.alpha + best * length)

"""The Broyden-family quasi-Newton method with Fletcher's switch and line search.

Its only input is x → (F, ∇F).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, ProblemError, as_choice, as_number, as_whole, read_only, shown
from selfmotion.planning.optimise.base import (
    Callback,
    Function,
    Iteration,
    Minimum,
    Status,
    inverse_metric,
)

# Limit of evaluations in one line search; a few are usual.
_MAX_EVALUATIONS = 60
# Step of a central difference, as a share of the method's step.
_SHARE = 1e-4
# A predicted difference below this many times its rounding proves nothing.
_ABOVE_ROUNDING = 1e3
# Slope and difference count as equal within this factor.
_FACTOR = 2.0


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
            φ and φ'; `slope` is only called at the last point of `value`.
        value0, slope0 : float
            φ(0) and φ'(0) < 0.
        first, longest : float
            First step to try, and one that is accepted when φ still falls there.
        more : callable
            Whether another evaluation is allowed.

        Returns
        -------
        (α, φ(α)) or None
            None where no step decreases φ beyond rounding, or no evaluation is left.
        """
        start = _Point(0.0, value0, slope0)
        before, alpha = start, first
        for _ in range(_MAX_EVALUATIONS):
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
        for _ in range(_MAX_EVALUATIONS):
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
    """Return the minimiser of the interpolating polynomial through a and b between two steps.

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


_FLETCHER = LineSearch()


def renewed(h: Array, s: Array, y: Array, update: str) -> tuple[Array, str]:
    """Return H renewed by a formula of Broyden's family for s = Δx and y = Δ∇F, and its name.

    `update` is "bfgs", "dfp", or "fletcher" for the switch; the name is "none" where no formula
    keeps H positive definite.
    """
    hy = h @ y
    sy, yhy = float(s @ y), float(y @ hy)
    # Without positive curvature along s no update keeps H positive definite.
    if not (sy > 1e-14 * float(np.linalg.norm(s) * np.linalg.norm(y)) and yhy > 0.0):
        return h, "none"
    if update == "fletcher":
        update = "dfp" if sy < yhy else "bfgs"
    h = h + (np.outer(s, s) / sy - np.outer(hy, hy) / yhy)
    if update == "bfgs":
        v = s / sy - hy / yhy
        h = h + yhy * np.outer(v, v)
    return h, update


def is_misleading(
    value: Callable[[Array], float], x: Array, cost: float, step: Array, slope: float
) -> bool:
    """Return whether the change of F along `step` contradicts its slope.

    One central difference; False where rounding hides the answer, or F is infinite nearby.

    Parameters
    ----------
    value : callable
        F.
    x, step : (size,)
    cost, slope : float
        F(x) and ∇F(x)ᵀ step.
    """
    rounding = float(np.finfo(float).eps) * abs(cost)
    if not abs(slope) * _SHARE > _ABOVE_ROUNDING * rounding:
        return False
    rise = value(x + _SHARE * step) - value(x - _SHARE * step)
    if not np.isfinite(rise):
        return False
    ratio = rise / (2.0 * _SHARE * slope)
    return not 1.0 / _FACTOR <= ratio <= _FACTOR


@dataclass(frozen=True)
class QuasiNewton:
    """Broyden's family on the inverse Hessian H, with Fletcher's line search.

    With s = Δx and y = Δ∇F, the two ends of the family are

        DFP:   H + ssᵀ/(sᵀy) - Hyyᵀ H/(yᵀHy)
        BFGS:  DFP + v vᵀ,  v = √(yᵀHy) (s/(sᵀy) - Hy/(yᵀHy))

    and Fletcher's switch takes DFP when sᵀy < yᵀHy, BFGS otherwise (R. Fletcher, "A new approach
    to variable metric algorithms", Computer Journal 13, 1970).

    Parameters
    ----------
    update : {"fletcher", "bfgs", "dfp"}
        Which end of the family: Fletcher's switch, or one of the two alone.
    initial_metric : {"gauss-newton", "identity"}
        H0 where none is given: the inverse of the function's Gauss-Newton matrix at the start, or
        the paper's identity.
    tolerance : float
        Converged when the decrease that the model predicts, ½ ∇Fᵀ H ∇F, is below this times |F|.
    max_iterations : int
        Limit of iterations.
    line_search : LineSearch
        How far it goes along each direction.
    unbounded : float
        Stops when |x| exceeds this times its scale at the start (1 + |x0|), or F is so negative
        that its value at the start is lost in rounding.
    """

    update: str = "fletcher"
    tolerance: float = 1e-8
    max_iterations: int = 200
    line_search: LineSearch = _FLETCHER
    unbounded: float = 1e8
    initial_metric: str = "gauss-newton"

    def __post_init__(self) -> None:
        as_choice(self.update, "optimiser: update", ("fletcher", "bfgs", "dfp"))
        as_choice(self.initial_metric, "optimiser: initial_metric", ("gauss-newton", "identity"))
        as_number(self.tolerance, "optimiser: tolerance", above=0.0)
        as_number(self.unbounded, "optimiser: unbounded", above=0.0)
        as_whole(self.max_iterations, "optimiser: max_iterations", 1, 10**9)
        if not isinstance(self.line_search, LineSearch):
            raise ProblemError(
                f"optimiser: line_search is {shown(self.line_search)}, expected a LineSearch"
            )

    def minimize(
        self,
        function: Function,
        x0: Array,
        inverse_hessian: Array | None = None,
        *,
        max_evaluations: int | None = None,
        callback: Callback | None = None,
    ) -> Minimum:
        """Minimise `function` from `x0`; see `Optimizer.minimize`.

        Parameters
        ----------
        function : Function
        x0 : (size,)
            F(x0) must be finite.
        inverse_hessian : (size, size), optional
            H0; by default that of `initial_metric`.
        max_evaluations : int, optional
            Limit on `Function.evaluations`.
        callback : callable, optional
            Called with each `Iteration`; returning True stops.

        Returns
        -------
        Minimum
            The best point found, also after an interruption from the keyboard.
        """
        if inverse_hessian is None and self.initial_metric == "gauss-newton":
            inverse_hessian = inverse_metric(function.metric(x0))
        run = _Minimisation(self, function, x0, inverse_hessian, max_evaluations, callback)
        try:
            status = run.until_done()
        except KeyboardInterrupt:
            status = Status.INTERRUPTED
        return run.minimum(status)


class _Minimisation:
    """Iterate of one minimisation."""

    def __init__(
        self,
        method: QuasiNewton,
        function: Function,
        x0: Array,
        inverse_hessian: Array | None,
        max_evaluations: int | None,
        callback: Callback | None,
    ) -> None:
        self._method, self._function, self._callback = method, function, callback
        self._limit = np.inf if max_evaluations is None else max_evaluations
        self._scaled = inverse_hessian is not None
        self._h = np.eye(len(x0)) if inverse_hessian is None else np.array(inverse_hessian)
        self._x = np.array(x0, dtype=np.float64)
        self._bound = method.unbounded * (1.0 + float(np.linalg.norm(x0)))
        self._cost = function.value(self._x)
        if not np.isfinite(self._cost):
            raise ProblemError("optimiser: the cost at the start is not finite")
        # So far down, the cost at the start is a rounding error.
        self._lowest = -max(abs(self._cost), 1.0) / float(np.finfo(float).eps)
        self._gradient = np.zeros_like(self._x)
        self._history: list[Iteration] = []

    def until_done(self) -> Status:
        self._gradient = self._derivative()
        if self._record("none", 0.0):
            return Status.STOPPED
        for _ in range(self._method.max_iterations):
            status = self._iterate()
            if status is not None:
                return status
        return Status.MAX_ITERATIONS

    def minimum(self, status: Status) -> Minimum:
        return Minimum(read_only(self._x), self._cost, self._h, tuple(self._history), status)

    def _iterate(self) -> Status | None:
        direction = -self._h @ self._gradient
        slope = float(self._gradient @ direction)
        # With an unscaled H0 the model predicts nothing about F; only a zero gradient counts.
        scale = abs(self._cost) if self._scaled else np.finfo(float).tiny
        if -0.5 * slope <= self._method.tolerance * max(scale, np.finfo(float).tiny):
            return Status.CONVERGED
        if self._function.evaluations >= self._limit:
            return Status.MAX_EVALUATIONS
        size = float(np.linalg.norm(direction))
        found = self._method.line_search.search(
            lambda alpha: self._function.value(self._x + alpha * direction),
            lambda alpha: self._function.slope(self._x + alpha * direction, direction),
            self._cost,
            slope,
            first=1.0 if self._scaled else min(1.0, 1.0 / size),
            longest=2.0 * self._bound / size,
            more=lambda: self._function.evaluations < self._limit,
        )
        if found is None:
            if self._function.evaluations + 2 > self._limit:
                return Status.MAX_EVALUATIONS
            misled = is_misleading(self._function.value, self._x, self._cost, direction, slope)
            return Status.GRADIENT if misled else Status.PRECISION
        alpha, self._cost = found
        s = alpha * direction
        self._x = self._x + s
        gradient = self._derivative()
        self._h, update = renewed(self._h, s, gradient - self._gradient, self._method.update)
        # One update is enough to give H the scale of F.
        self._scaled = self._scaled or update != "none"
        self._gradient = gradient
        if self._record(update, alpha):
            return Status.STOPPED
        far = np.linalg.norm(self._x) > self._bound or self._cost < self._lowest
        return Status.UNBOUNDED if far else None

    def _derivative(self) -> Array:
        gradient = self._function.gradient(self._x)
        if not np.all(np.isfinite(gradient)):
            raise ProblemError("optimiser: the cost is finite, but its gradient is not")
        return gradient

    def _record(self, update: str, step: float) -> bool:
        iteration = Iteration(
            read_only(self._x),
            self._cost,
            float(np.linalg.norm(self._gradient)),
            update,
            step,
            self._function.evaluations,
        )
        self._history.append(iteration)
        return self._callback is not None and bool(self._callback(iteration))

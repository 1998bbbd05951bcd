"""The Broyden-family quasi-Newton method with Fletcher's switch; knows only x → (F, ∇F)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, ProblemError, as_choice, as_number, as_whole, read_only, shown
from selfmotion.optimise.base import (
    Callback,
    Function,
    Iteration,
    Minimum,
    Status,
    inverse_metric,
)
from selfmotion.optimise.line_search import LineSearch

_FLETCHER = LineSearch()


# The difference is taken over this share of the step that the method wanted, and means something
# where it is so many times its own rounding.
_SHARE, _ABOVE_ROUNDING = 1e-4, 1e3
# The slope and the difference are taken for the same within this factor.
_FACTOR = 2.0


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
    """Return whether F does not change along `step` as its slope there says.

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
        After so many it stops where it is.
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
    """The state of one minimisation."""

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

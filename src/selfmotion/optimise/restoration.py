"""Where linearised conditions pull in opposite directions: out by a quadratic penalty."""

from dataclasses import replace

import numpy as np

from selfmotion.basics import Array
from selfmotion.optimise.base import Callback, ConstrainedFunction, Iteration, Residuals, Status
from selfmotion.optimise.quasi_newton import QuasiNewton

# The violation at the start weighs this many times the cost there.
_WEIGHT = 10.0
# This exact, and no more evaluations than that: the rest is for sequential quadratic programming.
_TOLERANCE, _EVALUATIONS = 1e-4, 60


class _Penalised:
    """F + ρ/2 Σ (max(0, h)/tolerance)², |h| for equalities, as a function of its own."""

    def __init__(self, function: ConstrainedFunction, weight: float) -> None:
        self._function, self._weight = function, weight

    @property
    def evaluations(self) -> int:
        return self._function.evaluations

    def value(self, x: Array) -> float:
        cost = self._function.value(x)
        if not np.isfinite(cost):
            return np.inf
        violated = _excess(self._function.conditions(x))
        total = cost + 0.5 * self._weight * float(np.sum(violated**2))
        return total if np.isfinite(total) else np.inf

    def gradient(self, x: Array) -> Array:
        at = self._function.conditions(x)
        pull = self._weight * _excess(at) / at.tolerance
        rows = self._function.condition_rows(x)
        return np.asarray(self._function.gradient(x) + pull @ rows)

    def slope(self, x: Array, direction: Array) -> float:
        return float(self.gradient(x) @ direction)

    def metric(self, x: Array) -> Array:
        at = self._function.conditions(x)
        violated = _excess(at) != 0.0
        rows = self._function.condition_rows(x)[violated] / at.tolerance[violated, None]
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray(self._function.metric(x) + self._weight * rows.T @ rows)


def _excess(at: Residuals) -> Array:
    """Return h/tolerance where it is violated, 0 elsewhere; equalities keep their sign."""
    return np.asarray(np.where(at.equality, at.h, np.maximum(at.h, 0.0)) / at.tolerance)


def restored(
    function: ConstrainedFunction,
    x: Array,
    weight: float,
    limit: float,
    note: Callback,
) -> tuple[Array, Status | None]:
    """Return where the quasi-Newton method takes F and a penalty on what is violated.

    Unlike the largest violation, the sum of squares falls also where one condition has to wait for
    the others. F keeps it from going far.

    Parameters
    ----------
    function : ConstrainedFunction
    x : (size,)
        Where a condition is violated.
    weight : float
        Factor on the penalty's usual weight.
    limit : float
        On `Function.evaluations`.
    note : callable
        Called with each `Iteration`, with the cost F; returning True stops.

    Returns
    -------
    x : (size,)
    status : Status or None
        What ends the optimisation; None where it can go on from x.
    """
    penalised = _Penalised(function, 1.0)
    cost = function.value(x)
    amount = penalised.value(x) - cost
    penalised = _Penalised(function, weight * _WEIGHT * max(abs(cost), 1e-3) / amount)
    asked = [False]

    def told(iteration: Iteration) -> bool:
        asked[0] = bool(note(replace(iteration, cost=function.value(iteration.x))))
        return asked[0]

    most = int(min(limit, function.evaluations + _EVALUATIONS))
    method = QuasiNewton(tolerance=_TOLERANCE)
    found = method.minimize(penalised, x, max_evaluations=most, callback=told)
    if asked[0]:
        return found.x, Status.STOPPED
    if found.status is Status.INTERRUPTED:
        return found.x, found.status
    return found.x, Status.MAX_EVALUATIONS if function.evaluations >= limit else None

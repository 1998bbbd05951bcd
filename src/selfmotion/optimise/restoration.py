"""Where linearised conditions pull in opposite directions: out by a quadratic penalty."""

import numpy as np

from selfmotion.basics import Array
from selfmotion.optimise.base import Callback, ConstrainedFunction, Iteration, Residuals, Status
from selfmotion.optimise.rows import pulled_back

# The violation at the start weighs this many times the cost there.
_WEIGHT = 10.0
# This exact, and no more evaluations than that: the rest is for sequential quadratic programming.
_TOLERANCE, _EVALUATIONS = 1e-4, 60
# λ at first, at least, and beyond which nothing leads down; what multiplies it after a step that
# fell by more than foreseen's first share, or less than its second; and what a step has to fall by.
_DAMPING, _SOFTEST, _STIFFEST = 1e-3, 1e-9, 1e9
_SOFTER, _STIFFER, _GOOD, _POOR, _TAKEN = 0.2, 5.0, 0.75, 0.25, 1e-3
# Steps of a scan, and the axes that they are made along.
_STEPS, _AXES = (1.0, -1.0, 2.0, -2.0, 3.0, -3.0), 3
# Added to the metric that λ weighs, relative to its trace.
_REGULAR = 1e-9


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
        return np.asarray(self._function.gradient(x) + pulled_back(rows, pull))

    def slope(self, x: Array, direction: Array) -> float:
        return float(self.gradient(x) @ direction)

    def metric(self, x: Array) -> Array:
        at = self._function.conditions(x)
        violated = np.flatnonzero(_excess(at))
        rows = self._function.condition_rows(x).picked(violated) / at.tolerance[violated, None]
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray(self._function.metric(x) + self._weight * rows.T @ rows)


def _excess(at: Residuals) -> Array:
    """Return h/tolerance where it is violated, 0 elsewhere; equalities keep their sign."""
    return np.asarray(np.where(at.equality, at.h, np.maximum(at.h, 0.0)) / at.tolerance)


def restored(
    function: ConstrainedFunction, x: Array, weight: float, limit: float, note: Callback
) -> tuple[Array, Status | None]:
    """Return where the Levenberg-Marquardt method takes F and a penalty on what is violated.

    Unlike the largest violation, the sum of squares falls also where one condition has to wait for
    the others. F keeps it from going far. (J. J. Moré, "The Levenberg-Marquardt algorithm:
    implementation and theory", Numerical Analysis, Lecture Notes in Mathematics 630, 1978.)

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
        Where all conditions are kept, or where nothing is left to gain.
    status : Status or None
        What ends the optimisation; None where it can go on from x.
    """
    if function.conditions(x).worst <= 1.0:
        return x, None
    penalised = _Penalised(function, weight * _usual_weight(function, x))
    ground = function.metric(x)
    if not np.isfinite(ground).all():
        # A motion in an instant has derivatives beyond all numbers: nothing leads out of it.
        return x, Status.INFEASIBLE
    ground += _REGULAR * np.trace(ground) * np.eye(len(x))
    most, value = min(limit, function.evaluations + _EVALUATIONS), penalised.value(x)
    damping = _DAMPING
    try:
        while function.conditions(x).worst > 1.0:
            step = _fall(penalised, x, value, ground, damping, most)
            if step is None:
                break
            before, (x, value, damping) = value, step
            if note(_iteration(function, x)):
                return x, Status.STOPPED
            if before - value <= _TOLERANCE * abs(before):
                break
    except KeyboardInterrupt:
        return x, Status.INTERRUPTED
    return x, Status.MAX_EVALUATIONS if function.evaluations >= limit else None


def _iteration(function: ConstrainedFunction, x: Array) -> Iteration:
    size = float(np.linalg.norm(function.gradient(x)))
    return Iteration(x, function.value(x), size, "none", 1.0, function.evaluations)


def scanned(function: ConstrainedFunction, x: Array, axes: Array) -> Array:
    """Return the point of least penalty some steps from `x` along the first of `axes`, both ways.

    Where conditions bend back, no small step tells which way leads out.

    Parameters
    ----------
    function : ConstrainedFunction
    x : (size,)
        Where a condition is violated.
    axes : (size, D)
        Directions, the first ones first; a step along one would lower a quadratic cost to nothing.
    """
    penalised = _Penalised(function, _usual_weight(function, x))
    steps = [size * axis for axis in axes.T[:_AXES] for size in _STEPS]
    return min((x + step for step in steps), key=penalised.value)


def _usual_weight(function: ConstrainedFunction, x: Array) -> float:
    """Return the weight at which the penalty at x is `_WEIGHT` times the cost there."""
    cost = function.value(x)
    return _WEIGHT * max(abs(cost), 1e-3) / (_Penalised(function, 1.0).value(x) - cost)


def _fall(
    penalised: _Penalised, x: Array, value: float, ground: Array, damping: float, most: float
) -> tuple[Array, float, float] | None:
    """Return a point with a lower value, that value, and the damping to go on with; None for none.

    The step -(M + λ M_0)⁻¹ g, with λ raised until it leads down.
    """
    gradient, metric = penalised.gradient(x), penalised.metric(x)
    while penalised.evaluations < most and damping < _STIFFEST:
        with np.errstate(over="ignore", invalid="ignore"):
            try:
                p = -np.linalg.solve(metric + damping * ground, gradient)
            except np.linalg.LinAlgError:
                # Next to singular poses derivatives are near the largest numbers.
                return None
            expected = -float(gradient @ p + 0.5 * p @ metric @ p)
        # Written so that NaN leads nowhere.
        if not expected > 0.0:
            return None
        there = penalised.value(x + p)
        ratio = (value - there) / expected
        if ratio > _TAKEN:
            factor = _SOFTER if ratio > _GOOD else _STIFFER if ratio < _POOR else 1.0
            return x + p, there, max(factor * damping, _SOFTEST)
        damping *= _STIFFER
    return None

"""The quadratic programme of a step: small, and answered whatever it asks."""

import numpy as np

from selfmotion.basics import Array
from selfmotion.optimise import minimize_quadratic

# How far coefficients may go in one cycle [rad/s √s].
_REACH = 1.0
# Programmes of a cycle: each has the rows that the one before broke.
_ROUNDS = 4
# What breaking a row by all of its range costs, next to a step's cost; the range of distances [m].
_BREAKING, _DISTANCES = 1e3, 0.1


def elastic_step(
    metric: Array, gradient: Array, rows: Array, low: Array, high: Array
) -> tuple[Array, bool]:
    """Return the step p of least cost that keeps low ≤ rows p ≤ high, found by the few that bind.

    The cost is ½ pᵀ metric p + gradientᵀ p. Where rows contradict each other, the step that breaks
    them little; and whether it does.

    Raises
    ------
    numpy.linalg.LinAlgError
        The numbers are beyond what can be solved with.
    """
    reach = np.full(len(gradient), _REACH)
    chosen = np.zeros(len(rows), dtype=bool)
    step = np.asarray(np.linalg.solve(metric, -gradient), dtype=np.float64)
    bounded = bool(np.all(np.abs(step) <= reach))
    for _ in range(_ROUNDS):
        if not bounded or chosen.any():
            some = rows[chosen], low[chosen], high[chosen]
            found = minimize_quadratic(metric, gradient, *some, reach)
            if found is None:
                return _elastic(metric, gradient, rows, low, high), True
            step, bounded = found[0], True
        value = rows @ step
        broken = (value < low) | (value > high)
        if not (broken & ~chosen).any():
            break
        chosen |= broken
    return step, False


def _elastic(metric: Array, gradient: Array, rows: Array, low: Array, high: Array) -> Array:
    """Return the step of least cost and least squares of what rows are broken by.

    Limits are the command's to keep: what counts here is that the motion gets better.
    """
    width = high - low
    scale = np.where(np.isfinite(width) & (width > 0.0), width, _DISTANCES)[:, None]
    weight = _BREAKING * np.trace(metric) / len(metric)
    step = np.zeros(len(metric))
    for _ in range(_ROUNDS):
        value = rows @ step
        broken = (value < low) | (value > high)
        near = np.clip(value, low, high)[broken]
        scaled = rows[broken] / scale[broken]
        wanted = scaled.T @ (near / scale[broken, 0])
        stiff = metric + weight * (scaled.T @ scaled)
        step = np.linalg.solve(stiff, weight * wanted - gradient)
    return np.asarray(step * min(1.0, _REACH / max(float(np.abs(step).max()), 1e-12)))

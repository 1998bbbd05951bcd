"""The quadratic programme of a step: its model, and an answer whatever it asks."""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array
from selfmotion.costs import Cost, Samples
from selfmotion.optimise import minimize_quadratic
from selfmotion.realtime.settings import BREAKING, DISTANCES, NODES_APART, REACH, ROUNDS


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
    reach = np.full(len(gradient), REACH)
    chosen = np.zeros(len(rows), dtype=bool)
    step = np.asarray(np.linalg.solve(metric, -gradient), dtype=np.float64)
    bounded = bool(np.all(np.abs(step) <= reach))
    for _ in range(ROUNDS):
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
    scale = np.where(np.isfinite(width) & (width > 0.0), width, DISTANCES)[:, None]
    weight = BREAKING * np.trace(metric) / len(metric)
    step = np.zeros(len(metric))
    for _ in range(ROUNDS):
        value = rows @ step
        broken = (value < low) | (value > high)
        near = np.clip(value, low, high)[broken]
        scaled = rows[broken] / scale[broken]
        wanted = scaled.T @ (near / scale[broken, 0])
        stiff = metric + weight * (scaled.T @ scaled)
        step = np.linalg.solve(stiff, weight * wanted - gradient)
    return np.asarray(step * min(1.0, REACH / max(float(np.abs(step).max()), 1e-12)))


def model_of(
    costs: Sequence[Cost],
    metrics: Sequence[tuple[int, Array]],
    guess: float,
    samples: Samples,
    by_q: Array,
    by_qd: Array,
) -> tuple[Array, Array]:
    """Return the gradient of the cost and its Gauss-Newton matrix, (d,) and (d, d).

    `metrics` are what costs tell of their curvature, order of the derivative and weight (n, n); a
    `guess` for the others is so many times that of the joints' speed. Tangents are (S, n, d).
    """
    d, sampling = by_q.shape[-1], samples.sampling
    weights = samples.weights[:, None]
    nodes = by_qd[sampling.nodes].reshape(len(sampling.nodes), -1)
    flat = {0: by_q.reshape(-1, d), 1: by_qd.reshape(-1, d)}

    def tangent(order: int) -> Array:
        if order not in flat:
            flat[order] = (sampling.differentiation(order - 1) @ nodes).reshape(-1, d)
        return flat[order]

    gradient, metric = np.zeros(d), np.zeros((d, d))
    for cost in costs:
        partials = cost.gradient(samples)
        parts = partials.q, partials.qd, partials.qdd, partials.qddd
        for order, part in enumerate(parts):
            if part is not None:
                gradient += (weights * part).ravel() @ tangent(order)
    for order, weight in (*metrics, *([(1, guess * np.eye(samples.q.shape[1]))] if guess else [])):
        one = tangent(order)
        heavy = weights[:, :, None] * (weight @ one.reshape(*samples.q.shape, d))
        metric += one.T @ heavy.reshape(-1, d)
    return gradient, metric


def graded(duration: float, steps: int) -> Array:
    """Return nodes from 0 to `duration` [s]: the first ones near each other, later ones farther.

    Even ones where there are enough for that. What comes next is commanded, what comes later is
    what it is to be good for.
    """
    s = np.linspace(0.0, 1.0, steps + 1)
    even = np.clip((NODES_APART / duration * steps**2 - 1.0) / (steps - 1.0), 0.0, 1.0)
    return np.asarray(duration * (even * s + (1.0 - even) * s * s))

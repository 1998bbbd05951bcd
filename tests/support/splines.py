"""The best spline within limits, by SciPy's SLSQP on the coefficients: it knows no nodes."""

import numpy as np
from scipy.optimize import minimize

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.motion import Grid
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.paper import Objective, node_tangents
from selfmotion.planning.rollout import MinimumNormMotion

# Conditions that come this near to being broken by x = 0 are asked for.
NEAR = -0.6


def best_spline(problem: sm.Problem, intervals: int = 16, steps: int = 64) -> float:
    """Return F of the best null motion of so many intervals that keeps its limits at all nodes."""
    problem = problem.changed(null_motion=sm.motion.BSplineNullMotion(intervals))
    formulation = Formulation.of(problem)
    start = problem.given_start
    assert start is not None
    minimum_norm = MinimumNormMotion.on(formulation, start, Grid.aligned(formulation.knots, steps))
    objective = Objective.of(formulation, minimum_norm)
    bound = formulation.conditions(minimum_norm.start, minimum_norm.end).every
    x0 = np.zeros(objective.size)
    near = [np.flatnonzero(item.residual(objective.samples(x0)).ravel() > NEAR) for item in bound]

    def kept(x: Array) -> Array:
        samples = objective.samples(x)
        rows = zip(bound, near, strict=True)
        return -np.concatenate([item.residual(samples).ravel()[own] for item, own in rows])

    def slopes(x: Array) -> Array:
        samples, motion = objective.samples(x), node_tangents(objective, x)
        rows = zip(bound, near, strict=True)
        tables = (
            item.tangents(samples, motion).reshape(-1, objective.size)[own] for item, own in rows
        )
        return -np.concatenate(list(tables))

    found = minimize(
        objective.value,
        x0,
        jac=objective.gradient,
        constraints=[{"type": "ineq", "fun": kept, "jac": slopes}],
        method="SLSQP",
        options={"ftol": 1e-9, "maxiter": 100},
    )
    assert kept(found.x).min() > -1e-6, found.message
    return float(found.fun)

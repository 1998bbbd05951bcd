"""A function of the user's as a cost."""

import dataclasses

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array


@pytest.fixture(scope="module")
def sample() -> sm.Plan:
    return sm.plan(sm.sample_problem())


def test_user_function_equals_the_built_in_cost(sample: sm.Plan) -> None:
    def half_square(qd: Array, q: Array, t: Array) -> Array:
        return 0.5 * (qd**2).sum(axis=1)

    exact = sm.costs.FunctionCost(half_square, lambda qd, q, t: (qd, np.zeros_like(q)), name="mine")
    problem = sm.sample_problem()
    for cost in (exact, sm.costs.FunctionCost(half_square)):
        costs = [cost, sm.costs.InverseManipulability()]
        plan = sm.plan(dataclasses.replace(problem, costs=costs))
        assert plan.report.cost == pytest.approx(sample.report.cost, rel=1e-8)


def test_user_functions_of_the_wrong_shape_are_named() -> None:
    problem = sm.sample_problem()
    wrong = sm.costs.FunctionCost(lambda qd, q, t: qd, name="mine")
    with pytest.raises(sm.errors.ProblemError, match="cost 'mine' returned shape"):
        sm.plan(dataclasses.replace(problem, costs=[wrong]))
    half = sm.costs.FunctionCost(lambda qd, q, t: t, lambda qd, q, t: (qd, t), name="mine")
    with pytest.raises(sm.errors.ProblemError, match="cost 'mine': its gradient has shape"):
        sm.plan(dataclasses.replace(problem, costs=[half]))

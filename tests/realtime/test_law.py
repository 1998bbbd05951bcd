"""Rates of one cycle: eq. 4 within limits."""

import numpy as np
import pytest
from scipy.optimize import linprog

import selfmotion as sm
from selfmotion.realtime.law import saturated_rates
from selfmotion.realtime.viable import (
    viable_box,
)
from support.arms import PANDA_HOME

# Segments meet in the same numbers, computed in the same way but for one shift of an index.
SAME = 1e-12


def test_rates_are_those_of_eq_4_where_no_bound_is_in_the_way(panda: sm.RobotModel) -> None:
    rng = np.random.default_rng(1)
    for task in ("pose", "position"):
        jacobian = panda.task_jacobian(PANDA_HOME, task)
        u, epsilon = rng.standard_normal(len(jacobian)), rng.standard_normal(7)
        rates, wide = np.empty(7), np.full(7, 1e3)
        assert saturated_rates(jacobian, u, epsilon, -wide, wide, rates)
        inverse = np.linalg.pinv(jacobian)
        expected = inverse @ u + (np.eye(7) - inverse @ jacobian) @ epsilon
        assert rates == pytest.approx(expected, abs=1e-9)


def test_the_self_motion_gives_before_the_tool_does(panda: sm.RobotModel) -> None:
    rng = np.random.default_rng(2)
    jacobian = np.ascontiguousarray(panda.task_jacobian(PANDA_HOME, "position"))
    followed = possible = 0
    for _ in range(200):
        u, epsilon = 0.3 * rng.standard_normal(3), 3.0 * rng.standard_normal(7)
        rates, bound = np.empty(7), rng.uniform(0.3, 1.5, 7)
        follows = saturated_rates(jacobian, u, epsilon, -bound, bound, rates)
        assert np.all(np.abs(rates) <= bound + SAME)
        programme = linprog(
            np.zeros(7), A_eq=jacobian, b_eq=u, bounds=np.stack([-bound, bound], axis=1)
        )
        possible += programme.status == 0
        if follows:
            followed += 1
            assert jacobian @ rates == pytest.approx(u, abs=2e-3)
    # One joint after the other is no search over all sets of joints: a few are not found.
    assert possible > 100
    assert followed >= 0.97 * possible


def test_a_box_without_any_acceleration_to_choose_is_no_trouble() -> None:
    low, high = np.empty(1), np.empty(1)
    limits = np.array([[-1.0], [1.0], [1.0], [5.0]])
    viable_box(np.array([1.0]), np.array([0.0]), limits, 1e-3, low, high)
    assert low[0] <= high[0] <= 0.0

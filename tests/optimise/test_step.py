"""Steps: the best of their model, and as near as possible where conditions contradict."""

import numpy as np
import pytest
from scipy.optimize import linprog, minimize

from selfmotion.basics import Array
from selfmotion.optimise import Residuals
from selfmotion.optimise.quadratic import minimize_quadratic
from selfmotion.optimise.rows import DenseRows
from selfmotion.optimise.step import AIM, best_step


def residuals(h: list[float], tolerance: float = 1.0, equalities: int = 0) -> Residuals:
    count = len(h)
    return Residuals(np.array(h), np.full(count, tolerance), np.arange(count) >= count - equalities)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_conditions_out_of_reach_are_brought_as_near_as_a_tenth_more_than_possible(
    sign: float,
) -> None:
    """An equality on either side: of 10, a region of 1 takes out 1; nine tenths of it are taken."""
    at, rows = residuals([sign * 10.0], equalities=1), np.array([[1.0, 0.0]])
    step = best_step(np.zeros(2), np.eye(2), at, DenseRows(rows), 1.0)
    assert step.relaxed
    assert step.worst == pytest.approx(9.1, abs=0.01)
    np.testing.assert_allclose(step.p, [-sign * 0.9, 0.0], atol=0.01)
    assert step.gain == pytest.approx(-0.5 * step.p @ step.p)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_is_out_of_reach_is_weighed_in_tolerances(sign: float) -> None:
    """Least is 9, of 50: a tenth of the way between is left, which the strict condition takes."""
    at = Residuals(np.array([0.5, -10.0 * sign]), np.array([0.01, 1.0]), np.array([False, True]))
    rows = np.array([[-sign, 0.0], [1.0, 0.0]])
    step = best_step(np.zeros(2), np.eye(2), at, DenseRows(rows), 1.0)
    assert step.relaxed
    assert step.worst == pytest.approx(9.0 + 0.1 * 41.0, abs=0.05)


def test_an_inequality_out_of_reach_is_relaxed_alone() -> None:
    at, rows = residuals([10.0, -0.5]), np.array([[1.0, 0.0], [0.0, 1.0]])
    step = best_step(np.array([0.0, -10.0]), np.eye(2), at, DenseRows(rows), 1.0)
    assert step.relaxed
    assert step.worst == pytest.approx(9.1, abs=0.01)
    # The other one may use what the first one has to be given.
    assert step.p[1] == pytest.approx(1.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_equalities_that_repeat_each_other_do_not_contradict(sign: float) -> None:
    """Met to a thousandth of their tolerance, as two rows of one condition may need."""
    rows = np.array([[1.0, 0.0], [1.0, 0.0]])
    for apart, relaxed in ((1.8e-3, False), (2.2e-3, True)):
        at = residuals([sign * 0.3, sign * (0.3 + apart)], equalities=2)
        assert best_step(np.zeros(2), np.eye(2), at, DenseRows(rows), 5.0).relaxed is relaxed


def test_inequalities_are_met_within_the_share_that_is_aimed_at() -> None:
    at, rows = residuals([-1.0, -50.0], 0.1), np.array([[1.0, 0.0], [0.0, 1.0]])
    step = best_step(np.array([-3.0, -4.0]), np.eye(2), at, DenseRows(rows), 20.0)
    np.testing.assert_allclose(step.p, [1.0 + AIM * 0.1, 4.0])
    np.testing.assert_allclose(step.multipliers, [3.0 - step.p[0], 0.0], atol=1e-9)
    assert step.gain == pytest.approx(3.0 * step.p[0] + 16.0 - 0.5 * (step.p[0] ** 2 + 16.0))
    assert step.worst == pytest.approx(AIM)
    assert not step.relaxed


def test_a_step_of_nothing_tells_what_is_violated() -> None:
    none = DenseRows(np.zeros((2, 0)))
    for h, relaxed in (([0.5, -3.0], False), ([1.5, -3.0], True)):
        step = best_step(np.zeros(0), np.zeros((0, 0)), residuals(h), none, 1.0)
        assert step.worst == max(h)
        assert step.relaxed is relaxed
        assert (step.gain, len(step.p), step.multipliers.tolist()) == (0.0, 0, [0.0, 0.0])


@pytest.mark.parametrize("region", [0.3, 3.0])
@pytest.mark.parametrize("seed", range(20))
def test_steps_are_those_of_all_conditions(seed: int, region: float) -> None:
    """Though programmes are solved with those alone that some step would violate."""
    rng = np.random.default_rng(seed)
    rows, h = rng.normal(size=(300, 5)), -rng.uniform(0.0, 2.0, 300)
    at = residuals(list(h), 1e-3)
    gradient = 3.0 * rng.normal(size=5)
    step = best_step(gradient, np.eye(5), at, DenseRows(rows), region)
    reach, upper = np.full(5, region), -h + AIM * 1e-3
    everything = minimize_quadratic(np.eye(5), gradient, rows, np.full(300, -np.inf), upper, reach)
    assert everything is not None
    assert not step.relaxed
    # A condition may be left out that is violated by a thousandth of its tolerance.
    np.testing.assert_allclose(step.p, everything[0], atol=1e-5)
    np.testing.assert_allclose(step.multipliers, everything[1], atol=1e-4)
    assert step.worst == pytest.approx(np.max((h + rows @ step.p) / 1e-3), rel=1e-9)


@pytest.mark.parametrize("seed", range(10))
def test_violations_that_are_left_are_those_of_all_conditions(seed: int) -> None:
    """Of half-spaces that share no point: the least violation, by linear programming."""
    rng = np.random.default_rng(seed)
    rows, h = rng.normal(size=(200, 3)), rng.uniform(-1.0, 1.0, 200)
    at = residuals(list(h), 1e-2)
    step = best_step(np.zeros(3), np.eye(3), at, DenseRows(rows), 2.0)
    answer = linprog(
        [0.0, 0.0, 0.0, 1.0],
        A_ub=np.column_stack([rows, np.full(200, -1e-2)]),
        b_ub=-h,
        bounds=[(-2.0, 2.0)] * 3 + [(None, None)],
    )
    least, before = answer.fun, at.worst
    assert step.relaxed
    assert step.worst <= least + 0.1 * (before - least) + 0.002 * before
    assert step.worst >= least * (1.0 - 1e-6)


@pytest.mark.parametrize("seed", range(40))
def test_the_step_is_the_best_of_its_model(seed: int) -> None:
    """Against SLSQP, within the trust region."""
    rng = np.random.default_rng(seed)
    size, count = 4, 6
    factor = rng.normal(size=(size, size))
    hessian, gradient = factor @ factor.T + 0.1 * np.eye(size), rng.normal(size=size)
    rows, upper = rng.normal(size=(count, size)), rng.uniform(-0.1, 1.0, count)
    region = 1.5
    found = minimize_quadratic(
        hessian, gradient, rows, np.full(count, -np.inf), upper, np.full(size, region)
    )

    def model(p: Array) -> float:
        return float(gradient @ p + 0.5 * p @ hessian @ p)

    answer = minimize(
        model,
        np.zeros(size),
        jac=lambda p: gradient + hessian @ p,
        bounds=[(-region, region)] * size,
        constraints=[{"type": "ineq", "fun": lambda p: upper - rows @ p, "jac": lambda p: -rows}],
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 300},
    )
    assert answer.status in (0, 8)
    assert found is not None
    p, prices = found
    assert model(p) == pytest.approx(answer.fun, abs=1e-8)
    assert np.all(prices >= -1e-10)
    assert np.all(rows @ p <= upper + 1e-9)
    inside = np.abs(p) < region - 1e-9
    np.testing.assert_allclose((hessian @ p + gradient + rows.T @ prices)[inside], 0.0, atol=1e-8)


def test_contradictory_rows_have_no_answer() -> None:
    rows = np.array([[1.0, 0.0], [-1.0, 0.0]])
    upper = np.array([-1.0, -1.0])
    lower, reach = np.full(2, -np.inf), np.full(2, np.inf)
    assert minimize_quadratic(np.eye(2), np.ones(2), rows, lower, upper, reach) is None


@pytest.mark.parametrize(("share", "expected"), [(1.0, 0.0), (3.0, 0.5)])
def test_contradictions_are_relaxed_in_proportion_to_tolerances(
    share: float, expected: float
) -> None:
    """x ≤ -1 and x ≥ 1: the least violation is in the middle, or nearer to the stricter one."""
    at = Residuals(np.array([1.0, 1.0]), np.array([share, 1.0]) * 1e-3, np.zeros(2, bool))
    rows = np.array([[1.0, 0.0], [-1.0, 0.0]])
    step = best_step(np.zeros(2), np.eye(2), at, DenseRows(rows), 10.0)
    assert step.relaxed
    least = 2.0 / (1e-3 * (1.0 + share))
    # A tenth of what the relaxation takes out is left to the cost.
    assert least * (1.0 - 1e-3) <= step.worst <= least + 0.11 * abs(1000.0 - least) + 1e-6
    if share != 1.0:
        assert step.p[0] == pytest.approx(expected, abs=0.1)

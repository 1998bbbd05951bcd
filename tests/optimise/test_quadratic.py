"""Small quadratic programmes: the best of their model, and none where rows contradict."""

import numpy as np
import pytest
from scipy.optimize import minimize

from selfmotion.basics import Array
from selfmotion.planning.optimise import minimize_quadratic


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
    p, multipliers = found
    assert model(p) == pytest.approx(answer.fun, abs=1e-8)
    assert np.all(multipliers >= -1e-10)
    assert np.all(rows @ p <= upper + 1e-9)
    inside = np.abs(p) < region - 1e-9
    np.testing.assert_allclose(
        (hessian @ p + gradient + rows.T @ multipliers)[inside], 0.0, atol=1e-8
    )


def test_contradictory_rows_have_no_answer() -> None:
    rows = np.array([[1.0, 0.0], [-1.0, 0.0]])
    upper = np.array([-1.0, -1.0])
    lower, reach = np.full(2, -np.inf), np.full(2, np.inf)
    assert minimize_quadratic(np.eye(2), np.ones(2), rows, lower, upper, reach) is None


def test_rows_of_zeros_hold_or_contradict() -> None:
    """They are not scaled."""
    hessian, gradient, reach = np.eye(2), np.array([1.0, -2.0]), np.full(2, np.inf)
    for upper, holds in ((0.5, True), (-0.5, False)):
        found = minimize_quadratic(
            hessian, gradient, np.zeros((1, 2)), np.array([-1.0]), np.array([upper]), reach
        )
        assert (found is not None) is holds
        if found is not None:
            np.testing.assert_allclose(found[0], -gradient, atol=1e-9)
            np.testing.assert_allclose(found[1], 0.0)

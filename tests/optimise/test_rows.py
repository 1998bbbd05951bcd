"""Rows of conditions in other variables."""

import numpy as np

from selfmotion.optimise import Residuals
from selfmotion.optimise.quadratic import minimize_quadratic
from selfmotion.optimise.rows import DenseRows, ScaledRows, pulled_back

X, STEP = np.array([1.0, -2.0]), np.array([0.5, 0.25])


def residuals(h: list[float], tolerance: float = 1.0, equalities: int = 0) -> Residuals:
    count = len(h)
    return Residuals(np.array(h), np.full(count, tolerance), np.arange(count) >= count - equalities)


def test_rows_of_any_size_are_kept() -> None:
    """Scaled by their largest entry, but for rows of nothing; and multipliers go with rows."""
    for size in (1e-90, 1e-6, 1.0, 1e6):
        rows = size * np.array([[1.0, 1.0], [0.0, 0.0]])
        upper = np.array([size, 1.0])
        found = minimize_quadratic(
            np.eye(2), -2.0 * np.ones(2), rows, np.full(2, -np.inf), upper, np.full(2, np.inf)
        )
        assert found is not None
        np.testing.assert_allclose(found[0], 0.5)
        np.testing.assert_allclose(found[1] * size, [1.5, 0.0])
    rows = np.array([[0.0, 0.0]])
    lower, upper = np.array([1.0]), np.array([2.0])
    assert minimize_quadratic(np.eye(2), X, rows, lower, upper, np.ones(2)) is None


def test_a_residual_is_measured_in_its_tolerance() -> None:
    at = Residuals(
        np.array([-4.0, 3.0, -2.0]), np.array([1.0, 2.0, 0.5]), np.array([False, False, True])
    )
    np.testing.assert_array_equal(at.excess, [-4.0, 1.5, 4.0])
    assert at.worst == 4.0
    assert residuals([-1.0]).worst == 0.0
    assert residuals([]).worst == 0.0


def test_rows_of_other_variables_are_those_by_the_chain_rule() -> None:
    rng = np.random.default_rng(0)
    table, scale = rng.normal(size=(6, 4)), rng.normal(size=(4, 3))
    rows = ScaledRows(DenseRows(table), scale)
    p, weights = rng.normal(size=3), np.array([0.0, 2.0, 0.0, -1.0, 0.0, 0.5])
    np.testing.assert_allclose(rows.along(p), table @ scale @ p, rtol=1e-12)
    np.testing.assert_allclose(rows.picked(np.array([4, 1])), (table @ scale)[[4, 1]], rtol=1e-12)
    np.testing.assert_allclose(pulled_back(rows, weights), weights @ table @ scale, rtol=1e-12)

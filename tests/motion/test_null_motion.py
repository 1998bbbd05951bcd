"""Null motions: tables, windows, bases carried along."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.motion import resting_window
from selfmotion.motion.null_motion import NullMotionTable, PolynomialNullMotion

# Products of well-conditioned matrices with entries of order 1.
ALGEBRA = 1e-10


def test_null_motion_table_and_its_transpose() -> None:
    """⟨ε(x), w⟩ = ⟨x, pullback(w)⟩ and ε(x) = matrix · x, for both spaces."""
    rng = np.random.default_rng(12)
    for frame, rows in ((None, 4), (rng.normal(size=(9, 4, 2)), 2)):
        table = NullMotionTable(rng.normal(size=(9, 3)), frame, rows)
        x, w = rng.normal(size=table.size), rng.normal(size=(9, 4))
        assert (table.epsilon(x) * w).sum() == pytest.approx(x @ table.pullback(w))
        np.testing.assert_allclose(table.matrix() @ x, table.epsilon(x), atol=1e-12)


def test_paper_parameterisation_has_the_papers_order() -> None:
    """Eq. 6 to 8: x = [e_00 … e_0p e_10 …], ε_i(t) = Σ_k e_ik t^k."""
    motion = PolynomialNullMotion(3, "joint", "monomial")
    t = np.array([0.0, 0.5, 2.0])
    table = NullMotionTable(motion.functions(t, 2.0), None, 3)
    e = np.arange(12.0).reshape(3, 4)
    expected = np.array([[sum(e[i, k] * s**k for k in range(4)) for i in range(3)] for s in t])
    np.testing.assert_allclose(table.epsilon(e.ravel()), expected)


def test_b_spline_functions_are_a_partition_of_unity_with_local_support() -> None:
    motion = sm.BSplineNullMotion(intervals=6, degree=3)
    t = np.linspace(0, 2.5, 61)
    functions = motion.functions(t, 2.5)
    assert functions.shape == (61, 9)
    np.testing.assert_allclose(functions.sum(axis=1), 1.0, atol=1e-12)
    assert (functions != 0).sum(axis=1).max() == 4
    assert sm.BSplineNullMotion(1, 0).functions(t, 2.5).shape == (61, 1)
    with pytest.raises(sm.ProblemError, match="intervals is 0"):
        sm.BSplineNullMotion(0)


def test_legendre_functions_are_orthonormal_over_the_motion() -> None:
    nodes, weights = np.polynomial.legendre.leggauss(12)
    duration = 2.5
    functions = PolynomialNullMotion(6).functions(0.5 * duration * (nodes + 1), duration)
    gram = functions.T @ (0.5 * duration * weights[:, None] * functions)
    np.testing.assert_allclose(gram, np.eye(7), atol=1e-12)


@pytest.mark.parametrize("degree", [-1, 1.5])
def test_bad_null_motions_are_refused(degree: object) -> None:
    with pytest.raises(sm.ProblemError, match="degree"):
        sm.PolynomialNullMotion(degree)
    with pytest.raises(sm.ProblemError, match="space"):
        sm.PolynomialNullMotion(space="task")
    with pytest.raises(sm.ProblemError, match="basis"):
        sm.PolynomialNullMotion(basis="fourier")


@pytest.mark.parametrize("orders", [(0, 0), (1, 0), (0, 2), (1, 1), (2, 2)])
def test_the_window_vanishes_to_its_orders_and_is_at_most_1(orders: tuple[int, int]) -> None:
    t, h = np.linspace(0.0, 3.0, 2001), 1e-6
    window = resting_window(t, 3.0, orders)
    assert 0.9999 < window.max() <= 1.0 + 1e-12
    for order, near in zip(orders, (np.array([h, 2 * h]), 3.0 - np.array([h, 2 * h])), strict=True):
        one, two = resting_window(near, 3.0, orders)
        # Twice as far from an end, s^a is 2^a times as much.
        assert two / one == pytest.approx(2.0**order, rel=1e-5)

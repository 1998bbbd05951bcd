"""Null motions: what they are functions of, and bad ones."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.model.motion import NullMotionTable, PolynomialNullMotion


def test_paper_parameterisation_has_the_papers_order() -> None:
    """Eq. 6 to 8: x = [e_00 … e_0p e_10 …], ε_i(t) = Σ_k e_ik t^k."""
    motion = PolynomialNullMotion(3, "joint", "monomial")
    t = np.array([0.0, 0.5, 2.0])
    table = NullMotionTable(motion.functions(t, 2.0), None, 3)
    e = np.arange(12.0).reshape(3, 4)
    expected = np.array([[sum(e[i, k] * s**k for k in range(4)) for i in range(3)] for s in t])
    np.testing.assert_allclose(table.epsilon(e.ravel()), expected)


def test_b_spline_functions_are_a_partition_of_unity_with_local_support() -> None:
    motion = sm.motion.BSplineNullMotion(intervals=6, degree=3)
    t = np.linspace(0, 2.5, 61)
    functions = motion.functions(t, 2.5)
    assert functions.shape == (61, 9)
    np.testing.assert_allclose(functions.sum(axis=1), 1.0, atol=1e-12)
    assert (functions != 0).sum(axis=1).max() == 4
    assert sm.motion.BSplineNullMotion(1, 0).functions(t, 2.5).shape == (61, 1)
    with pytest.raises(sm.errors.ProblemError, match="intervals is 0"):
        sm.motion.BSplineNullMotion(0)


def test_legendre_functions_are_orthonormal_over_the_motion() -> None:
    nodes, weights = np.polynomial.legendre.leggauss(12)
    duration = 2.5
    functions = PolynomialNullMotion(6).functions(0.5 * duration * (nodes + 1), duration)
    gram = functions.T @ (0.5 * duration * weights[:, None] * functions)
    np.testing.assert_allclose(gram, np.eye(7), atol=1e-12)


@pytest.mark.parametrize("degree", [-1, 1.5])
def test_bad_null_motions_are_refused(degree: object) -> None:
    with pytest.raises(sm.errors.ProblemError, match="degree"):
        sm.PolynomialNullMotion(degree)
    with pytest.raises(sm.errors.ProblemError, match="space"):
        sm.PolynomialNullMotion(space="task")
    with pytest.raises(sm.errors.ProblemError, match="basis"):
        sm.PolynomialNullMotion(basis="fourier")

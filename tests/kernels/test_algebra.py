"""Small dense algebra, against NumPy's."""

import numpy as np
import pytest

from selfmotion.basics import Array
from selfmotion.model.kernels import algebra
from support.compiled import compiled

# Well-conditioned algebra with entries of order 1.
ALGEBRA = 1e-12


SIZES = range(1, 7)


gram, cholesky = compiled(algebra.gram), compiled(algebra.cholesky)


solve_cholesky, respond = compiled(algebra.solve_cholesky), compiled(algebra.respond)


smallest_eigenvector = compiled(algebra.smallest_eigenvector)


def positive(rng: np.random.Generator, m: int) -> Array:
    root = rng.normal(size=(m, m + 2))
    return np.asarray(root @ root.T)


@pytest.mark.parametrize("m", SIZES)
def test_cholesky_factor_and_its_solutions(m: int) -> None:
    rng = np.random.default_rng(m)
    a, b = positive(rng, m), rng.normal(size=m)
    factor, solution = np.tril(a), b.copy()
    assert cholesky(factor)
    lower = np.tril(factor, -1) + np.diag(1.0 / np.diag(factor))
    np.testing.assert_allclose(lower @ lower.T, a, atol=ALGEBRA * np.abs(a).max())
    solve_cholesky(factor, solution)
    np.testing.assert_allclose(a @ solution, b, atol=ALGEBRA * np.linalg.cond(a))


@pytest.mark.parametrize("m", SIZES)
def test_cholesky_refuses_what_is_not_positive(m: int) -> None:
    """Also where rounding alone makes it so."""
    rng = np.random.default_rng(m)
    for _ in range(50):
        rows = np.linalg.qr(rng.normal(size=(8, m - 1)))[0].T
        rows = np.vstack([rows, rng.normal(size=m - 1) @ rows])
        assert not cholesky(rows @ rows.T)
    assert not cholesky(-positive(rng, m))
    broken = positive(rng, m)
    broken[m - 1, 0] = np.nan
    assert not cholesky(broken)


@pytest.mark.parametrize("m", SIZES)
def test_gram_and_the_solution_of_equation_4(m: int) -> None:
    rng = np.random.default_rng(m)
    jacobian, u, epsilon = rng.normal(size=(m, 8)), rng.normal(size=m), rng.normal(size=8)
    factor, y, qd = np.zeros((m, m)), u.copy(), np.empty(8)
    gram(jacobian, factor)
    np.testing.assert_allclose(factor, np.tril(jacobian @ jacobian.T), atol=ALGEBRA)
    assert cholesky(factor)
    respond(jacobian, factor, y, epsilon, qd)
    inverse = np.linalg.pinv(jacobian)
    expected = inverse @ u + epsilon - inverse @ (jacobian @ epsilon)
    np.testing.assert_allclose(qd, expected, atol=ALGEBRA * np.linalg.cond(jacobian) ** 2)


@pytest.mark.parametrize("m", SIZES)
@pytest.mark.parametrize("equal", [1, 2, 6])
def test_smallest_eigenvector(m: int, equal: int) -> None:
    """Also of matrices whose smallest eigenvalues are equal, or all of them."""
    rng = np.random.default_rng(m)
    basis = np.linalg.qr(rng.normal(size=(m, m)))[0]
    values = np.sort(rng.uniform(0.1, 2.0, m))
    values[:equal] = values[0]
    a = (basis * values) @ basis.T
    vector = np.empty(m)
    value = smallest_eigenvector(a.copy(), np.empty((m, m)), vector)
    assert value == pytest.approx(values[0], abs=ALGEBRA)
    assert np.linalg.norm(vector) == pytest.approx(1.0, abs=ALGEBRA)
    np.testing.assert_allclose(a @ vector, value * vector, atol=ALGEBRA)


def test_determinants_are_those_of_numpy() -> None:
    rng = np.random.default_rng(4)
    jacobians = rng.normal(size=(6, 3, 5))
    jacobians[4, 2] = jacobians[4, 0] + jacobians[4, 1]
    jacobians[5, 0, 0] = np.nan
    found = algebra.gram_determinants(jacobians)
    expected = np.linalg.det(jacobians[:4] @ np.swapaxes(jacobians[:4], 1, 2))
    np.testing.assert_allclose(found[:4], expected, rtol=1e-10)
    assert found[4] == 0.0
    assert np.isnan(found[5])

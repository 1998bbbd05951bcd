"""Series of known functions are what they are known to be, coefficient by coefficient."""

from math import comb, factorial

import numpy as np
import pytest

from selfmotion.basics import Array, series

LENGTH = series.LENGTH
# Two intervals, so that none is taken for the other.
RATES = np.array([0.3, 1.7])


def powers(rate: Array) -> Array:
    """The series of exp(rate · u) about 0, but for its size: rateᵏ / k!."""
    return np.array([rate**k / factorial(k) for k in range(LENGTH)])


def test_a_product_has_the_coefficients_of_the_product() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.random((LENGTH, 2)), rng.random((LENGTH - 3, 2))
    found = series.product(a, b)
    assert found.shape == (LENGTH - 3, 2)
    for k in range(2):
        np.testing.assert_allclose(found[:, k], np.convolve(a[:, k], b[:, k])[: LENGTH - 3])


def test_a_constant_is_nothing_but_its_value() -> None:
    found = series.constant([2.0, 3.0], np.ones((4, 2)))
    np.testing.assert_array_equal(found, [[2.0, 3.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]])


def test_an_exponential_is_that_of_what_changes() -> None:
    line = np.zeros((LENGTH, 2))
    line[0], line[1] = 5.0, RATES
    np.testing.assert_allclose(series.exponential(line), powers(RATES), rtol=1e-14)
    # exp(a + b) = exp(a) exp(b).
    rng = np.random.default_rng(1)
    a, b = rng.random((2, LENGTH, 2))
    both = series.product(series.exponential(a), series.exponential(b))
    np.testing.assert_allclose(series.exponential(a + b), both, rtol=1e-12)


def test_a_composition_is_that_of_polynomials() -> None:
    """(1 + x)³ at x = a u + b u² has the coefficients that multiplying out gives."""
    outer = np.array([[1.0, 1.0], [3.0, 3.0], [3.0, 3.0], [1.0, 1.0]])
    inner = np.zeros((LENGTH, 2))
    # What the inner one is in the middle is no part of it.
    inner[0], inner[1], inner[2] = 7.0, RATES, 0.5
    found = series.composed(outer, inner)
    for k, rate in enumerate(RATES):
        exact = np.polynomial.Polynomial([1.0, rate, 0.5]) ** 3
        np.testing.assert_allclose(found[: len(exact.coef), k], exact.coef, rtol=1e-13)
        assert np.all(found[len(exact.coef) :, k] == 0.0)
    # Of fewer terms those are the same, however many there are outside.
    for few in range(1, 6):
        np.testing.assert_array_equal(series.composed(outer, inner[:few]), found[:few])


def test_a_root_and_a_logarithm_are_those_of_taylor() -> None:
    """Of √x the derivatives at the least x, and its size at the largest; of -log(1 - u) 1/k."""
    low, high = np.array([0.5, 2.0]), np.array([4.0, 9.0])
    found = series.root(low, high, 6)
    np.testing.assert_allclose(found[0], [2.0, 3.0])
    for k in range(1, 6):
        # |d^k √x / dx^k| / k! = |binomial(1/2, k)| x^(1/2 - k).
        binomial = np.prod([(0.5 - j) / (j + 1.0) for j in range(k)])
        np.testing.assert_allclose(found[k], abs(binomial) * low ** (0.5 - k), rtol=1e-14)
    line = np.zeros((LENGTH, 2))
    line[0], line[1] = 3.0, RATES
    logarithm = series.logarithm(line)
    assert np.all(logarithm[0] == 0.0)
    for k in range(1, LENGTH):
        np.testing.assert_allclose(logarithm[k], RATES**k / k, rtol=1e-13)


def test_a_derivative_is_per_second() -> None:
    half = np.array([0.1, 2.0])
    found = series.derivative(powers(RATES), half)
    assert found.shape == (LENGTH - 1, 2)
    np.testing.assert_allclose(found, (powers(RATES) * RATES / half)[:-1], rtol=1e-13)
    np.testing.assert_allclose(series.after_first(powers(RATES)), np.exp(RATES) - 1.0, rtol=1e-9)


def test_polynomials_are_bounded_at_the_end_of_their_interval() -> None:
    """Σ C(j, k) |c_j|: with coefficients of one sign the derivatives at 1 themselves."""
    coefficients = np.array([[1.0, -1.0], [2.0, -2.0], [0.5, -0.5], [3.0, -3.0]])
    found = series.of_polynomial(coefficients)
    assert found.shape == (LENGTH, 2)
    for k in range(LENGTH):
        exact = sum(comb(j, k) * abs(coefficients[j, 0]) for j in range(4))
        np.testing.assert_allclose(found[k], exact)
    vectors = np.array([[[3.0, 4.0, 0.0]], [[0.0, 0.0, 2.0]]])
    np.testing.assert_allclose(series.of_vectors(vectors)[:3, 0], [7.0, 2.0, 0.0])


@pytest.mark.parametrize("shape", [(), (3,)])
def test_pieces_are_seen_from_the_middle_of_intervals(shape: tuple[int, ...]) -> None:
    rng = np.random.default_rng(2)
    breaks, coefficients = np.array([0.0, 1.0, 3.0]), rng.normal(size=(4, 2, *shape))
    middle, half = np.array([0.4, 1.0, 2.2, 3.0]), np.array([0.3, 0.1, 0.5, 0.1])
    found = series.of_pieces(breaks, coefficients, middle, half)
    for interval, piece in enumerate((0, 1, 1, 1)):
        for u in (-1.0, 0.3, 1.0):
            x = middle[interval] + half[interval] * u - breaks[piece]
            exact = sum(coefficients[j, piece] * x**j for j in range(4))
            taken = sum(found[j, interval] * u**j for j in range(4))
            np.testing.assert_allclose(taken, exact, rtol=1e-12)


def test_a_series_holds_for_the_methods_that_it_was_written_for() -> None:
    class Ours:
        def value(self) -> float:
            return 1.0

        def series(self) -> float:
            return 1.0

    class Named(Ours):
        name = "named"

    class Moved(Ours):
        def value(self) -> float:
            return 2.0

    class Told(Moved):
        def series(self) -> float:
            return 2.0

    known = [series.holds_for(kind(), "value") for kind in (Ours, Named, Moved, Told)]
    assert known == [True, True, False, True]


def test_chebyshev_polynomials_are_bounded_at_1() -> None:
    """Of T_j all derivatives are largest there; a share of the interval scales each order."""
    share = np.array([1.0, 0.25])
    for degree in range(6):
        coefficients = np.zeros((6, 2, 3))
        coefficients[degree] = [0.0, 3.0, 4.0]
        found = series.of_chebyshev(coefficients, share)
        taken = np.polynomial.Chebyshev.basis(degree)
        for k in range(LENGTH):
            exact = 5.0 * (taken.deriv(k)(1.0) if k else 1.0) / factorial(k) * share**k
            np.testing.assert_allclose(found[k], exact, rtol=1e-12, atol=1e-15)

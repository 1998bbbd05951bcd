"""Damping and its derivative."""

import numpy as np
import pytest

from selfmotion.basics import Array
from selfmotion.kernels import stages, tool
from support.compiled import compiled

# Well-conditioned algebra with entries of order 1.
ALGEBRA = 1e-12


# Exact derivatives against central differences, relative to the largest entry.
GRADIENT = 1e-6


SIZES = range(1, 7)


contract, damp = compiled(tool.contract), compiled(stages.damp)


@pytest.mark.parametrize("m", SIZES)
def test_damping_and_its_derivative(m: int) -> None:
    """λ² and 1 - f by NumPy's singular values; df by differences of JJᵀ through v."""
    rng = np.random.default_rng(m)
    jacobian, strength = rng.normal(size=(m, 8)), 0.3
    sigma = np.linalg.svd(jacobian, compute_uv=False)[-1]
    law = (1.5 * sigma, strength)

    def fade(jacobian: Array) -> float:
        sigma = np.linalg.svd(jacobian, compute_uv=False)[-1]
        return float((1.0 - (sigma / law[0]) ** 2) ** 2)

    square = np.tril(jacobian @ jacobian.T)
    damped, out = square.copy(), np.empty(3 + m)
    assert damp(damped, law, out) == pytest.approx(1.0 - fade(jacobian), abs=ALGEBRA)
    expected = square + strength**2 * fade(jacobian) * np.eye(m)
    np.testing.assert_allclose(damped, expected, atol=ALGEBRA * square.max())
    assert out[0] == strength**2
    assert out[1] == pytest.approx(fade(jacobian), abs=ALGEBRA)
    change = rng.normal(size=(m, 8))
    slope = (fade(jacobian + 1e-6 * change) - fade(jacobian - 1e-6 * change)) / 2e-6
    found = out[2] * 2.0 * (out[3:] @ change) @ (jacobian.T @ out[3:])
    assert found == pytest.approx(slope, rel=GRADIENT, abs=GRADIENT)


def test_no_damping_beyond_the_threshold_nor_of_nan() -> None:
    jacobian = np.random.default_rng(9).normal(size=(6, 8))
    square = np.tril(jacobian @ jacobian.T)
    sigma = np.linalg.svd(jacobian, compute_uv=False)[-1]
    for scale, broken in ((0.999, False), (1e3, True)):
        given, out = square.copy(), np.ones(9)
        if broken:
            given[3] = np.nan
        before = given.copy()
        assert damp(given, (scale * sigma, 0.3), out) == 1.0
        np.testing.assert_array_equal(given, before)
        np.testing.assert_array_equal(out, 0.0)

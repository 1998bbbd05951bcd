"""Polynomials are known from their points."""

import numpy as np
import pytest

from selfmotion.certificate.interpolation import stencil

ROUNDING = 1e-12


@pytest.mark.parametrize("count", [5, 9])
def test_polynomials_are_known_from_their_points(count: int) -> None:
    """Of as high a degree as the points determine, and of no higher one."""
    shares, predict, between, dense = stencil(count)
    assert (between[0], between[-1], len(between)) == (0.0, 1.0, 33)
    np.testing.assert_allclose(np.diff(between), 1.0 / 32.0)
    half = (count - 1) // 2
    np.testing.assert_allclose(predict @ shares[::2] ** half, shares[1::2] ** half, atol=ROUNDING)
    full = shares ** (count - 1)
    np.testing.assert_allclose(dense @ full, between ** (count - 1), atol=ROUNDING)
    missed = predict @ shares[::2] ** (half + 1) - shares[1::2] ** (half + 1)
    assert np.abs(missed).max() > 1e-4

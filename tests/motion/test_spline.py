"""A motion between its samples, against SciPy's polynomials, whatever is looked at together."""

import numpy as np
import pytest
from scipy.interpolate import BPoly

from selfmotion.basics import Array
from selfmotion.model.motion import spline
from selfmotion.model.motion.spline import Spline

# No two intervals are alike.
T = np.array([0.0, 0.3, 0.4, 1.1, 1.5, 2.5])
ROUNDING = 1e-10
# Steps of which lengths are the sum, and what these lose where joints turn round.
STEPS, VARIATION = 20_000, 1e-6


def both(degree: int) -> tuple[Spline, BPoly]:
    """Return a motion of three joints, and the same by SciPy."""
    tables = np.random.default_rng(degree).normal(size=(3, len(T), 3))
    given = tables if degree == 5 else tables[:2]
    curve = BPoly.from_derivatives(T, np.moveaxis(given, 0, 1))
    return Spline(T, tables[0], tables[1], tables[2] if degree == 5 else None), curve


def near(found: Array, expected: Array) -> None:
    np.testing.assert_allclose(found, expected, atol=ROUNDING * np.abs(expected).max())


@pytest.mark.parametrize("together", [2, 10_000])
@pytest.mark.parametrize("degree", [3, 5])
def test_derivatives_are_those_of_the_polynomial_through_the_samples(
    degree: int, together: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(spline, "_CHUNK", together)
    motion, curve = both(degree)
    shares = np.array([0.0, 0.25, 0.6])
    inside = np.append((T[:-1, None] + np.diff(T)[:, None] * shares).ravel(), T[-1])
    for order in range(4):
        expected = curve.derivative(order)(inside) if order else curve(inside)
        near(motion.at(inside, order), expected)
        near(motion.within(shares, order), expected)
        # Of any shape of times.
        near(motion.at(inside[:4].reshape(2, 2), order), expected[:4].reshape(2, 2, 3))
        near(motion.at(np.array(inside[1]), order), expected[1])


@pytest.mark.parametrize("together", [2, 10_000])
@pytest.mark.parametrize("degree", [3, 5])
def test_lengths_are_sums_of_small_steps(
    degree: int, together: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each joint goes to and fro: its turning points are found."""
    monkeypatch.setattr(spline, "_CHUNK", together)
    motion, curve = both(degree)
    ends = np.array([0.2, 0.4, 1.3, 2.5])
    found = motion.travelled(ends)
    for end, lengths in zip(ends, found, strict=True):
        steps = np.diff(curve(np.linspace(0.0, end, STEPS + 1)), axis=0)
        np.testing.assert_allclose(lengths, np.abs(steps).sum(axis=0), rtol=VARIATION)
    net = np.abs(np.diff(curve(np.append(0.0, ends)), axis=0)).sum(axis=0)
    assert (found[-1] > net + 0.01).any()

"""Roots of polynomials of all degrees."""

import numpy as np
import pytest

from selfmotion.model.motion import Trajectory, evaluated
from selfmotion.model.motion.spline import differentiated, inner_roots, may_pass, may_vanish


def test_roots_of_polynomials_of_all_degrees() -> None:
    rng = np.random.default_rng(0)
    for degree in range(1, 5):
        roots = rng.uniform(0.05, 0.95, (degree, 200))
        coefficients = np.stack([np.poly(roots[:, k])[::-1] for k in range(200)], axis=1)
        # A leading coefficient of nothing is none.
        found = inner_roots(np.vstack([coefficients, np.zeros((1, 200))]))
        np.testing.assert_allclose(
            np.sort(found[:degree], axis=0), np.sort(roots, axis=0), atol=1e-5
        )
        assert not found[degree:].any()


def test_what_is_differentiated_to_the_end_is_a_constant_of_zero() -> None:
    found = np.random.default_rng(0).normal(size=(4, 2, 3))
    for order in range(1, 6):
        expected = np.polynomial.polynomial.polyder(found)
        found = differentiated(found)
        assert len(found) == max(4 - order, 1)
        np.testing.assert_allclose(found, expected, rtol=1e-15)


def test_small_leading_coefficients_cost_no_digits() -> None:
    # (s - 1/3) (s - 0.7) (1 + e s²): the companion matrix is then of size 1 / e.
    for tiny in (1e-4, 1e-8, 1e-11):
        low = np.array([0.7 / 3.0, -(0.7 + 1.0 / 3.0), 1.0])
        coefficients = np.append(low, [0.0, 0.0]) + tiny * np.append([0.0, 0.0], low)
        found = inner_roots(coefficients[:, None])[:, 0]
        np.testing.assert_allclose(np.sort(found)[-2:], [1.0 / 3.0, 0.7], rtol=0, atol=1e-13)


def test_polynomials_that_may_vanish_are_all_found() -> None:
    rng = np.random.default_rng(0)
    s = np.linspace(0.0, 1.0, 2001)
    for degree in range(5):
        coefficients = rng.normal(size=(degree + 1, 500))
        values = np.stack([evaluated(coefficients, at) for at in s])
        vanishes = (values.min(axis=0) <= 0.0) & (values.max(axis=0) >= 0.0)
        found = may_vanish(coefficients)
        assert found[vanishes].all()
        # Far from zero nothing is looked for.
        coefficients[0] += 100.0
        assert not may_vanish(coefficients).any()


def test_polynomials_that_leave_limits_between_their_ends_are_all_found() -> None:
    rng = np.random.default_rng(1)
    s, limits = np.linspace(0.0, 1.0, 501), np.array([1.0, 2.0])
    for degree in range(1, 6):
        coefficients = rng.normal(size=(degree + 1, 300, 2))
        values = np.stack([evaluated(coefficients, at) for at in s])
        inside = np.all(np.abs(values[[0, -1]]) <= limits, axis=0)
        below, above = (values < -limits).any(axis=0), (values > limits).any(axis=0)
        assert may_pass(coefficients, -limits, limits)[inside & (below | above)].all()
        # One side is asked for as well as the other, and far from both nothing is.
        assert may_pass(coefficients, -limits, np.full(2, 1e3))[inside & below].all()
        assert may_pass(coefficients, np.full(2, -1e3), limits)[inside & above].all()
        assert not may_pass(coefficients, np.full(2, -1e3), np.full(2, 1e3)).any()


@pytest.mark.parametrize("away", [1e-9, 5e-4, 0.3])
def test_roots_beside_the_interval_are_none_of_it(away: float) -> None:
    """Before 0, at the ends, and after 1: an extreme there is none of the motion."""
    places = np.array([-away, 0.0, 0.5, 1.0, 1.0 + away])
    lines = np.stack([-places, np.ones(5)])
    np.testing.assert_allclose(inner_roots(lines), [[0.0, 0.0, 0.5, 0.0, 0.0]])
    # The same of parabolas, the other root of which is inside; ends are a matter of rounding.
    places = places[[0, 2, 4]]
    parabolas = np.stack([0.25 * places, -(0.25 + places), np.ones(3)])
    found = np.sort(inner_roots(parabolas), axis=0)
    np.testing.assert_allclose(found[0], 0.25 * (places == 0.5), atol=1e-12)
    np.testing.assert_allclose(found[1], np.where(places == 0.5, 0.5, 0.25), atol=1e-12)


def test_roots_that_lie_close_are_polished() -> None:
    """Roots 1e-3 apart beside a tiny leading coefficient: Newton steps give the digits back."""
    rng, wrong = np.random.default_rng(4), []
    for _ in range(200):
        first = rng.uniform(0.1, 0.9)
        roots = np.array([first, first + 1e-3])
        low = np.array([roots.prod(), -roots.sum(), 1.0])
        tiny = 10.0 ** rng.uniform(-11.0, -6.0)
        coefficients = np.append(low, [0.0, 0.0]) + tiny * np.append([0.0, 0.0], low)
        found = np.sort(inner_roots(coefficients[:, None])[:, 0])[-2:]
        wrong.append(np.abs(found - roots).max())
    # A root is known to the rounding of the value over the slope, 1e-3 here.
    assert max(wrong) < 1e-12


def test_pieces_are_evaluated_at_any_times() -> None:
    """Unsorted, at knots, one alone, or none; as they are by Horner's rule."""
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.1, 1.0, 8))
    q, qd, qdd = rng.normal(size=(3, 8, 2))
    motion = Trajectory(t, q, qd, ("a", "b"), qdd)
    times = np.concatenate([rng.uniform(t[0], t[-1], 50), t, t[::-1]])
    for order in range(4):
        segments = motion._spline.segments(np.arange(7), order)
        k, s = motion._spline.place(times)
        expected = evaluated(segments[:, k], s[:, None])
        np.testing.assert_allclose(motion(times, order), expected, rtol=1e-13, atol=1e-13)
        assert motion(np.zeros(0), order).shape == (0, 2)
        np.testing.assert_array_equal(motion(float(times[3]), order), motion(times[3:4], order)[0])


@pytest.mark.parametrize("lead", [1e-3, 1e-9, 1e-12, -1e-12])
def test_roots_of_nearly_linear_parabolas_lose_no_digits(lead: float) -> None:
    """The other root is far away: only a sum that does not cancel has this one."""
    root = np.linspace(0.05, 0.95, 19)
    constant = -root * (1.0 + lead * root)
    found = inner_roots(np.stack([constant, np.ones(19), np.full(19, lead)]))
    np.testing.assert_allclose(found.max(axis=0), root, rtol=1e-14)

"""Quintic pieces through nodes at uneven times: what they are, and what is linear in the nodes."""

import numpy as np
import pytest
from scipy.interpolate import BPoly

from selfmotion.basics import Array
from selfmotion.planning.nodes.spline import (
    AT_CONTROLS,
    AT_GAUSS,
    CONTROLS,
    FINE_POINTS,
    GAUSS,
    ORDERS,
    POINTS,
    Quintic,
    control_times,
    point_matrices,
    unit_bases,
)

# No two intervals are alike.
T = np.array([0.0, 0.2, 0.7, 1.0, 1.9])
JOINTS, COPIES = 3, 3
# Sums of a few numbers of the size of the largest.
ROUNDING = 1e-12


def nodes_of(copies: int = 1) -> Array:
    """Return (q, q̇, q̈) of nodes, (N + 1, 3, n)."""
    return np.random.default_rng(1).normal(size=(copies * len(T), 3, JOINTS))


def curve_of(nodes: Array) -> BPoly:
    """Return the same curve by SciPy."""
    return BPoly.from_derivatives(T, nodes)


def near(found: Array, expected: Array) -> None:
    np.testing.assert_allclose(found, expected, atol=ROUNDING * np.abs(expected).max())


@pytest.mark.parametrize("shares", [POINTS, FINE_POINTS])
@pytest.mark.parametrize("order", range(ORDERS))
def test_the_curve_goes_through_its_nodes_as_a_quintic(order: int, shares: Array) -> None:
    spline, nodes = Quintic(T, shares=shares), nodes_of()
    curve, ends = curve_of(nodes).derivative(order), spline.ends(nodes)
    inner = (T[:-1, None] + np.diff(T)[:, None] * GAUSS).ravel()
    near(spline.at(AT_GAUSS, order, ends).reshape(-1, JOINTS), curve(inner))
    near(spline.sampling.t, inner)
    # SciPy's pieces begin where they are looked at: at a joint, of the jerk there are two values.
    expected = curve(spline.points.t)
    near(spline.at_points(order, ends), expected)
    which = np.array([len(expected) - 1, 3, 0, 4])
    k, tables = point_matrices(spline, which)
    near((tables[:, order, None] @ ends[k])[:, 0], expected[which])
    with pytest.raises(AssertionError):
        near((tables[:, order, None] @ ends[k[::-1]])[:, 0], expected[which])


@pytest.mark.parametrize("order", range(ORDERS))
def test_control_points_are_those_of_bernstein(order: int) -> None:
    spline, nodes = Quintic(T), nodes_of()
    found = spline.at(AT_CONTROLS, order, spline.ends(nodes))
    assert found.shape[1] == CONTROLS[order]
    curve = BPoly(np.swapaxes(found, 0, 1), T)
    near(curve(spline.sampling.t), curve_of(nodes).derivative(order)(spline.sampling.t))
    # Of what rises evenly they are evenly apart: each is where its time says.
    power = np.polynomial.Polynomial([0.0, 1.0]).integ(order)
    rising = np.stack([power.deriv(k)(T) if k else power(T) for k in range(3)], axis=1)
    near(
        spline.at(AT_CONTROLS, order, spline.ends(rising[:, :, None]))[..., 0],
        control_times(spline, order),
    )


def test_weights_integrate_squares_of_rates_exactly() -> None:
    spline, curve = Quintic(T), curve_of(nodes_of()).derivative(1)
    fine = 0.5 * (np.polynomial.legendre.leggauss(12)[0] + 1.0)
    weights = 0.5 * np.polynomial.legendre.leggauss(12)[1]
    expected = sum(
        h * weights @ curve(t + h * fine) ** 2 for t, h in zip(T, np.diff(T), strict=False)
    )
    near(spline.sampling.weights @ curve(spline.sampling.t) ** 2, expected)


@pytest.mark.parametrize("copies", [1, COPIES])
def test_what_is_pulled_back_is_the_adjoint_of_the_ends(copies: int) -> None:
    """<ends(x), y> = <x, scattered(y)>, and `changes` is `ends` of what nodes change by."""
    spline, nodes = Quintic(T, copies), nodes_of(copies)
    ends = spline.ends(nodes)
    # Where a gap is, the piece stands still, which is no matter of what is moved by.
    inner = np.delete(np.arange(spline.count), spline.gaps)
    by_ends = np.random.default_rng(2).normal(size=ends.shape)
    one = np.sum(by_ends[inner] * ends[inner])
    assert np.sum(spline.scatter(by_ends) * nodes) == pytest.approx(one, rel=ROUNDING)
    changes = np.random.default_rng(3).normal(size=(*nodes.shape, 2))
    step = np.random.default_rng(4).normal(size=(len(nodes), 2))
    moved = np.einsum("kond,kd->kon", changes, step)
    found = spline.changes(changes).along(step)
    near(found[inner], spline.ends(moved)[inner])
    assert not found[spline.gaps].any()


def test_motions_side_by_side_are_each_what_they_are_alone() -> None:
    together, alone, nodes = Quintic(T, COPIES), Quintic(T), nodes_of(COPIES)
    size = len(T)
    assert (together.gaps == np.array([4, 9])).all()
    ends, weights = together.ends(nodes), together.sampling.weights.reshape(together.count, -1)
    for c in range(COPIES):
        rows = slice(c * size, (c + 1) * size - 1)
        near(ends[rows], alone.ends(nodes[c * size : (c + 1) * size]))
        near(weights[rows].ravel(), alone.sampling.weights)
    # In a gap nothing moves, and it weighs nothing.
    assert not weights[together.gaps].any()
    for order in range(1, ORDERS):
        assert (
            not (unit_bases(np.linspace(0.0, 1.0, 4))[order] @ ends[together.gaps]).round(9).any()
        )
    assert (together.sampling.t.reshape(-1, len(GAUSS))[together.gaps] == T[-1]).all()


@pytest.mark.parametrize("count", [3, 4, 5])
def test_differences_are_exact_of_polynomials_through_a_stencil(count: int) -> None:
    """Through five nodes, or as many as there are."""
    t = T[:count]
    poly = np.polynomial.Polynomial(np.random.default_rng(5).normal(size=count))
    x = poly(t)[:, None]
    first, second = Quintic(t).differences(x)
    np.testing.assert_allclose(first[:, 0], poly.deriv(1)(t), rtol=1e-9)
    np.testing.assert_allclose(second[:, 0], poly.deriv(2)(t), rtol=1e-9, atol=1e-9)


def test_differences_are_the_same_backwards_in_time() -> None:
    """Stencils are in the middle: first derivatives change their sign, second ones do not."""
    t = np.array([0.0, 0.1, 0.4, 0.6, 0.9, 1.3, 1.4, 2.0])
    x = np.random.default_rng(2).normal(size=(len(t), JOINTS))
    first, second = Quintic(t).differences(x)
    back_first, back_second = Quintic(t[-1] - t[::-1]).differences(x[::-1])
    near(back_first[::-1], -first)
    near(back_second[::-1], second)

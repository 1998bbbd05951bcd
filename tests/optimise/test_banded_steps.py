"""Parts of the banded interior-point method, each against dense algebra."""

import numpy as np
import pytest

from selfmotion.basics import Array, Flags
from selfmotion.planning.optimise import banded

# Of sums of a few numbers; of equations that are solved by factors.
ROUNDING, SOLVED = 1e-12, 1e-9
UNKNOWNS, ROWS = 9, 30


class State:
    """An iterate anywhere: slacks and multipliers above 0, and no residual is 0.

    Attributes are those of `interior_optimum`.
    """

    def __init__(self, seed: int, *, fixed: bool = False) -> None:
        rng = np.random.default_rng(seed)
        self.matrix = rng.normal(size=(ROWS, 3))
        self.place = np.sort(rng.integers(0, UNKNOWNS - 2, ROWS))
        # Each unknown is in some row.
        self.place[: UNKNOWNS - 2] = np.arange(UNKNOWNS - 2)
        self.limit, self.c = rng.normal(size=ROWS), rng.normal(size=UNKNOWNS)
        self.gradient = rng.normal(size=UNKNOWNS)
        self.free: Flags = np.ones(UNKNOWNS, dtype=np.bool_)
        self.free[[0, 4]] = not fixed
        self.slack, self.price = rng.uniform(0.5, 2.0, (2, ROWS))
        self.residuals, self.ds, self.dz = np.zeros(ROWS), *rng.normal(size=(2, ROWS))
        self.band, self.paid = np.zeros((3, UNKNOWNS)), np.zeros(UNKNOWNS)
        self.rows = np.zeros((ROWS, UNKNOWNS))
        for row, first in enumerate(self.place):
            self.rows[row, first : first + 3] = self.matrix[row]

    def updated(self) -> tuple[float, float]:
        return banded._update_residuals(
            *(self.c, self.matrix, self.place, self.limit, self.slack, self.price),
            *(self.residuals, self.band, self.paid),
        )

    def normal(self) -> Array:
        """Return Rᵀ diag(z/s) R."""
        return np.asarray(self.rows.T @ np.diag(self.price / self.slack) @ self.rows)


def test_a_start_is_on_the_central_path_and_meets_rows_that_have_room() -> None:
    state = State(1)
    value = banded._initialise(
        *(state.gradient, state.matrix, state.place, state.limit, state.c),
        *(state.slack, state.price),
    )
    assert value == pytest.approx(np.abs(state.gradient) @ np.maximum(np.abs(state.c), 1.0))
    np.testing.assert_allclose(state.slack * state.price, value / ROWS)
    room = state.limit - state.rows @ state.c
    least = 0.01 * np.maximum(np.abs(state.limit), 1.0)
    assert (room > least).any()
    assert (room < least).any()
    np.testing.assert_allclose(state.slack, np.maximum(room, least))


def test_residuals_and_the_normal_matrix_are_those_of_dense_algebra() -> None:
    state = State(2)
    products, met = state.updated()
    residuals = state.rows @ state.c + state.slack - state.limit
    np.testing.assert_allclose(state.residuals, residuals, atol=ROUNDING)
    assert products == pytest.approx(state.slack @ state.price)
    assert met == pytest.approx((np.abs(residuals) / np.maximum(np.abs(state.limit), 1.0)).max())
    np.testing.assert_allclose(state.paid, state.rows.T @ state.price, atol=ROUNDING)
    for off in range(3):
        near = np.diagonal(state.normal(), off)
        np.testing.assert_allclose(state.band[off, : len(near)], near, atol=ROUNDING)


@pytest.mark.parametrize("fixed", [False, True])
def test_factors_solve_the_normal_equations(fixed: bool) -> None:
    """Of unknowns that are fixed the solution is 0, and the others are as if they were not."""
    state = State(3, fixed=fixed)
    state.updated()
    expected, right = state.normal(), np.random.default_rng(4).normal(size=UNKNOWNS)
    assert banded._factored(state.band, state.free)
    found = right.copy()
    banded._solve(state.band, found)
    free = state.free
    own = np.linalg.solve(expected[np.ix_(free, free)], right[free])
    np.testing.assert_allclose(found[free], own, rtol=SOLVED)
    np.testing.assert_allclose(found[~free], 0.0, atol=ROUNDING)


def test_a_matrix_that_is_not_positive_definite_has_no_factors() -> None:
    free: Flags = np.ones(UNKNOWNS, dtype=np.bool_)
    assert not banded._factored(np.zeros((3, UNKNOWNS)), free)
    band = np.zeros((3, UNKNOWNS))
    band[0], band[1] = 1.0, 1.5
    assert not banded._factored(band, free)


@pytest.mark.parametrize("fixed", [False, True])
@pytest.mark.parametrize(("centre", "second"), [(0.0, 0.0), (0.3, 0.0), (0.3, 1.0)])
def test_a_step_solves_the_linearised_conditions(centre: float, second: float, fixed: bool) -> None:
    """R c + s = limit, Rᵀz = g and s z = centre; with the products of the step before if asked."""
    state = State(5, fixed=fixed)
    state.updated()
    assert banded._factored(state.band, state.free)
    dc, before = np.empty(UNKNOWNS), second * state.ds * state.dz
    tables = state.slack, state.price, state.residuals, state.ds, state.dz
    banded._search_direction(
        *(centre, second, state.gradient, state.free, state.matrix, state.place),
        *(*tables, state.band, dc),
    )
    lengths = banded._step_lengths(state.matrix, state.place, dc, *tables, centre, second, 0.9)
    slack, price = state.slack + state.ds, state.price + state.dz
    np.testing.assert_allclose(state.rows @ (state.c + dc) + slack, state.limit, atol=SOLVED)
    left = state.rows.T @ price - state.gradient
    np.testing.assert_allclose(left[state.free], 0.0, atol=SOLVED)
    assert not dc[~state.free].any()
    products = state.slack * price + state.price * slack - state.slack * state.price
    np.testing.assert_allclose(products + before, centre, atol=SOLVED)
    # Of slacks and of multipliers a tenth is left at least.
    pairs = (state.slack, state.ds), (state.price, state.dz)
    for length, (value, change) in zip(lengths, pairs, strict=True):
        falls = change < 0.0
        most = (-0.9 * value[falls] / change[falls]).min(initial=1.0)
        assert length == pytest.approx(most)


def test_a_step_that_reaches_no_boundary_is_whole() -> None:
    state = State(6)
    none = np.zeros(ROWS)
    # Residuals of slacks that grow, and products that do.
    lengths = banded._step_lengths(
        *(state.matrix, state.place, np.zeros(UNKNOWNS), state.slack, state.price),
        *(none - 1e-3, none.copy(), none.copy(), 10.0, 0.0, 0.9),
    )
    assert lengths == (1.0, 1.0)


def test_steps_end_where_no_product_is_far_below_their_mean() -> None:
    state = State(7)
    state.ds, state.dz = 0.1 * state.slack, -0.1 * state.price
    # One row would come to its boundary long before the others.
    state.dz[3], state.ds[3] = -0.9999 * state.price[3], 0.0
    lengths = banded._into_neighbourhood(state.slack, state.price, state.ds, state.dz, 1.0, 1.0)
    assert lengths[0] == lengths[1] < 1.0
    total, least = banded._products(state.slack, state.price, state.ds, state.dz, *lengths)
    own = (state.slack + lengths[0] * state.ds) * (state.price + lengths[1] * state.dz)
    assert (total, least) == pytest.approx((own.sum(), own.min()))
    assert least >= banded._NEIGHBOURHOOD * total / ROWS
    # Those that are near to it already are left as they are.
    state.dz[3] = -0.1 * state.price[3]
    assert banded._into_neighbourhood(state.slack, state.price, state.ds, state.dz, 1.0, 0.5) == (
        1.0,
        0.5,
    )


def test_room_is_a_share_of_a_limit() -> None:
    """Of small limits it is room itself, and what has none has all."""
    rng = np.random.default_rng(8)
    rows = banded.BandedRows(
        rng.normal(size=(3, 4, 2)), -rng.uniform(0.1, 9.0, (4, 2)), rng.uniform(0.1, 9.0, (4, 2))
    )
    rows.upper[1, 0] = np.inf
    c = rng.normal(size=6)
    reached = np.array([[rows.matrix[:, k, m] @ c[k : k + 3] for m in range(2)] for k in range(4)])
    above, below = banded._room(rows, c)
    known = np.isfinite(rows.upper)
    sizes = np.maximum(np.abs(rows.upper[known]), 1.0)
    np.testing.assert_allclose(above[known], (rows.upper - reached)[known] / sizes)
    assert (above[~known] == np.inf).all()
    np.testing.assert_allclose(below, (reached - rows.lower) / np.maximum(np.abs(rows.lower), 1.0))


def test_rows_are_added_with_their_neighbours() -> None:
    """As far as there are limits: twenty to both sides."""
    room = np.ones((60, 2))
    room[[30, 35], 0] = -1.0
    room[32, 0] = np.inf
    found = np.zeros((60, 2), dtype=bool)
    banded._choose(room, np.zeros(60), found)
    expected = np.zeros((60, 2), dtype=bool)
    expected[30 - banded._NEIGHBOURS : 36 + banded._NEIGHBOURS, 0] = True
    expected[32, 0] = False
    np.testing.assert_array_equal(found, expected)

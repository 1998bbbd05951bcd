"""The banded programme finds what another solver finds, and says where there is nothing."""

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.sparse import lil_array

from selfmotion.planning.optimise import BandedRows, banded, banded_optimum
from selfmotion.planning.result.pace_rows import basis

# The optimum is reached to this share.
GAP = 1e-6


def programme(rng: np.random.Generator, count: int, width: int) -> tuple[np.ndarray, BandedRows]:
    matrix = rng.normal(size=(3, count, width))
    upper = rng.uniform(0.5, 2.0, size=(count, width))
    lower = -rng.uniform(0.5, 2.0, size=(count, width))
    # Some sides have no limit; bounds keep the optimum finite.
    upper[rng.random(upper.shape) < 0.2] = np.inf
    lower[rng.random(lower.shape) < 0.2] = -np.inf
    return rng.normal(size=count + 2), BandedRows(matrix, lower, upper)


def dense(rows: BandedRows) -> tuple[np.ndarray, np.ndarray]:
    _, count, width = rows.matrix.shape
    table = lil_array((count * width, count + 2))
    for k in range(count):
        table[k * width : (k + 1) * width, k : k + 3] = rows.matrix[:, k].T
    table = table.tocsr()
    upper, lower = rows.upper.ravel(), rows.lower.ravel()
    some, others = np.isfinite(upper), np.isfinite(lower)
    from scipy.sparse import vstack

    both = vstack([table[some], -table[others]])
    return both, np.concatenate([upper[some], -lower[others]])


@pytest.mark.parametrize("seed", range(6))
def test_it_finds_the_optimum_that_highs_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    gradient, rows = programme(rng, count=int(rng.integers(3, 120)), width=int(rng.integers(1, 8)))
    bound = np.full(len(gradient), 5.0)
    bound[0] = 0.0 if seed % 2 else 5.0
    c, reached = banded_optimum(gradient, rows, np.zeros(len(gradient)), -bound, bound)
    assert reached
    table, right = dense(rows)
    bounds = np.column_stack([-bound, bound])
    found = linprog(-gradient, A_ub=table, b_ub=right, bounds=bounds, method="highs")
    assert gradient @ c == pytest.approx(-found.fun, rel=2.0 * GAP)
    assert (table @ c - right).max() <= 1e-6
    assert np.all(np.abs(c) <= bound)


def test_rows_that_contradict_each_other_have_no_optimum() -> None:
    gradient, rows = programme(np.random.default_rng(1), 20, 3)
    rows.upper[4, 0], rows.lower[4, 0] = -1.0, -2.0
    against = BandedRows(
        np.concatenate([rows.matrix, rows.matrix[:, :, :1]], axis=2),
        np.column_stack([rows.lower, np.where(np.arange(20) == 4, 1.0, -np.inf)]),
        np.column_stack([rows.upper, np.full(20, np.inf)]),
    )
    bound = np.full(22, 5.0)
    assert not banded_optimum(gradient, against, np.zeros(22), -bound, bound)[1]


def uneven_splines(seed: int, count: int) -> tuple[np.ndarray, BandedRows]:
    """Quadratic splines on intervals of 0.1 to 1 ms, below a curve, with limited derivatives.

    As those of paces around corners: rows of second derivatives are 1e8 times as steep as others.
    """
    rng = np.random.default_rng(seed)
    widths = 1e-3 * 0.5 ** np.repeat(rng.integers(0, 4, -(-count // 30)), 30)[:count]
    t = np.append(0.0, np.cumsum(widths))
    value, slope, bend = (part[:, :, None] for part in basis(t, 0.5))
    waves = np.arange(1, 9) * (t[1:, None] / t[-1] + rng.random(8))
    most = np.exp(np.sin(2.0 * np.pi * waves) @ rng.normal(size=8))[:, None]
    least = np.column_stack([np.full((count, 1), -np.inf), -np.ones((count, 2))])
    matrix = np.concatenate([value, bend / 3e3, slope / 60.0], axis=2)
    return np.ones(count + 2), BandedRows(matrix, least, np.column_stack([most, -least[:, 1:]]))


# Multipliers of steep rows round.
STEEP_GAP = 1e-3


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("count", [200, 300, 1000])
def test_steep_rows_next_to_others_are_no_obstacle(seed: int, count: int) -> None:
    gradient, rows = uneven_splines(seed, count)
    none, most = np.zeros(count + 2), np.full(count + 2, 50.0)
    c, reached = banded_optimum(gradient, rows, none + 1e-3, none, most)
    assert reached
    table, right = dense(rows)
    assert (table @ c - right).max() <= 1e-5
    found = linprog(-gradient, A_ub=table, b_ub=right, bounds=(0.0, 50.0), method="highs")
    assert gradient @ c == pytest.approx(-found.fun, rel=STEEP_GAP)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_where_rounding_hides_the_gap_it_ends_all_the_same(seed: int) -> None:
    """A gap of some roundings of g·c: the optimum is reached, and told to be."""
    gradient, rows = uneven_splines(seed, 300)
    none, most = np.zeros(302), np.full(302, 50.0)
    c, reached = banded_optimum(gradient, rows, none + 1e-3, none, most, gap=1e-11)
    assert reached
    table, right = dense(rows)
    found = linprog(-gradient, A_ub=table, b_ub=right, bounds=(0.0, 50.0), method="highs")
    assert gradient @ c == pytest.approx(-found.fun, rel=2.0 * GAP)


def test_after_the_last_programme_with_part_of_the_rows_one_has_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """So there is one if no other is wanted."""
    gradient, rows = programme(np.random.default_rng(2), 40, 3)
    bound = np.full(42, 5.0)
    usual, reached = banded_optimum(gradient, rows, np.zeros(42), -bound, bound)
    assert reached
    monkeypatch.setattr(banded, "_ROUNDS", 0)
    whole, reached = banded_optimum(gradient, rows, np.zeros(42), -bound, bound)
    assert reached
    assert gradient @ whole == pytest.approx(gradient @ usual, rel=2.0 * GAP)


def test_shares_are_shares() -> None:
    """Mehrotra 1992, section 4, and Wright 1997, chapter 5: each is within 0 and 1."""
    for name in (
        *("_MU_FLOOR", "_STALL_RESIDUAL", "_STALL_FACTOR", "_TAU", "_NEIGHBOURHOOD"),
        *("_SHORTENING", "_SHORT_STEP", "_CENTRING", "_MIN_STEP", "_ROOM_FIRST", "_ROOM_LATER"),
        "_SHARE_OF_WORST",
    ):
        assert 0.0 < getattr(banded, name) < 1.0, name
    assert banded._MIN_STEP < banded._SHORT_STEP
    assert banded._ROOM_LATER < banded._ROOM_FIRST

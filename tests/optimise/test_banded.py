"""The banded programme finds what another solver finds, and says where there is nothing."""

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.sparse import lil_array

from selfmotion.optimise import BandedRows, banded_optimum

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

"""Parts of the table tile what they are parts of."""

import numpy as np
import pytest

from selfmotion import kernels
from selfmotion.kernels import backward, table
from support.compiled import compiled


@pytest.mark.parametrize(("n", "m"), [(3, 2), (7, 6), (8, 5), (2, 1)])
def test_parts_tile_what_they_are_parts_of(n: int, m: int) -> None:
    """Each number belongs to one part: no overlap, none left, none beyond the end."""
    for parts, size in (
        (table.parts, kernels.columns(n, m)),
        (backward.divide, kernels.space_size(n, m)),
    ):
        numbers = np.arange(float(size))
        found = np.concatenate([part.ravel() for part in parts(numbers, n, m)])
        np.testing.assert_array_equal(np.sort(found), numbers)


def test_compiled_parts_are_those_in_python() -> None:
    """Of a row, and q and q̇ by themselves."""
    rows = np.random.default_rng(0).normal(size=(2, kernels.columns(7, 6)))
    read = compiled(table.parts)
    for s in range(2):
        for mine, theirs in zip(read(rows[s], 7, 6), table.parts(rows[s], 7, 6), strict=True):
            np.testing.assert_array_equal(mine, theirs)
        np.testing.assert_array_equal(
            compiled(table.q_of)(rows, s, 7), kernels.parts(rows, 7, 6).q[s]
        )
        np.testing.assert_array_equal(
            compiled(table.qd_of)(rows, s, 7), kernels.parts(rows, 7, 6).qd[s]
        )

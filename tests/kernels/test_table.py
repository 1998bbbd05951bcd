"""Parts of the table tile what they are parts of."""

import numpy as np
import pytest

from selfmotion.model import kernels
from selfmotion.model.kernels import stages, table
from support.compiled import compiled


@pytest.mark.parametrize("tips", [1, 2, 3])
@pytest.mark.parametrize(("n", "m"), [(3, 2), (7, 6), (8, 5), (2, 1)])
def test_parts_tile_what_they_are_parts_of(n: int, m: int, tips: int) -> None:
    """Each number belongs to one part: no overlap, none left, none beyond the end."""
    row = np.arange(float(kernels.columns(n, m, tips)))
    space = np.arange(float(kernels.space_size(n, m)))
    of_tips = [part for f in range(tips) for part in table.tip_of(row, f, n, m)]
    for numbers, parts in (
        (row, [*table.stage_of(row, n, m), *of_tips]),
        (space, stages.space_of(space, n, m)),
    ):
        found = np.concatenate([part.ravel() for part in parts])
        np.testing.assert_array_equal(np.sort(found), numbers)


def test_compiled_parts_are_those_in_python() -> None:
    """Of a row, and q and q̇ by themselves."""
    rows = np.random.default_rng(0).normal(size=(2, kernels.columns(7, 6, 2)))
    read, read_tip = compiled(table.stage_of), compiled(table.tip_of)
    for s in range(2):
        mine = [*read(rows[s], 7, 6), *read_tip(rows[s], 1, 7, 6)]
        theirs = [*table.stage_of(rows[s], 7, 6), *table.tip_of(rows[s], 1, 7, 6)]
        for one, other in zip(mine, theirs, strict=True):
            np.testing.assert_array_equal(one, other)
        np.testing.assert_array_equal(
            compiled(table.q_of)(rows, s, 7), kernels.stage_of(rows, 7, 6).q[s]
        )
        np.testing.assert_array_equal(
            compiled(table.qd_of)(rows, s, 7), kernels.stage_of(rows, 7, 6).qd[s]
        )


def test_a_matrix_is_a_view_of_itself() -> None:
    """As kernels take the matrix of one node, with what is compiled turned off as well."""
    for matrix in np.random.default_rng(0).normal(size=(3, 7, 4)):
        np.testing.assert_array_equal(table.view(matrix, 0, (7, 4)), matrix)
    # Of a table each row has its part.
    rows = np.arange(24.0).reshape(2, 12)
    np.testing.assert_array_equal(table.view(rows, 4, (2, 3)), rows[:, 4:10].reshape(2, 2, 3))

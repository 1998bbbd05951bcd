"""Symmetric block-banded systems, of nodes coupled to their neighbours."""

import numpy as np

from selfmotion.basics import Array, Ints, kernel


class Banded:
    """A symmetric matrix of K × K blocks (s, s), in LAPACK's upper banded storage.

    Parameters
    ----------
    count, size : int
        K and s.
    reach : int
        Blocks beside the diagonal.
    """

    def __init__(self, count: int, size: int, reach: int) -> None:
        self._size, self._width = size, (reach + 1) * size - 1
        # LAPACK's columns are contiguous.
        self._columns = np.zeros((count * size, self._width + 1))

    @property
    def _table(self) -> Array:
        return self._columns.T

    def add(self, offset: int, first: int, blocks: Array) -> None:
        """Add blocks (L, s, s) in rows `first`, first + 1, …, `offset` columns to the right."""
        _add_blocks(self._columns, offset, first, np.ascontiguousarray(blocks))

    def add_diagonal(self, value: Array | float) -> None:
        """Add to the diagonal, (K s,) or the same everywhere."""
        self._table[self._width] += value

    def hold(self, which: Ints) -> None:
        """Make rows and columns, by their numbers, those of the unit matrix."""
        _hold(self._columns, which)

    def dense(self) -> Array:
        """Return the matrix, (K s, K s)."""
        u, size = self._width, self._table.shape[1]
        found = np.zeros((size, size))
        for offset in range(min(u + 1, size)):
            found += np.diag(self._table[u - offset, offset:], offset)
        return np.asarray(found + np.triu(found, 1).T)

    def solve(self, right: Array) -> Array | None:
        """Return the solution for right sides (K s,) or (K s, c); None if not positive definite."""
        from scipy.linalg.lapack import dpbsv

        # `solveh_banded` would check its input for as long as this takes.
        _, solved, wrong = dpbsv(self._table, right)
        return None if wrong else np.asarray(solved)

    def part_solved(
        self, part: int, parts: int, right: Array, shifts: tuple[float, float, float]
    ) -> Array | None:
        """Return the solution of one of `parts` equal, uncoupled parts.

        Parameters
        ----------
        part, parts : int
        right : (K s / parts,)
        shifts : (float, float, float)
            Additions to the diagonal: a share of its median entry; where the part is not positive
            definite a share of the largest entry; the factor from one such addition to the next.

        Returns
        -------
        (K s / parts,) or None
            None where the part has no finite solution.
        """
        from scipy.linalg.lapack import dpbsv

        size = self._table.shape[1] // parts
        table = self._table[:, part * size : (part + 1) * size].copy()
        entries = np.abs(table[self._width])
        shift = shifts[0] * float(np.median(entries))
        while np.isfinite(shift):
            table[self._width] += shift
            _, solved, wrong = dpbsv(table, right)
            if not wrong:
                return np.asarray(solved)
            shift = max(shifts[2] * shift, shifts[1] * float(entries.max()))
        return None


@kernel
def _add_blocks(columns: Array, offset: int, first: int, blocks: Array) -> None:
    """Add blocks (L, s, s) to the columns (K s, u + 1) of a banded matrix; see `Banded.add`."""
    (count, s, _), u = blocks.shape, columns.shape[1] - 1
    for block in range(count):
        column = (first + block + offset) * s
        for j in range(s):
            # Below the diagonal nothing is stored.
            for i in range(j + 1 if offset == 0 else s):
                columns[column + j, u + i - j - offset * s] += blocks[block, i, j]


@kernel
def _hold(columns: Array, which: Ints) -> None:
    size, u = len(columns), columns.shape[1] - 1
    for row in which:
        for i in range(u + 1):
            columns[row, i] = 0.0
        for j in range(1, min(u, size - 1 - row) + 1):
            columns[row + j, u - j] = 0.0
        columns[row, u] = 1.0

"""What is asked of the first and the last node: c(w_0, w_N) = 0."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, Ints
from selfmotion.constraints import BoundEnd
from selfmotion.nodes.hermite import HermiteSamples

_FIRST, _LAST = 0, 1


class Border(NamedTuple):
    """What is off at the ends, and how it changes with all coordinates.

    Attributes
    ----------
    c : (E,)
    columns : (K s, E)
        ∂c/∂w, turned round.
    """

    c: Array
    columns: Array

    def met_by(self, solved: Array) -> tuple[Array, Array]:
        """Return the step that meets them to first order, and their prices.

        For the step that knows nothing of them and what each of them moves, side by side.
        """
        step, moved = solved[:, 0], solved[:, 1:]
        if not len(self.c):
            return step, self.c
        turned = self.columns.T
        # Least squares: what is held may be asked for as well.
        prices = np.asarray(np.linalg.lstsq(turned @ moved, turned @ step + self.c)[0], float)
        return step - moved @ prices, prices


class NodeEnds:
    """Conditions on q and q̇ at both ends: given ones, or the same at the end as at the start.

    Parameters
    ----------
    items : sequence of BoundEnd
        None of accelerations, see `takes`.

    Attributes
    ----------
    count : int
        How many numbers have to be 0: E.
    """

    def __init__(self, items: Sequence[BoundEnd]) -> None:
        self._items = tuple(items)
        self.count = sum(len(item.orders) * item.null.shape[1] for item in items)

    @staticmethod
    def takes(item: object) -> bool:
        """Whether a condition is one of positions and velocities at the ends."""
        return isinstance(item, BoundEnd) and max(item.orders) < 2

    def residuals(self, samples: HermiteSamples) -> Array:
        """Return c, (E,)."""
        return np.concatenate([np.zeros(0), *(item.residual(samples)[0] for item in self._items)])

    def rows(self, changes: Array) -> Array:
        """Return ∂c/∂w of the first and the last node, (E, 2, 2r).

        `changes` (N + 1, 2, n, 2r) is ∂(q, q̇)/∂w of the nodes.
        """
        ends = changes[[0, -1]]
        none = np.zeros((0, 2, changes.shape[3]))
        return np.concatenate([none, *(_over(self._signed(item), ends) for item in self._items)])

    def border(self, c: Array, changes: Array, held: Ints) -> Border:
        """Return what is off, c (E,), with its derivatives; nothing moves what is `held`."""
        count, _, _, size = changes.shape
        by_node = np.zeros((count, size, self.count))
        if self.count:
            by_node[[0, -1]] = np.moveaxis(self.rows(changes), 0, 2)
        columns = by_node.reshape(count * size, self.count)
        columns[held] = 0.0
        return Border(c, columns)

    def pulled(self, prices: Array, count: int) -> Array:
        """Return Σ prices (E,) · ∂c/∂(q, q̇) of the nodes, (count, 2, n)."""
        n = self._items[0].null.shape[0]
        found, first = np.zeros((count, 2, n)), 0
        for item in self._items:
            signed = self._signed(item)
            own = prices[first : first + len(signed)]
            first += len(signed)
            by = np.einsum("e,eokn->kon", own, signed)
            found[[0, -1]] += by
        return found

    def by_item(self, prices: Array) -> dict[int, Array]:
        """Return the prices of each condition, by its identity."""
        found, first = {}, 0
        for item in self._items:
            size = len(item.orders) * item.null.shape[1]
            found[id(item)] = prices[first : first + size]
            first += size
        return found

    def _signed(self, item: BoundEnd) -> Array:
        """Return ∂c/∂(q, q̇) of the first and the last node, (e, 2 orders, 2 nodes, n)."""
        n, r = item.null.shape
        found = np.zeros((len(item.orders), r, 2, 2, n))
        for place, order in enumerate(item.orders):
            if item.target is None:
                found[place, :, order, _LAST] = item.null.T
                found[place, :, order, _FIRST] = -item.null.T
            else:
                found[place, :, order, _LAST if item.row else _FIRST] = item.null.T
        return found.reshape(-1, 2, 2, n)


def _over(signed: Array, ends: Array) -> Array:
    """Return Σ signed (e, 2, 2, n) · ends (2 nodes, 2 orders, n, d), (e, 2, d)."""
    return np.asarray(np.einsum("eokn,kond->ekd", signed, ends))

"""Conditions on the first and the last node: c(w_0, w_N) = 0."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, Ints
from selfmotion.problem.constraints import BoundEnd

# Index of the first node.
_FIRST = 0
# Index of the last node.
_LAST = 1
# Derivatives that conditions know: q, q̇, q̈.
_ORDERS = 3


class Border(NamedTuple):
    """Residuals of the conditions at the ends, with their derivatives by all coordinates.

    Attributes
    ----------
    c : (E,)
    ∂c/∂w, transposed.
        ∂c/∂w, turned round.
    """

    c: Array
    columns: Array

    def met_by(self, step: Array, moved: Array) -> tuple[Array, Array]:
        """Return the step that satisfies the linearised conditions, and their multipliers.

        For the step without conditions, and the response to each column, side by side.
        """
        if not len(self.c):
            return step, self.c
        turned = self.columns.T
        # Least squares: conditions on coordinates that are held have no derivatives.
        multipliers = np.asarray(np.linalg.lstsq(turned @ moved, turned @ step + self.c)[0], float)
        return step - moved @ multipliers, multipliers


class NodeEnds:
    """Conditions on q, q̇ and q̈ at both ends: given ones, or the same at the end as at the start.

    Parameters
    ----------
    items : sequence of BoundEnd

    Attributes
    ----------
    count : int
        Number of equations: E.
    """

    def __init__(self, items: Sequence[BoundEnd]) -> None:
        self._items = tuple(items)
        self.count = sum(len(item.orders) * item.null.shape[1] for item in items)

    def residuals(self, nodes: Array) -> Array:
        """Return c, (E,), for (q, q̇, q̈) of the nodes, (N + 1, 3, n)."""
        if not self._items:
            return np.zeros(0)
        found = []
        for item in self._items:
            for order in item.orders:
                if item.target is None:
                    off = nodes[-1, order] - nodes[0, order]
                else:
                    off = nodes[-1 if item.row else 0, order] - item.target
                found.append(item.null.T @ off)
        return np.concatenate(found)

    @property
    def last(self) -> Array | None:
        """Configuration at the end, (n,); None where it is not prescribed."""
        for item in self._items:
            if item.is_whole and item.row and item.target is not None:
                return item.target
        return None

    def elsewhere(self, nodes: Array) -> dict[str, float]:
        """Return the distance of an end from its prescribed configuration, by condition.

        Only of ends that are at another configuration of the same pose, for (q, q̇, q̈) of the
        nodes.
        """
        found = {item.name: item.elsewhere(nodes[0, 0], nodes[-1, 0]) for item in self._items}
        return {name: far for name, far in found.items() if far > 0.0}

    def border(self, c: Array, changes: Array, held: Ints) -> Border:
        """Return the residuals c (E,) with their derivatives; rows of `held` coordinates are 0.

        `changes` (N + 1, 3, n, s) is ∂(q, q̇, q̈)/∂w of the nodes.
        """
        count, _, _, size = changes.shape
        by_node = np.zeros((count, size, self.count))
        if self.count:
            rows = [_over(self._signed(item), changes[[0, -1]]) for item in self._items]
            by_node[[0, -1]] = np.moveaxis(np.concatenate(rows), 0, 2)
        columns = by_node.reshape(count * size, self.count)
        columns[held] = 0.0
        return Border(c, columns)

    def pulled(self, multipliers: Array, count: int) -> Array:
        """Return Σ multipliers (E,) · ∂c/∂(q, q̇, q̈) of the nodes, (count, 3, n)."""
        n = self._items[0].null.shape[0]
        found, first = np.zeros((count, _ORDERS, n)), 0
        for item in self._items:
            signed = self._signed(item)
            own = multipliers[first : first + len(signed)]
            first += len(signed)
            found[[0, -1]] += np.einsum("e,eokn->kon", own, signed)
        return found

    def by_item(self, multipliers: Array) -> dict[int, Array]:
        """Return the multipliers of each condition, by its identity."""
        found, first = {}, 0
        for item in self._items:
            size = len(item.orders) * item.null.shape[1]
            found[id(item)] = multipliers[first : first + size]
            first += size
        return found

    def _signed(self, item: BoundEnd) -> Array:
        """Return ∂c/∂(q, q̇, q̈) of the first and the last node, (e, 3 orders, 2 nodes, n)."""
        n, r = item.null.shape
        found = np.zeros((len(item.orders), r, _ORDERS, 2, n))
        for place, order in enumerate(item.orders):
            if item.target is None:
                found[place, :, order, _LAST] = item.null.T
                found[place, :, order, _FIRST] = -item.null.T
            else:
                found[place, :, order, _LAST if item.row else _FIRST] = item.null.T
        return found.reshape(-1, _ORDERS, 2, n)


def _over(signed: Array, ends: Array) -> Array:
    """Return Σ signed (e, 3, 2, n) · ends (2 nodes, 3 orders, n, d), (e, 2, d)."""
    return np.asarray(np.einsum("eokn,kond->ekd", signed, ends))

"""Derivatives of conditions, computed as far as they are asked for."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from selfmotion.basics import Array, Ints


class Rows(Protocol):
    """∂h/∂x of C conditions by d variables at one point.

    Of thousands of conditions on a motion few matter: the others are only ever looked at along one
    direction.
    """

    def along(self, p: Array) -> Array:
        """Return the derivatives along p (d,), (C,)."""

    def picked(self, which: Ints) -> Array:
        """Return the rows of some conditions (k,), (k, d)."""


@dataclass(frozen=True, eq=False)
class DenseRows:
    """Rows that are known, (C, d)."""

    table: Array

    def along(self, p: Array) -> Array:
        """See `Rows.along`."""
        return np.asarray(self.table @ p)

    def picked(self, which: Ints) -> Array:
        """See `Rows.picked`."""
        return self.table[which]


@dataclass(frozen=True, eq=False)
class ScaledRows:
    """The derivatives by other variables y, with x = `scale` y for a `scale` (d, d')."""

    rows: Rows
    scale: Array

    def along(self, p: Array) -> Array:
        """See `Rows.along`."""
        return self.rows.along(self.scale @ p)

    def picked(self, which: Ints) -> Array:
        """See `Rows.picked`."""
        return np.asarray(self.rows.picked(which) @ self.scale)


def pulled_back(rows: Rows, weights: Array) -> Array:
    """Return the gradient (d,) of the sum of conditions with these weights (C,)."""
    counted = np.flatnonzero(weights)
    return np.asarray(weights[counted] @ rows.picked(counted))

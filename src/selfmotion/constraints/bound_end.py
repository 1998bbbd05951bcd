"""What is asked of an end of the motion, bound to an arm."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array
from selfmotion.certificate import QUANTITIES
from selfmotion.constraints.conditions import NodeTangents, motion_of_order
from selfmotion.costs import Samples

# The optimiser need only come near [rad, rad/s]: Newton's method then closes the rest.
_NEAR = 1e-4


@dataclass(frozen=True, eq=False)
class BoundEnd:
    """Nᵀ(x - target) = 0 at an end (`row`), or Nᵀ(x(T) - x(0)) = 0 without a target.

    x is q, q̇ or both.
    """

    name: str
    orders: tuple[int, ...]
    target: Array | None
    null: Array
    row: int = -1
    equality = True
    tolerance = _NEAR

    def residual(self, samples: Samples) -> Array:
        """See `BoundConstraint.residual`."""
        parts = []
        for order in self.orders:
            x = motion_of_order(samples, order)
            reached, wanted = (x[-1], x[0]) if self.target is None else (x[self.row], self.target)
            parts.append(self.null.T @ (reached - wanted))
        return np.concatenate(parts)[None, :]

    def tangents(self, samples: Samples, motion: NodeTangents) -> Array:
        """See `BoundConstraint.tangents`."""
        parts = []
        for order in self.orders:
            x = motion.of_order(order)
            parts.append(self.null.T @ (x[-1] - x[0] if self.target is None else x[self.row]))
        return np.concatenate(parts)[None]

    def describe(self, samples: Samples, row: int, column: int) -> str:
        """See `BoundConstraint.describe`."""
        order = self.orders[column // self.null.shape[1]]
        quantity = QUANTITIES[order]
        goal = "that of the start" if self.target is None else "the one asked for"
        miss = np.abs(self.residual(samples)).max()
        where = "end" if self.row else "start"
        unit = ("rad or m", "rad/s or m/s", "rad/s² or m/s²")[order]
        return (
            f"the {quantity} at the {where} is {miss:.3g} {unit} away from {goal} "
            f"({self.tolerance:g} allowed)"
        )

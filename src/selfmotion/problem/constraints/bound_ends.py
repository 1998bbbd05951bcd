"""Conditions on an end of the motion of one arm, as the optimiser sees them.

The tool's rows of q(T) and q̇(T) are given by the path. The remaining conditions are the r
coordinates along the self-motion: h = Nᵀ(x(T) - target), with N an orthonormal null-space basis
at the target configuration, at the start for closed paths, or at the end of the initial motion.
Two configurations on the same pose with equal coordinates are equal, near the reference, and so
are two velocities with the same tool velocity; the residual is free of the path error of the
integration.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array
from selfmotion.certificate import QUANTITIES
from selfmotion.problem.constraints.conditions import (
    BoundConstraint,
    DependsOn,
    NodeTangents,
    motion_of_order,
)
from selfmotion.problem.costs import Samples

# Distance from the target at which the optimiser's end counts as near [rad, rad/s]: Newton's method
# closes the rest.
_NEAR = 1e-4
# A configuration is another solution of the same pose if its distance from the target is above this
# factor of that of its null coordinates …
_FARTHER = 2.0
# … and above this distance [rad or m].
_ELSEWHERE = 1e-3


@dataclass(frozen=True, eq=False)
class EndCondition:
    """A condition on the state of the arm at one end, or that both ends are equal.

    Attributes
    ----------
    name : str
    orders : tuple of int
        Of the derivatives it is on: q (0), q̇ (1), q̈ (2).
    target : (n,) or None
        The prescribed value; None where the end is to be as the start is.
    at_start : bool
        Which end.
    is_whole : bool
        Whether q has to be the target itself.
    """

    name: str
    orders: tuple[int, ...]
    target: Array | None
    at_start: bool = False
    is_whole: bool = False


@dataclass(frozen=True, eq=False)
class BoundEnd(BoundConstraint):
    """Nᵀ(x - target) = 0 at an end (`row`), or Nᵀ(x(T) - x(0)) = 0 without a target.

    x is q, q̇ or both. Where that is all that is left to ask for of q, `is_whole`, it is to be the
    target: other configurations on the same pose may be on the plane Nᵀ(q - target) = 0 as well.
    """

    name: str
    orders: tuple[int, ...]
    target: Array | None
    null: Array
    row: int = -1
    is_whole: bool = False
    tolerance: float = field(default=_NEAR, init=False)
    equality: ClassVar[bool] = True
    depends_on: ClassVar[DependsOn] = DependsOn.ALL

    @classmethod
    def of(cls, item: EndCondition, target: Array | None, null: Array) -> BoundEnd:
        """Return a condition with its target in all coordinates, for a null-space basis there."""
        row = 0 if item.at_start else -1
        return cls(item.name, item.orders, target, null, row, item.is_whole)

    @override
    def residual(self, samples: Samples) -> Array:
        parts = []
        for order in self.orders:
            x = motion_of_order(samples, order)
            reached, wanted = (x[-1], x[0]) if self.target is None else (x[self.row], self.target)
            parts.append(self.null.T @ (reached - wanted))
        return np.concatenate(parts)[None, :]

    @override
    def tangents(self, samples: Samples, motion: NodeTangents) -> Array:
        parts = []
        for order in self.orders:
            x = motion.of_order(order)
            parts.append(self.null.T @ (x[-1] - x[0] if self.target is None else x[self.row]))
        return np.concatenate(parts)[None]

    def elsewhere(self, first: Array, last: Array) -> float:
        """Return the distance of q from the target if it is another solution of the pose, else 0.

        For q at the first and the last node, (n,) each [rad or m].
        """
        if not self.is_whole:
            return 0.0
        away = last - first if self.target is None else (last if self.row else first) - self.target
        far, said = (float(np.linalg.norm(x)) for x in (away, self.null.T @ away))
        return far if far > _FARTHER * said + _ELSEWHERE else 0.0

    @override
    def describe(self, samples: Samples, row: int, column: int) -> str:
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

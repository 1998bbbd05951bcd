"""Rows of all joint limits of a motion on nodes, compiled.

Rows are flattened by constraint, interval, control point, side (above, below) and joint.
"""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from selfmotion.basics import Array, Flags, Ints, inlined, kernel
from selfmotion.planning.nodes.spline import AT_CONTROLS, CONTROLS, ORDERS
from selfmotion.problem.constraints import BoundLimits

# Rows become active where h is above this [units of h].
_NEAR = -0.3
# h of control points that two intervals share, on one of the two: it never becomes active.
_SHARED = -1e3
# The matrices of the control points of q, q̇, q̈ and jerk by y, in one array: (4, 6, 6).
_TABLES = np.stack([np.pad(table, ((0, 6 - len(table)), (0, 0))) for table in AT_CONTROLS])


class LimitTable(NamedTuple):
    """Limits of F constraints on J joints in all, as arrays.

    Attributes
    ----------
    orders : (F,)
        0 of q, 1 of q̇, 2 of q̈, 3 of the jerk.
    first_rows : (F + 1,)
        Number of each one's first row, and of all rows.
    first_joints : (F + 1,)
        Number of its first joint among `joints`.
    joints : (J,)
        Coordinates.
    lower, upper, scale : (J,)
    offset : (F,)
        Added to h: its margin, minus the part of the tolerance that is used.
    """

    orders: Ints
    first_rows: Ints
    first_joints: Ints
    joints: Ints
    lower: Array
    upper: Array
    scale: Array
    offset: Array

    @classmethod
    def of(cls, items: Sequence[tuple[BoundLimits, Ints]], intervals: int) -> Self:
        """Return the table of limits with the coordinates of their joints, for N intervals."""
        rows = [2 * intervals * CONTROLS[item.order] * len(joints) for item, joints in items]
        sizes = [len(joints) for _, joints in items]

        def joined(name: str) -> Array:
            return np.concatenate([np.zeros(0), *(getattr(item, name) for item, _ in items)])

        return cls(
            np.array([item.order for item, _ in items], dtype=np.int64),
            np.cumsum([0, *rows]),
            np.cumsum([0, *sizes]),
            np.concatenate([np.zeros(0, dtype=np.int64), *(joints for _, joints in items)]),
            joined("lower"),
            joined("upper"),
            joined("scale"),
            np.array([item.margin - item.granted for item, _ in items], dtype=np.float64),
        )

    @property
    def size(self) -> int:
        """Number of all rows."""
        return int(self.first_rows[-1])

    def residuals(self, rates: Array, ends: Array) -> Array:
        """Return h of all rows for y (N, 6, n); `rates` are those of `Quintic`."""
        h = np.empty(self.size)
        _set_residuals(*self, _TABLES, rates, ends, h)
        return h

    def near(self, h: Array, intervals: int) -> Flags:
        """Return the mask of nearly violated rows: all of a joint and side."""
        found = np.zeros(self.size, dtype=np.bool_)
        _set_near(self.orders, self.first_rows, self.first_joints, intervals, h, found)
        return found

    def along(self, rates: Array, changes: Array) -> Array:
        """Return ∂h of the rows that may become active, along changes of y (N, 6, n)."""
        none = np.zeros(len(self.joints))
        linear = self._replace(lower=none, upper=none, offset=np.zeros(len(self.orders)))
        return linear.residuals(rates, changes)

    def add_pulled(self, rates: Array, multipliers: Array, found: Array) -> None:
        """Add Σ multipliers ∂h/∂y to `found` (N, 6, n)."""
        _add_pulled(*self[:4], self.scale, _TABLES, rates, multipliers, found)

    def add_squared(self, rates: Array, weights: Array, found: Array) -> None:
        """Add Σ weights ∂h ∂hᵀ by y of each joint to `found` (N, n, 6, 6)."""
        _add_squared(*self[:4], self.scale, _TABLES, rates, weights, found)


@inlined
def _value(table: Array, p: int, ends: Array, k: int, joint: int) -> float:
    total = 0.0
    for a in range(6):
        total += table[p, a] * ends[k, a, joint]
    return total


@kernel
def _set_residuals(
    orders: Ints,
    first_rows: Ints,
    first_joints: Ints,
    joints: Ints,
    lower: Array,
    upper: Array,
    scale: Array,
    offset: Array,
    tables: Array,
    rates: Array,
    ends: Array,
    h: Array,
) -> None:
    """Set (x - upper)/scale and (lower - x)/scale, plus an offset, for x = rates · table y."""
    for f in range(len(orders)):
        o, first, row = orders[f], first_joints[f], first_rows[f]
        size, points = first_joints[f + 1] - first, 6 - orders[f]
        for k in range(len(ends)):
            for p in range(points):
                shared = o < ORDERS - 1 and p == points - 1 and k < len(ends) - 1
                for j in range(size):
                    i = first + j
                    if shared:
                        h[row + j] = h[row + size + j] = _SHARED
                        continue
                    x = rates[o, k] * _value(tables[o], p, ends, k, joints[i])
                    h[row + j] = (x - upper[i]) / scale[i] + offset[f]
                    h[row + size + j] = (lower[i] - x) / scale[i] + offset[f]
                row += 2 * size


@kernel
def _set_near(
    orders: Ints, first_rows: Ints, first_joints: Ints, intervals: int, h: Array, found: Flags
) -> None:
    for f in range(len(orders)):
        first, width = first_rows[f], 2 * (first_joints[f + 1] - first_joints[f])
        points = intervals * (6 - orders[f])
        for column in range(width):
            largest = -np.inf
            for p in range(points):
                largest = max(largest, h[first + p * width + column])
            if not largest > _NEAR:
                continue
            for p in range(points):
                row = first + p * width + column
                found[row] = h[row] > 0.5 * _SHARED


@kernel
def _add_pulled(
    orders: Ints,
    first_rows: Ints,
    first_joints: Ints,
    joints: Ints,
    scale: Array,
    tables: Array,
    rates: Array,
    multipliers: Array,
    found: Array,
) -> None:
    for f in range(len(orders)):
        o, first, row = orders[f], first_joints[f], first_rows[f]
        size = first_joints[f + 1] - first
        for k in range(len(found)):
            for p in range(6 - o):
                for j in range(size):
                    by = multipliers[row + j] - multipliers[row + size + j]
                    if by != 0.0:
                        by *= rates[o, k] / scale[first + j]
                        for a in range(6):
                            found[k, a, joints[first + j]] += tables[o, p, a] * by
                row += 2 * size


@kernel
def _add_squared(
    orders: Ints,
    first_rows: Ints,
    first_joints: Ints,
    joints: Ints,
    scale: Array,
    tables: Array,
    rates: Array,
    weights: Array,
    found: Array,
) -> None:
    for f in range(len(orders)):
        o, first, row = orders[f], first_joints[f], first_rows[f]
        size = first_joints[f + 1] - first
        for k in range(len(found)):
            for p in range(6 - o):
                for j in range(size):
                    by = weights[row + j] + weights[row + size + j]
                    if by != 0.0:
                        by *= (rates[o, k] / scale[first + j]) ** 2
                        for a in range(6):
                            share = by * tables[o, p, a]
                            for b in range(6):
                                found[k, joints[first + j], a, b] += share * tables[o, p, b]
                row += 2 * size

"""Rows of constraints at collocation points of the intervals between nodes."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, Flags, Ints, ProblemError, kernel
from selfmotion.planning.formulation import SampledMotion
from selfmotion.planning.nodes.node_matrix import EndChanges, NodeMatrix
from selfmotion.planning.nodes.spline import ORDERS, Quintic, point_matrices
from selfmotion.problem.constraints import (
    BoundConstraint,
    Multipliers,
    NodeTangents,
    linearised,
)

# Rows with h above this enter the active set [units of h]. Residuals of distances level off just
# below, so that lower ones are all alike.
_ACTIVE_ABOVE = -0.19
# Share of the reserved tolerance that a violation between points may use after subdivision.
_SUBDIVISION_TARGET = 0.5
# Largest number of parts that an interval is divided into at once.
_MAX_PARTS = 4


class UnitTangents(NodeTangents):
    """Tangents by q, q̇, q̈ and the jerk of each point themselves: d = 4 n.

    Parameters
    ----------
    spline : Quintic
    dof : int
    """

    _tables: tuple[Array, ...]

    def __init__(self, spline: Quintic, dof: int) -> None:
        ones = np.eye(ORDERS * dof).reshape(ORDERS, dof, ORDERS * dof)
        shape = (len(spline.points.t), dof, ORDERS * dof)
        tables = tuple(np.broadcast_to(one, shape) for one in ones)
        object.__setattr__(self, "_tables", tables)
        super().__init__(tables[0], tables[1], spline.points)

    @override
    def of_order(self, order: int) -> Array:
        return self._tables[order]

    @override
    def picked(self, order: int, nodes: Ints, joints: Ints) -> Array:
        return np.asarray(self._tables[order][nodes, joints])


@dataclass(frozen=True, eq=False)
class PointRows:
    """Derivatives of constraint rows by y, the end states of their interval.

    Attributes
    ----------
    intervals : (R,)
    by_ends : (R, 6, n)
        ∂h/∂y, y the ends of the interval.
    """

    intervals: Ints
    by_ends: Array

    def along(self, changes: Array) -> Array:
        """Return the directional derivative of h for changes of y (N, 6, n), (R,)."""
        return _along(self.intervals, self.by_ends, changes)

    def add_pulled(self, found: Array, multipliers: Array) -> None:
        """Add the transposed product Σ multipliers ∂h/∂y to that of all rows, (N, 6, n)."""
        _add_pulled(self.intervals, self.by_ends, np.ascontiguousarray(multipliers), found)

    def add_squared(self, matrix: NodeMatrix, by: EndChanges, weights: Array) -> None:
        """Add Σ weights ∂h ∂hᵀ by the coordinates of all nodes."""
        matrix.add_rows(by, self.intervals, self.by_ends, weights)


class CollocationRows:
    """Rows of one constraint at the points of a spline, (2 N + 1, C): by point and column.

    Parameters
    ----------
    spline : Quintic
    item : BoundConstraint
    columns : slice
        The coordinates that it is a function of, among all.
    dof : int
        Number of all coordinates.

    Attributes
    ----------
    count : int
        C, once it was evaluated on any nodes.
    """

    def __init__(self, spline: Quintic, item: BoundConstraint, columns: slice, dof: int) -> None:
        self._spline, self.item = spline, item
        self._columns, self._dof = columns, dof
        self.count = 0

    def on(self, spline: Quintic) -> "CollocationRows":
        """Return the rows on other nodes."""
        found = CollocationRows(spline, self.item, self._columns, self._dof)
        found.count = self.count
        return found

    @property
    def shape(self) -> tuple[int, int]:
        """Number of points and of columns."""
        return len(self._spline.points.t), self.count

    def residuals(self, motion: SampledMotion) -> Array:
        """Return h, minus the part of the tolerance that is used."""
        h = self.item.residual(motion.seen_by(self.item))
        if len(h) != len(self._spline.points.t):
            raise ProblemError(
                f"constraint '{self.item.name}': its residual has shape {h.shape}, expected a "
                f"row for each of {len(self._spline.points.t)} nodes; what is asked of the "
                f"whole motion is asked at each of them"
            )
        self.count = h.shape[1]
        return h - self.item.granted

    def near(self, h: Array) -> Flags:
        """Return the mask of rows that enter the active set."""
        return np.asarray(h > _ACTIVE_ABOVE)

    @cached_property
    def _units(self) -> UnitTangents:
        return UnitTangents(self._spline, len(range(self._dof)[self._columns]))

    def linearised(self, motion: SampledMotion, active: Flags) -> PointRows:
        """Return the derivatives of the active rows."""
        which = np.flatnonzero(active)
        intervals, matrices = point_matrices(
            self._spline, which // self.count if which.size else which
        )
        found = np.zeros((len(which), 6, self._dof))
        if which.size:
            samples = motion.seen_by(self.item)
            rows = linearised(self.item, samples, self._units).picked(self._units, which)
            by = rows.reshape(len(which), ORDERS, -1)
            found[:, :, self._columns] = np.swapaxes(matrices, 1, 2) @ by
        return PointRows(intervals, found)

    def add_bending(
        self, matrix: NodeMatrix, by: EndChanges, motion: SampledMotion, multipliers: Array
    ) -> None:
        """Add the rows' second derivatives in the Lagrangian, Σ multipliers · ∂²h/∂w².

        Of rows that are sums of squares.
        """
        slopes = self.item.squares(motion.seen_by(self.item))
        if slopes is None:
            return
        slopes = np.sqrt(np.abs(multipliers))[:, :1, None] * slopes
        points, which = np.nonzero(slopes.any(axis=2))
        intervals, matrices = point_matrices(self._spline, points)
        rows = np.zeros((len(points), 6, self._dof))
        rows[:, :, self._columns] = matrices[:, 0, :, None] * slopes[points, which][:, None, :]
        PointRows(intervals, rows).add_squared(matrix, by, np.ones(len(points)))

    def multipliers_of(self, multipliers: Array) -> Multipliers:
        """Return the multipliers in the order of time."""
        used = np.ones(multipliers.shape, dtype=np.bool_)
        return Multipliers(self.item, multipliers, self._spline.points.t, used)

    def subdivisions(self, curve: SampledMotion) -> Ints:
        """Return the number of parts of each interval that the rows need, (N,)."""
        item, count = self.item, self._spline.count
        samples, found = curve.seen_by(item), np.ones(count, dtype=np.int64)
        beyond = item.exceeds(samples, item.tolerance)
        if beyond is not None:
            found[beyond.reshape(count, -1).any(axis=1)] = 2
            return found
        # A quantity without limits has no rows.
        h = np.asarray(item.residual(samples)).reshape(count, -1).max(axis=1, initial=-np.inf)
        if (h <= item.tolerance).all():
            return found
        used = item.granted
        need = np.sqrt(np.maximum(h - used, 0.0) / (_SUBDIVISION_TARGET * (item.tolerance - used)))
        # An interval with NaN, which compares false, is divided.
        need = np.where(h > -np.inf, need, _MAX_PARTS)
        return np.clip(np.ceil(need), 1, _MAX_PARTS).astype(np.int64)

    def carried(self, before: "CollocationRows", multipliers: Array) -> Array:
        """Return multipliers for these rows from those of the nearest points of the grid before."""
        t, known = self._spline.points.t, before._spline.points.t
        right = np.clip(np.searchsorted(known, t), 1, len(known) - 1)
        right -= t - known[right - 1] < known[right] - t
        return np.asarray(multipliers[right] * (len(known) / len(t)))


@kernel
def _add_pulled(intervals: Ints, by_ends: Array, multipliers: Array, found: Array) -> None:
    """Add Σ multipliers (R,) ∂h/∂y (R, 6, n) to those of the intervals, (N, 6, n)."""
    _, ends, n = by_ends.shape
    for i in range(len(intervals)):
        for a in range(ends):
            for j in range(n):
                found[intervals[i], a, j] += multipliers[i] * by_ends[i, a, j]


@kernel
def _along(intervals: Ints, by_ends: Array, changes: Array) -> Array:
    """Return Σ ∂h/∂y (R, 6, n) · changes (N, 6, n) of the rows, (R,)."""
    (count, ends, n), found = by_ends.shape, np.zeros(len(intervals))
    for i in range(count):
        for a in range(ends):
            for j in range(n):
                found[i] += by_ends[i, a, j] * changes[intervals[i], a, j]
    return found

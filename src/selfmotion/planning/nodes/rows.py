"""Constraints on a motion of nodes as rows h ≤ 0: each touches one interval, or two nodes.

Limits of joints are rows of control points of q, q̇, q̈ and the jerk: the curve is within their
convex hull. All other constraints are rows of collocation points of each interval. Only rows that
are near to being violated are active; the others are checked after each step.

Constraints are functions of the arm's joints, or of virtual joints: their columns among those of
all coordinates are filled in here.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from selfmotion.basics import Array, Flags, Ints
from selfmotion.model.motion import Sampling
from selfmotion.planning.formulation import CurveSamples, Formulation, SampledMotion, sampled
from selfmotion.planning.nodes.limit_kernels import LimitTable
from selfmotion.planning.nodes.limit_rows import ControlPointRows
from selfmotion.planning.nodes.node_matrix import EndChanges, NodeMatrix
from selfmotion.planning.nodes.point_rows import CollocationRows, PointRows
from selfmotion.planning.nodes.spline import Quintic, unit_bases
from selfmotion.problem.constraints import BoundConstraint, BoundLimits, DependsOn, Multipliers

# Shares of an interval at which constraints are checked between points.
_CHECKED = np.linspace(0.0, 1.0, 8, endpoint=False)
_AT_CHECKED = unit_bases(_CHECKED)


class NodeRows:
    """All rows of the conditions on a motion of nodes: those of limits, then those of points.

    Flattened, (R,).

    Parameters
    ----------
    spline : Quintic
    limits : sequence of ControlPointRows
    points : sequence of CollocationRows
    dof : int
        Number of coordinates.
    """

    def __init__(
        self,
        spline: Quintic,
        limits: Sequence[ControlPointRows],
        points: Sequence[CollocationRows],
        dof: int,
    ) -> None:
        self.spline, self.dof = spline, dof
        self.limits, self.points = tuple(limits), tuple(points)
        joints = [(rows.item, rows.joints) for rows in self.limits]
        self._table = LimitTable.of(joints, spline.count)

    @classmethod
    def of(
        cls,
        formulation: Formulation,
        spline: Quintic,
        limits: Sequence[BoundLimits],
        points: Sequence[BoundConstraint],
    ) -> "NodeRows":
        """Return the rows of a formulation's conditions."""
        n, dof = formulation.robot.dof, formulation.follows.dof
        columns = {DependsOn.ARM: slice(0, n), DependsOn.TOLERANCES: slice(n, dof)}
        first = {DependsOn.ARM: 0, DependsOn.TOLERANCES: n}
        return cls(
            spline,
            [ControlPointRows(spline, item, first[item.depends_on]) for item in limits],
            [CollocationRows(spline, item, columns[item.depends_on], dof) for item in points],
            dof,
        )

    @property
    def families(self) -> tuple[ControlPointRows | CollocationRows, ...]:
        """The rows of each constraint, in their order."""
        return (*self.limits, *self.points)

    def residuals(self, motion: Callable[[], SampledMotion], ends: Array) -> Array:
        """Return h of all rows, minus the part of the tolerance that is used, (R,).

        Half of each tolerance is reserved for rounding and for the motion between points.
        """
        limits = self._table.residuals(self.spline.rates, ends)
        if not self.points:
            return limits
        points = (rows.residuals(motion()).ravel() for rows in self.points)
        return np.concatenate([limits, *points])

    @cached_property
    def _places(self) -> list[tuple[slice, tuple[int, ...]]]:
        """Slice of each constraint's rows among all, and their shape."""
        shapes = [rows.shape for rows in self.families]
        ends = np.cumsum([0, *(int(np.prod(shape)) for shape in shapes)]).tolist()
        places = (slice(first, last) for first, last in pairwise(ends))
        return list(zip(places, shapes, strict=True))

    def on(self, spline: Quintic) -> "NodeRows":
        """Return the rows on other nodes."""
        limits = [rows.on(spline) for rows in self.limits]
        points = [rows.on(spline) for rows in self.points]
        return NodeRows(spline, limits, points, self.dof)

    def split(self, values: Any) -> list[Any]:
        """Return values of all rows, (R,), by constraint, in the shape of its rows."""
        return [values[place].reshape(shape) for place, shape in self._places]

    def near(self, h: Array) -> Flags:
        """Return the mask of nearly violated rows, (R,): of limits all of a joint and side."""
        limits = self._table.near(h, self.spline.count)
        if not self.points:
            return limits
        each = zip(self.points, self.of_points(h), strict=True)
        return np.concatenate([limits, *(rows.near(own).ravel() for rows, own in each)])

    def of_points(self, values: Any) -> list[Any]:
        """Return values of all rows, (R,), by constraint at points, in the shape of its rows."""
        places = self._places[len(self.limits) :] if self.points else ()
        return [values[place].reshape(shape) for place, shape in places]

    def linearised(self, motion: Callable[[], SampledMotion], active: Flags) -> "LinearRows":
        """Return the derivatives of the active rows, (R,)."""
        pairs = zip(self.points, self.of_points(active), strict=True)
        points = [rows.linearised(motion(), own) for rows, own in pairs]
        return LinearRows(self, active, points)

    def add_bending(
        self,
        matrix: NodeMatrix,
        by: EndChanges,
        motion: Callable[[], SampledMotion],
        multipliers: Array,
        *,
        without_tolerances: bool = False,
    ) -> None:
        """Add Σ multipliers · ∂²h/∂w² of rows that are sums of squares: their curvature."""
        for rows, own in zip(self.points, self.of_points(multipliers), strict=True):
            if own.any() and not (without_tolerances and is_tolerance(rows.item)):
                rows.add_bending(matrix, by, motion(), own)

    @cached_property
    def granted(self) -> Array:
        """Tolerance of each row that is not used, (R,)."""
        each = [
            np.full(place.stop - place.start, rows.item.tolerance - rows.item.granted)
            for rows, (place, _) in zip(self.families, self._places, strict=True)
        ]
        return np.concatenate([np.zeros(0), *each])


def by_kind(every: NodeRows, values: Any) -> tuple[list[Any], list[Any]]:
    """Return values of all rows, (R,), by constraint: of limits, and of points."""
    each = every.split(values)
    return each[: len(every.limits)], each[len(every.limits) :]


def multipliers_of(every: NodeRows, multipliers: Array, ends: Array) -> list[Multipliers]:
    """Return the multipliers by constraint, in the order of time, for those of all (R,)."""
    limits, points = by_kind(every, multipliers)
    return [
        *(rows.multipliers_of(own, ends) for rows, own in zip(every.limits, limits, strict=True)),
        *(rows.multipliers_of(own) for rows, own in zip(every.points, points, strict=True)),
    ]


def conservatism(every: NodeRows, multipliers: Array, ends: Array) -> Array:
    """Return a bound of the decrease of F if limits applied to the curve itself, (N,).

    To first order: multipliers times the distance of the control points from the curve.
    """
    found = np.zeros(every.spline.count)
    for rows, own in zip(every.limits, by_kind(every, multipliers)[0], strict=True):
        if own.any():
            found += rows.conservatism(own, ends)
    return found


def parts_wanted(every: NodeRows, curve: SampledMotion) -> Ints:
    """Return the number of parts of each interval that rows of points need, (N,).

    For the curve of `sampled_curve`: 1 where constraints are within their tolerances between
    the points as well. An excess over that at the points falls with the square of the parts.
    Where one interval has to be divided, so is one that is nearly violated: on the next nodes
    it would be.
    """
    found = np.ones(every.spline.count, dtype=np.int64)
    for rows in every.points:
        found = np.maximum(found, rows.subdivisions(curve))
    return found


def kinks(every: NodeRows, ends: Array) -> Flags:
    """Return the mask of intervals next to which limits of q̈ or jerk start to bind, (N,)."""
    found = np.zeros(every.spline.count, dtype=np.bool_)
    for rows in every.limits:
        if rows.item.order > 1:
            found |= rows.kinks(ends)
    return found


def carried(every: NodeRows, before: "NodeRows", multipliers: Array) -> Array:
    """Return the multipliers of these rows, (R,), by those of the nearest rows before."""
    limits, points = by_kind(before, multipliers)
    found = [
        np.zeros(0),
        *(
            rows.carried(old, own).ravel()
            for rows, old, own in zip(every.limits, before.limits, limits, strict=True)
        ),
        *(
            rows.carried(old, own).ravel()
            for rows, old, own in zip(every.points, before.points, points, strict=True)
        ),
    ]
    return np.concatenate(found)


def sampled_curve(formulation: Formulation, spline: Quintic, ends: Array) -> SampledMotion:
    """Return the motion with ends y at several shares of each interval."""
    times = (spline.t[:-1, None] + spline.steps[:, None] * _CHECKED).ravel()

    def at(order: int) -> Array:
        return spline.at(_AT_CHECKED, order, ends).reshape(-1, ends.shape[2])

    return sampled(formulation, CurveSamples(formulation.follows, Sampling.trapezoidal(times), at))


@dataclass(frozen=True, eq=False)
class LinearRows:
    """Derivatives of the active rows at one motion.

    Attributes
    ----------
    rows : NodeRows
    active : (R,)
        Mask of the active rows.
    points : list of PointRows
        Of each constraint at points.
    """

    rows: NodeRows
    active: Flags
    points: list[PointRows]

    def along(self, changes: Array) -> Array:
        """Return ∂h of the active rows along changes of y (N, 6, n)."""
        table = self.rows._table
        limits = table.along(self.rows.spline.rates, changes)[self.active[: table.size]]
        if not self.points:
            return limits
        return np.concatenate([limits, *(points.along(changes) for points in self.points)])

    def pulled(self, multipliers: Array) -> Array:
        """Return Σ multipliers ∂h/∂y, (N, 6, n), for multipliers of all rows.

        They are 0 of inactive rows.
        """
        rows = self.rows
        found = np.zeros((rows.spline.count, 6, rows.dof))
        rows._table.add_pulled(rows.spline.rates, multipliers, found)
        for points, own, active in zip(
            self.points, rows.of_points(multipliers), self._active_points, strict=True
        ):
            points.add_pulled(found, own[active])
        return found

    def add_squared(self, matrix: NodeMatrix, by: EndChanges, weights: Array) -> None:
        """Add Σ weights ∂h ∂hᵀ, for weights of all rows (R,), 0 of inactive ones."""
        rows = self.rows
        if rows.limits:
            forms = np.zeros((rows.spline.count, rows.dof, 6, 6))
            rows._table.add_squared(rows.spline.rates, weights, forms)
            matrix.add_joint_forms(by, forms)
        for points, own, active in zip(
            self.points, rows.of_points(weights), self._active_points, strict=True
        ):
            points.add_squared(matrix, by, own[active])

    @cached_property
    def _active_points(self) -> list[Flags]:
        """Mask of the active rows of each constraint at points."""
        return self.rows.of_points(self.active)


def is_tolerance(item: BoundConstraint) -> bool:
    """Whether rows are those of a tolerance: they bound a virtual joint, which has no cost."""
    return item.depends_on is DependsOn.TOLERANCES

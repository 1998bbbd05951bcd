"""Constraints on a motion of nodes as rows h ≤ 0: each touches one interval, or two nodes.

Limits of joints apply to the control points of q, q̇, q̈ and the jerk: the curve is within their
convex hull. All other constraints apply at points of each interval. Only rows that are near to
being violated are active; the others are checked after each step.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, Flags, Ints, ProblemError
from selfmotion.model.follow import Follows
from selfmotion.model.motion import Sampling
from selfmotion.planning.nodes.samples import CurveSamples
from selfmotion.planning.nodes.spline import (
    AT_CONTROLS,
    CONTROLS,
    ORDERS,
    Quintic,
    unit_bases,
)
from selfmotion.problem.constraints import (
    BoundClearance,
    BoundConstraint,
    BoundLimits,
    Multipliers,
    NodeTangents,
    linearised,
)
from selfmotion.problem.costs import Samples

# Rows of limits become active where h is above this [units of h].
_NEAR_LIMIT = -0.3
# The same of other rows: distances level off there.
_NEAR = -0.19
# A limit with less room than this is in use [units of h].
_USED = 0.01
# A limit whose control point is this near to it binds there [units of h].
_BINDS = 1e-3
# h of control points that two intervals share, on one of the two: it never becomes active.
_SHARED = -1e3
# Shares of an interval at which constraints are checked between points.
_CHECKED = np.linspace(0.0, 1.0, 8, endpoint=False)
_AT_CHECKED = unit_bases(_CHECKED)
# Share of the unused tolerance that a violation between points may use once intervals are
# subdivided.
_ROOM = 0.5
# Largest number of parts of an interval at once.
_MOST_PARTS = 4
# Shares of an interval at which the curve is compared with the control points.
_FINE = unit_bases(np.linspace(0.0, 1.0, 17))


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
    """Rows of points by y of their intervals.

    Attributes
    ----------
    intervals : (R,)
    by_ends : (R, 6, n)
        ∂h/∂y, y the ends of the interval.
    """

    intervals: Ints
    by_ends: Array

    def along(self, changes: Array) -> Array:
        """Return ∂h along changes of y (N, 6, n), (R,)."""
        return np.asarray(np.sum(self.by_ends * changes[self.intervals], axis=(1, 2)))

    def pulled(self, multipliers: Array, count: int) -> Array:
        """Return Σ multipliers ∂h/∂y, (count, 6, n)."""
        found = np.zeros((count, *self.by_ends.shape[1:]))
        np.add.at(found, self.intervals, multipliers[:, None, None] * self.by_ends)
        return found

    def squared(self, weights: Array, both: Array) -> Array:
        """Return Σ weights ∂h ∂hᵀ by w of both ends of each interval, (N, d, d)."""
        count, _, _, size = both.shape
        found = np.zeros((count, size, size))
        flat = both.reshape(count, -1, size)
        turned = np.swapaxes(self.by_ends, 1, 2).reshape(len(self.intervals), -1)
        order = np.argsort(self.intervals, kind="stable")
        starts = np.searchsorted(self.intervals[order], np.arange(count + 1))
        for k in np.flatnonzero(np.diff(starts)):
            own = order[starts[k] : starts[k + 1]]
            rows = turned[own] @ flat[k]
            found[k] = rows.T @ (weights[own, None] * rows)
        return found


class NodeRows:
    """All rows of the conditions on a motion of nodes, one constraint after the other.

    Of limits (N, 6 - o, 2, j): by interval, control point, upper and lower side, joint. Of others
    (2 N + 1, C): by point and column. Flattened, (R,).

    Parameters
    ----------
    spline : Quintic
    constraints : sequence of BoundConstraint
        Neither equalities nor conditions on the whole motion.
    dof : int

    Attributes
    ----------
    constraints : tuple of BoundConstraint
    dof : int
    """

    def __init__(self, spline: Quintic, constraints: Sequence[BoundConstraint], dof: int) -> None:
        self.spline, self.constraints = spline, tuple(constraints)
        self.dof = dof
        # Number of columns of each that is no limit, once it was evaluated on any nodes.
        self._columns: dict[int, int] = {}

    @cached_property
    def _units(self) -> UnitTangents:
        return UnitTangents(self.spline, self.dof)

    def residuals(self, samples: Samples, ends: Array) -> Array:
        """Return h of all rows, minus the part of the tolerance that is used, (R,).

        Half of each tolerance is reserved for rounding and for the motion between points.
        """
        found = [np.zeros(0)]
        for number, item in enumerate(self.constraints):
            if isinstance(item, BoundLimits):
                h = self._limits(item, ends, AT_CONTROLS)
                if item.order < ORDERS - 1:
                    h[:-1, -1] = _SHARED
            else:
                h = item.residual(samples)
                if len(h) != len(self.spline.points.t):
                    raise ProblemError(
                        f"constraint '{item.name}': its residual has shape {h.shape}, expected a "
                        f"row for each of {len(self.spline.points.t)} nodes; what is asked of the "
                        f"whole motion is asked at each of them"
                    )
                self._columns[number] = h.shape[1]
            found.append((h - _granted(item)).ravel())
        return np.concatenate(found)

    def _limits(self, item: BoundLimits, ends: Array, tables: tuple[Array, ...]) -> Array:
        """Return h of limits by shares of all intervals, (N, P, 2, j)."""
        x = self.spline.at(tables, item.order, ends)[:, :, item.joints]
        h = np.stack([x - item.upper, item.lower - x], axis=2)
        h /= item.scale
        h += item.margin
        return h

    @cached_property
    def _places(self) -> list[tuple[slice, tuple[int, ...]]]:
        """Slice of each constraint's rows among all, and their shape."""
        shapes = [self._shape(number) for number in range(len(self.constraints))]
        ends = np.cumsum([0, *(int(np.prod(shape)) for shape in shapes)]).tolist()
        places = (slice(first, last) for first, last in pairwise(ends))
        return list(zip(places, shapes, strict=True))

    def _shape(self, number: int) -> tuple[int, ...]:
        item = self.constraints[number]
        if isinstance(item, BoundLimits):
            return self.spline.count, CONTROLS[item.order], 2, len(item.joints)
        return len(self.spline.points.t), self._columns[number]

    def on(self, spline: Quintic) -> "NodeRows":
        """Return the rows on other nodes."""
        found = NodeRows(spline, self.constraints, self.dof)
        found._columns = self._columns
        return found

    def split(self, values: Any) -> list[Any]:
        """Return values of all rows, (R,), by constraint, in the shape of its rows."""
        return [values[place].reshape(shape) for place, shape in self._places]

    def near(self, h: Array) -> Flags:
        """Return the mask of nearly violated rows, (R,): of limits all of a joint and side."""
        found = [np.zeros(0, dtype=np.bool_)]
        for item, own in zip(self.constraints, self.split(h), strict=True):
            if isinstance(item, BoundLimits):
                column = (own > _NEAR_LIMIT).any(axis=(0, 1))
                found.append((column & (own > 0.5 * _SHARED)).ravel())
            else:
                found.append((own > _NEAR).ravel())
        return np.concatenate(found)

    def linearised(self, samples: Samples, active: Flags) -> "LinearRows":
        """Return the derivatives of the active rows, (R,)."""
        parts: list[PointRows | None] = []
        for item, own in zip(self.constraints, self.split(active), strict=True):
            if isinstance(item, BoundLimits):
                parts.append(None)
                continue
            which = np.flatnonzero(own)
            parts.append(self._points(item, samples, which, own.shape[1]))
        return LinearRows(self, active, parts)

    def _points(
        self, item: BoundConstraint, samples: Samples, which: Ints, columns: int
    ) -> PointRows:
        intervals, shares = self.spline.point_shares(which // columns)
        n = self.dof
        if not which.size:
            return PointRows(intervals, np.zeros((0, 6, n)))
        rows = linearised(item, samples, self._units).picked(self._units, which)
        by = rows.reshape(len(which), ORDERS, n)
        return PointRows(intervals, np.swapaxes(shares, 1, 2) @ by)

    def bending(
        self,
        samples: Samples,
        multipliers: Array,
        both: Array,
        *,
        without_tolerances: bool = False,
    ) -> Array | None:
        """Return Σ multipliers · ∂²h/∂w² of rows that are sums of squares: their curvature.

        By w of both ends of each interval, (N, d, d); None where there are none.
        """
        found = None
        for item, own in zip(self.constraints, self.split(multipliers), strict=True):
            squares = getattr(item, "squares", None)
            if squares is None or not own.any():
                continue
            if without_tolerances and counts_at_once(item):
                continue
            slopes = np.sqrt(np.abs(own))[:, :1, None] * squares(samples)
            points, which = np.nonzero(slopes.any(axis=2))
            intervals, shares = self.spline.point_shares(points)
            by = shares[:, 0, :, None] * slopes[points, which][:, None, :]
            one = PointRows(intervals, by).squared(np.ones(len(points)), both)
            found = one if found is None else found + one
        return found

    def multipliers_of(self, multipliers: Array, ends: Array) -> list[Multipliers]:
        """Return the multipliers by constraint, in the order of time, for those of all (R,)."""
        found = []
        for item, own in zip(self.constraints, self.split(multipliers), strict=True):
            if not isinstance(item, BoundLimits):
                used = np.ones(own.shape, dtype=np.bool_)
                found.append(Multipliers(item, own, self.spline.points.t, used))
                continue
            once = np.ones(own.shape[:2], dtype=np.bool_)
            if item.order < ORDERS - 1:
                once[:-1, -1] = False
            times = self.spline.times_of(item.order)[once]
            # The control polygon is outside of the curve.
            at = unit_bases(np.linspace(0.0, 1.0, CONTROLS[item.order]))
            used = self._limits(item, ends, at) > _granted(item) - _USED
            shape = len(times), -1
            found.append(
                Multipliers(item, own[once].reshape(shape), times, used[once].reshape(shape))
            )
        return found

    @cached_property
    def granted(self) -> Array:
        """Tolerance of each row that is not used, (R,)."""
        each = [
            np.full(place.stop - place.start, item.tolerance - _granted(item))
            for item, (place, _) in zip(self.constraints, self._places, strict=True)
        ]
        return np.concatenate([np.zeros(0), *each])

    def conservatism(self, multipliers: Array, ends: Array) -> Array:
        """Return a bound of the decrease of F if limits applied to the curve itself, (N,).

        To first order: multipliers times the distance of the control points from the curve.
        """
        found = np.zeros(self.spline.count)
        for item, own in zip(self.constraints, self.split(multipliers), strict=True):
            if isinstance(item, BoundLimits) and own.any():
                h = self._limits(item, ends, _FINE).max(axis=1) - _granted(item)
                found += (own.sum(axis=1) * np.maximum(-h, 0.0)).sum(axis=(1, 2))
        return found

    def subdivisions(self, curve: CurveSamples) -> Ints:
        """Return the number of parts of each interval that rows other than limits need, (N,).

        For the curve of `sampled_curve`: 1 where constraints are within their tolerances between
        the points as well. An excess over that at the points falls with the square of the parts.
        Where one interval has to be divided, so is one that is nearly violated: on the next nodes
        it would be.
        """
        found, count = np.ones(self.spline.count, dtype=np.int64), self.spline.count
        for item in self.constraints:
            if isinstance(item, BoundLimits):
                continue
            if isinstance(item, BoundClearance):
                beyond = np.asarray(item.above(curve, item.tolerance)).reshape(count, -1)
                found[beyond.any(axis=1)] = np.maximum(found[beyond.any(axis=1)], 2)
                continue
            # A quantity without limits has no rows.
            h = np.asarray(item.residual(curve)).reshape(count, -1).max(axis=1, initial=-np.inf)
            if not (h <= item.tolerance).all():
                used = _granted(item)
                need = np.sqrt(np.maximum(h - used, 0.0) / (_ROOM * (item.tolerance - used)))
                # Written so that NaN is divided.
                need = np.where(h > -np.inf, need, _MOST_PARTS)
                found = np.maximum(found, np.clip(np.ceil(need), 1, _MOST_PARTS).astype(np.int64))
        return found

    @property
    def has_point_rows(self) -> bool:
        """Whether there are constraints other than limits."""
        return any(not isinstance(item, BoundLimits) for item in self.constraints)

    def kinks(self, ends: Array) -> Flags:
        """Return the mask of intervals next to which limits of q̈ or jerk start to bind, (N,)."""
        found = np.zeros(self.spline.count, dtype=np.bool_)
        for item in self.constraints:
            if isinstance(item, BoundLimits) and item.order > 1:
                h = self._limits(item, ends, AT_CONTROLS) - _granted(item)
                each: Flags = np.asarray(h > -_BINDS)
                each = each.reshape(self.spline.count, CONTROLS[item.order], -1)
                binds: Flags = np.asarray(each.any(axis=1))
                found |= (binds & ~each.all(axis=1)).any(axis=1)
                change = (binds[1:] != binds[:-1]).any(axis=1)
                found[1:] |= change
                found[:-1] |= change
        return found

    def carried(self, before: "NodeRows", multipliers: Array) -> Array:
        """Return the multipliers of these rows, (R,), by those of the nearest rows before."""
        spline, old, found = self.spline, before.spline, [np.zeros(0)]
        middles = 0.5 * (spline.t[:-1] + spline.t[1:])
        k = np.searchsorted(old.t, middles) - 1
        for item, own in zip(self.constraints, before.split(multipliers), strict=True):
            if isinstance(item, BoundLimits):
                each = own.copy()
                if item.order < ORDERS - 1:
                    # The shared control point's, which is not stored here.
                    each[:-1, -1] = each[1:, 0]
                share = (spline.times_of(item.order) - old.t[k][:, None]) / old.steps[k][:, None]
                degree = CONTROLS[item.order] - 1
                place = np.clip(np.rint(share * degree), 0, degree).astype(np.int64)
                density = (spline.steps / old.steps[k])[:, None, None, None]
                found.append((each[k[:, None], place] * density).ravel())
            else:
                t, known = spline.points.t, old.points.t
                right = np.clip(np.searchsorted(known, t), 1, len(known) - 1)
                right -= t - known[right - 1] < known[right] - t
                found.append((own[right] * (len(known) / len(t))).ravel())
        return np.concatenate(found)


def sampled_curve(spline: Quintic, follows: Follows, ends: Array) -> CurveSamples:
    """Return the motion with ends y at several shares of each interval."""
    times = (spline.t[:-1, None] + spline.steps[:, None] * _CHECKED).ravel()

    def at(order: int) -> Array:
        return spline.at(_AT_CHECKED, order, ends).reshape(-1, ends.shape[2])

    return CurveSamples(follows, Sampling.trapezoidal(times), at)


def _granted(item: BoundConstraint) -> float:
    """Return the part of a tolerance that is used: control points need little in reserve."""
    return 0.5 * item.tolerance


@dataclass(frozen=True, eq=False)
class LinearRows:
    """Derivatives of the active rows at one motion.

    Attributes
    ----------
    rows : NodeRows
    active : (R,)
        Mask of the active rows.
    points : list of PointRows or None
        Of each constraint; None of limits.
    """

    rows: NodeRows
    active: Flags
    points: list[PointRows | None]

    def along(self, changes: Array) -> Array:
        """Return ∂h of the active rows along changes of y (N, 6, n)."""
        found, spline = [np.zeros(0)], self.rows.spline
        for item, own, part in self._each(self.active):
            if part is not None:
                found.append(part.along(changes))
            elif isinstance(item, BoundLimits) and own.any():
                x = spline.at(AT_CONTROLS, item.order, changes)[:, :, item.joints] / item.scale
                found.append(np.stack([x, -x], axis=2)[own])
        return np.concatenate(found)

    def pulled(self, multipliers: Array) -> Array:
        """Return Σ multipliers ∂h/∂y, (N, 6, n), for multipliers of all rows.

        They are 0 of inactive rows.
        """
        spline = self.rows.spline
        found = np.zeros((spline.count, 6, self.rows.dof))
        for (item, own, part), active in zip(self._each(multipliers), self._counting, strict=True):
            if part is not None:
                found += part.pulled(own[active], spline.count)
            elif isinstance(item, BoundLimits) and own.any():
                by = (own[:, :, 0] - own[:, :, 1]) / item.scale
                by *= spline.rates(item.order)[:, None, None]
                found[:, :, item.joints] += AT_CONTROLS[item.order].T @ by
        return found

    def squared(self, weights: Array) -> Array | None:
        """Return Σ weights ∂h ∂hᵀ of limits, by y of each joint: (N, n, 6, 6); None for none."""
        found, spline = None, self.rows.spline
        for item, own, _ in self._each(weights):
            if not isinstance(item, BoundLimits) or not own.any():
                continue
            if found is None:
                found = np.zeros((spline.count, self.rows.dof, 6, 6))
            each = own.sum(axis=2) / item.scale**2 * spline.rates(2 * item.order)[:, None, None]
            table = AT_CONTROLS[item.order]
            outer = (table[:, :, None] * table[:, None, :]).reshape(len(table), 36)
            by_joint = (np.swapaxes(each, 1, 2) @ outer).reshape(spline.count, -1, 6, 6)
            found[:, item.joints] += by_joint
        return found

    def squared_points(self, weights: Array, both: Array) -> Array | None:
        """Return Σ weights ∂h ∂hᵀ of others, by w of both ends of intervals; None for none."""
        found = None
        for (_, own, part), active in zip(self._each(weights), self._counting, strict=True):
            if part is not None and len(part.intervals):
                one = part.squared(own[active], both)
                found = one if found is None else found + one
        return found

    def _each(self, values: Any) -> list[tuple[BoundConstraint, Any, PointRows | None]]:
        return list(zip(self.rows.constraints, self.rows.split(values), self.points, strict=True))

    @cached_property
    def _counting(self) -> list[Flags]:
        """Mask of the active rows of each constraint."""
        return self.rows.split(self.active)


def counts_at_once(item: BoundConstraint) -> bool:
    """Whether rows are those of a tolerance: they bound a virtual joint, which has no cost."""
    return bool(getattr(item, "counts_at_once", False))


def accelerates_of(item: BoundConstraint, dof: int) -> bool:
    """Whether a constraint's quantity involves q̈, for motions of `dof` joints."""
    own = getattr(item, "is_of_accelerations", None)
    return own is not None and bool(own(dof))

"""The conditions on a motion given by its nodes: each depends on a node and its two neighbours.

They are asked for at the nodes and between each two, see `Hermite.between`: a limit of speed that
only the nodes keep would let the motion be faster between them.
"""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from selfmotion.basics import Array, Flags, Ints
from selfmotion.constraints import (
    BoundClearance,
    BoundConstraint,
    BoundLimits,
    NodeTangents,
    linearised,
)
from selfmotion.costs import Samples
from selfmotion.nodes.hermite import CheckedSamples
from selfmotion.nodes.spline import Hermite, weighted

# There is no interval after the last node: its conditions are kept by this much.
_NONE = -1e3


class _ByOrder(NodeTangents):
    """Tangents that are kept for each order of derivative."""

    _tables: dict[int, Array]

    def of_order(self, order: int) -> Array:
        """See `NodeTangents.of_order`."""
        return self._tables[order]

    def picked(self, order: int, nodes: Ints, joints: Ints) -> Array:
        """See `NodeTangents.picked`."""
        return np.asarray(self.of_order(order)[nodes, joints])


class NearTangents(_ByOrder):
    """How the motion at each point changes with the coordinates of the nodes around it.

    The d = 3 · 2r variables of a point, which are nodes and middles in turn, are those of the node
    before the last one, w of the last one (or of the point itself), and of the next one.

    Parameters
    ----------
    spline : Hermite
    changes : (N + 1, 2, n, 2r)
        ∂(q, q̇)/∂w of each node by its own.
    """

    _spline: Hermite
    _changes: Array

    def __init__(self, spline: Hermite, changes: Array) -> None:
        for name, value in (("_spline", spline), ("_changes", changes), ("_tables", {})):
            object.__setattr__(self, name, value)
        super().__init__(self.of_order(0), self.of_order(1), spline.checked)

    def of_order(self, order: int) -> Array:
        """See `NodeTangents.of_order`."""
        if order not in self._tables:
            self._tables[order] = self._made(order)
        return super().of_order(order)

    def _made(self, order: int) -> Array:
        spline, changes = self._spline, self._changes
        count, _, n, size = changes.shape
        before, own, after = (slice(x * size, (x + 1) * size) for x in range(3))
        table = np.zeros((2 * count - 1, n, 3 * size))
        if order < 2:
            table[::2, :, own] = changes[:, order]
        else:
            shares = spline.shares[order - 2]
            table[::2, :, own] = weighted(shares[:, 1], changes)
            table[2::2, :, before] = weighted(shares[1:, 0], changes[:-1])
            table[:-2:2, :, after] = weighted(shares[:-1, 2], changes[1:])
        middle = spline.between[order]
        table[1::2, :, own] = weighted(middle[:, :2], changes[:-1])
        table[1::2, :, after] = weighted(middle[:, 2:], changes[1:])
        return table


class UnitTangents(_ByOrder):
    """Tangents by q, q̇, q̈ and the jerk of each point themselves: d = 4 n."""

    def __init__(self, spline: Hermite, dof: int) -> None:
        ones = np.eye(4 * dof).reshape(4, dof, 4 * dof)
        shape = (len(spline.checked.t), dof, 4 * dof)
        tables = {order: np.broadcast_to(one, shape) for order, one in enumerate(ones)}
        object.__setattr__(self, "_tables", tables)
        super().__init__(tables[0], tables[1], spline.checked)


class NodeConditions:
    """All conditions h ≤ 0 at the nodes, then those in the middle after each, (N + 1, C).

    Parameters
    ----------
    spline : Hermite
    constraints : sequence of BoundConstraint
        None that is an equality or a condition on the whole motion.
    dof : int

    Attributes
    ----------
    constraints : tuple of BoundConstraint
    """

    def __init__(self, spline: Hermite, constraints: Sequence[BoundConstraint], dof: int) -> None:
        self.spline, self.constraints = spline, tuple(constraints)
        self._units = UnitTangents(spline, dof)
        self._counts: list[int] = []

    def residuals(self, samples: CheckedSamples) -> Array:
        """Return h, (N + 1, C)."""
        tables = [item.residual(samples) for item in self.constraints]
        self._counts = self._counts or [table.shape[1] for table in tables]
        half, first = sum(self._counts), 0
        found = np.full((len(self.spline.t), 2 * half), _NONE)
        for table, own in zip(tables, self._counts, strict=True):
            found[:, first : first + own] = table[::2]
            found[:-1, half + first : half + first + own] = table[1::2]
            first += own
        return found

    def broken(self, samples: Samples) -> Flags:
        """Return at which of other samples a condition is beyond its tolerance, (S,)."""
        return self._above(samples, [item.tolerance for item in self.constraints])

    def along(self, samples: CheckedSamples, near: float) -> Flags:
        """Return in the middle of which intervals a condition is kept by less than `near`, (N,)."""
        return self._above(samples, [-near] * len(self.constraints))[1::2]

    def _above(self, samples: Samples, levels: Sequence[float]) -> Flags:
        """Return at which samples a condition is above its constraint's level, (S,)."""
        found = np.zeros(len(samples.nodes), dtype=np.bool_)
        for item, level in zip(self.constraints, levels, strict=True):
            if isinstance(item, BoundClearance):
                found |= item.above(samples, level)
            else:
                found |= (item.residual(samples) > level).any(axis=1)
        return found

    @cached_property
    def tolerances(self) -> Array:
        """What h may be and still count as kept, (C,)."""
        each = [item.tolerance for item in self.constraints]
        return np.tile(np.repeat(each, self._counts), 2)

    def rows(self, samples: CheckedSamples, changes: Array, columns: Ints) -> Array:
        """Return ∂h/∂w of c columns, by w of each node and its neighbours, (N + 1, c, 6r)."""
        motion, count = NearTangents(self.spline, changes), len(self.spline.t)
        found = np.zeros((count, len(columns), motion.size))
        half = sum(self._counts)
        first = 0
        for item, own in zip(self.constraints, self._counts, strict=True):
            known = None
            for place, column in enumerate(columns):
                of_nodes, which = column < half, column % half - first
                if not 0 <= which < own:
                    continue
                known = known or linearised(item, samples, motion)
                points = np.arange(0 if of_nodes else 1, 2 * count - 1, 2)
                found[: len(points), place] = known.picked(motion, points * own + which)
            first += own
        return found

    @property
    def any_at_once(self) -> bool:
        """Whether some conditions count at once: what is best without them is far off."""
        return any(self._at_once)

    @property
    def _at_once(self) -> list[bool]:
        return [getattr(item, "counts_at_once", False) for item in self.constraints]

    def at_once(self) -> Ints:
        """Return which conditions do."""
        each = np.array(self._at_once, dtype=np.bool_)
        return np.flatnonzero(np.tile(np.repeat(each, self._counts), 2))

    def bending(
        self, samples: CheckedSamples, prices: Array, changes: Array
    ) -> tuple[Array, Array] | None:
        """Return Σ prices · ∂²h/∂w² of conditions that are sums of squares: what they bend by.

        By w of each node, (N + 1, 2r, 2r), and by w of both ends of each interval, (N, 4r, 4r);
        None where there are none. `prices` are (N + 1, C).
        """
        count, _, _, size = changes.shape
        nodes, intervals = np.zeros((count, size, size)), np.zeros((count - 1, 2 * size, 2 * size))
        found, middle = False, self.spline.between[0]
        for item, own in zip(self.constraints, self.by_constraint(prices), strict=True):
            squares = getattr(item, "squares", None)
            if squares is None or not own.any():
                continue
            found = True
            # (2 N + 1, c, n), each with its price.
            slopes = np.sqrt(np.abs(own))[:, :1, None] * squares(samples)
            at_node = slopes[::2] @ changes[:, 0]
            nodes += np.swapaxes(at_node, 1, 2) @ at_node
            both = np.concatenate(
                [weighted(middle[:, :2], changes[:-1]), weighted(middle[:, 2:], changes[1:])], 2
            )
            between = slopes[1::2] @ both
            intervals += np.swapaxes(between, 1, 2) @ between
        return (nodes, intervals) if found else None

    def of_bodies(self) -> Flags:
        """Return which conditions are distances of bodies, (C,)."""
        each = [isinstance(item, BoundClearance) for item in self.constraints]
        return np.tile(np.repeat(np.array(each, dtype=np.bool_), self._counts), 2)

    def orders(self, samples: CheckedSamples) -> Ints:
        """Return the highest derivative of q that each condition depends on, (C,)."""
        found = [np.zeros(0, dtype=np.int64)]
        for item in self.constraints:
            if isinstance(item, BoundLimits):
                found.append(np.full(2 * len(item.joints), item.order))
                continue
            known = linearised(item, samples, self._units)
            own = known.count // (2 * len(self.spline.t) - 1)
            if isinstance(item, BoundClearance):
                found.append(np.zeros(own, dtype=np.int64))
                continue
            # At all points: a square of what is 0, as at rest, has no slope.
            rows = known.picked(self._units, np.arange(known.count))
            does = np.any(rows.reshape(-1, own, 4, rows.shape[1] // 4) != 0.0, axis=(0, 3))
            does[:, 0] = True
            found.append(3 - np.argmax(np.flip(does, axis=1), axis=1))
        return np.tile(np.concatenate(found), 2)

    def by_constraint(self, table: Array) -> list[Array]:
        """Return what is like h, (N + 1, C), for each constraint, (2 N + 1, c) each."""
        half = table.shape[1] // 2
        points = np.empty((2 * len(table) - 1, half))
        points[::2], points[1::2] = table[:, :half], table[:-1, half:]
        return np.split(points, np.cumsum(self._counts)[:-1], axis=1)

    def pulled(self, samples: CheckedSamples, prices: Array) -> Array:
        """Return Σ prices · ∂h/∂(q, q̇) of the nodes, (N + 1, 2, n); `prices` are (N + 1, C)."""
        n = samples.q.shape[1]
        by = np.zeros((2 * len(prices) - 1, 4 * n))
        least = 1e-9 * prices.max(initial=0.0)
        for item, own in zip(self.constraints, self.by_constraint(prices), strict=True):
            which = np.flatnonzero(own.ravel() > least)
            if which.size:
                rows = linearised(item, samples, self._units).picked(self._units, which)
                np.add.at(by, which // own.shape[1], own.ravel()[which, None] * rows)
        found = np.stack([by[::2, :n], by[::2, n : 2 * n]], axis=1)
        for order in range(4):
            own = by[:, order * n : (order + 1) * n]
            middle = self.spline.between[order][:, :, None] * own[1::2, None]
            found[:-1] += middle[:, :2]
            found[1:] += middle[:, 2:]
            if order > 1:
                shares, here = self.spline.shares[order - 2][:, :, :, None], own[::2]
                found += shares[:, 1] * here[:, None]
                found[:-1] += shares[1:, 0] * here[1:, None]
                found[1:] += shares[:-1, 2] * here[:-1, None]
        return found


def spread(near: Array) -> Array:
    """Return what each node's three (N + 1, 3 s) mean for the nodes' own, (N + 1, s)."""
    size = near.shape[1] // 3
    found = np.array(near[:, size : 2 * size])
    found[:-1] += near[1:, :size]
    found[1:] += near[:-1, 2 * size :]
    return found

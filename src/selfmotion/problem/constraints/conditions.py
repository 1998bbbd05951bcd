"""Conditions h ≤ 0 or h = 0 at the nodes of the grid, as the optimiser sees them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import ClassVar, NamedTuple, Protocol

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, Flags, Ints, ProblemError
from selfmotion.certificate import Column, Quantity
from selfmotion.model.motion import Sampling
from selfmotion.problem.costs import Samples


@dataclass(frozen=True, eq=False)
class NodeTangents:
    """Derivatives of the motion at the nodes by d decision variables.

    Attributes
    ----------
    q, qd : (N + 1, n, d)
    sampling : Sampling
        When.
    """

    q: Array
    qd: Array
    sampling: Sampling

    @property
    def size(self) -> int:
        """The number d of variables."""
        return int(self.q.shape[2])

    def picked(self, order: int, nodes: Ints, joints: Ints) -> Array:
        """Return the tangents of some of the joints at some of the nodes (k,), (k, d)."""
        if order < 2:
            return (self.q, self.qd)[order][nodes, joints]
        rows = np.empty((len(nodes), self.size))
        operator = self.sampling.node_differentiation(order - 1)
        for joint in np.unique(joints):
            own = joints == joint
            rows[own] = operator[nodes[own]] @ self.qd[:, joint]
        return rows

    def of_order(self, order: int) -> Array:
        """Return the tangents of q (0), q̇ (1), q̈ (2) or the jerk (3), (N + 1, n, d)."""
        return (self.q, self.qd)[order] if order < 2 else self._faster[order - 2]

    @cached_property
    def _faster(self) -> tuple[Array, Array]:
        flat = self.qd.reshape(len(self.qd), -1)
        operators = (self.sampling.node_differentiation(order) for order in (1, 2))
        first, second = ((operator @ flat).reshape(self.qd.shape) for operator in operators)
        return first, second


class DependsOn(Enum):
    """Coordinates z = (q, δ) that a condition is a function of.

    δ are those of the virtual joints that tolerances are planned with.
    """

    ARM = "q"
    TOLERANCES = "δ"
    ALL = "(q, δ)"


class BoundConstraint(ABC):
    """A condition h ≤ 0, or h = 0, on the motion of one arm at the nodes of the grid.

    Attributes
    ----------
    name : str
        Its name in messages.
    tolerance : float
        Largest h (|h| for an equality) that counts as satisfied.
    equality : bool
        Whether h = 0 is meant, rather than h ≤ 0.
    depends_on : DependsOn
        The coordinates that it is a function of: those of samples and tangents. Of conditions at
        all times the joints, or the tolerances; only ends are of all.
    """

    name: str
    tolerance: float
    equality: ClassVar[bool] = False
    depends_on: ClassVar[DependsOn] = DependsOn.ARM

    @property
    def granted(self) -> float:
        """The part of the tolerance that the optimiser uses: half is kept in reserve."""
        return 0.5 * self.tolerance

    @abstractmethod
    def residual(self, samples: Samples) -> Array:
        """Return h: (N + 1, C) for conditions at every node, (1, C) for those on the ends."""

    @abstractmethod
    def tangents(self, samples: Samples, motion: NodeTangents) -> Array:
        """Return ∂h/∂x for d variables: h's shape with d appended.

        Row k of h depends on the motion at sample k alone: conditions between two times have no
        place here.
        """

    @abstractmethod
    def describe(self, samples: Samples, row: int, column: int) -> str:
        """Return the violation at h[row, column] in words, with names and numbers."""

    def linearised_at(self, samples: Samples) -> tuple[tuple[int, int], Linear] | None:
        """Return the shape of h, and a `Linear` that computes the requested rows alone.

        By default None: all `tangents` are computed.
        """
        return None

    def easing(self, column: int) -> tuple[float, str]:
        """Return a relaxation of h for a little less strict condition, and the same in words.

        For example ``(0.02, "2 % more speed for joint 'elbow'")``. Columns with the same words are
        relaxed together. A number at the start of the words is reduced where the cost would fall by
        more than a first derivative can predict.
        """
        return 0.01, f"0.01 more of {self.name}"

    def squares(self, samples: Samples) -> Array | None:
        """Return slopes (K, c, n) by q whose sum of squares is the curvature of h.

        By default None: the curvature of h is left out.
        """
        return None

    def uses_accelerations(self, dof: int) -> bool:
        """Return whether h depends on q̈, for an arm of `dof` joints; by default it does not."""
        return False

    def exceeds(self, samples: Samples, level: float) -> Flags | None:
        """Return at which samples some h is above a level, (S,), where `residual` takes longer.

        By default None: `residual` is evaluated.
        """
        return None

    def stricter(self, by: float) -> BoundConstraint | None:
        """Return the condition with a larger distance [m]; None where it is on no distance."""
        return None


class Linear(Protocol):
    """Derivatives of conditions by the motion of the nodes, at one motion."""

    def picked(self, motion: NodeTangents, rows: Ints, columns: Ints) -> Array:
        """Return the tangents of some rows and columns of h, (k,) each: (k, d)."""


class Linearised:
    """The derivatives of a constraint's conditions at one motion, all of h in one row.

    Parameters
    ----------
    shape : (int, int)
        That of h.
    known : Linear or (rows × columns, d)
    """

    def __init__(self, shape: tuple[int, int], known: Linear | Array) -> None:
        self._shape, self._known = shape, known

    @property
    def count(self) -> int:
        """Number C of conditions."""
        return self._shape[0] * self._shape[1]

    def picked(self, motion: NodeTangents, which: Ints) -> Array:
        """Return the rows (k, d) of some conditions (k,)."""
        known = self._known
        if isinstance(known, np.ndarray):
            return known[which]
        return known.picked(motion, *np.divmod(which, self._shape[1]))


def linearised(bound: BoundConstraint, samples: Samples, motion: NodeTangents) -> Linearised:
    """Return the derivatives of a constraint's conditions at a motion.

    By its `BoundConstraint.linearised_at`, else all `tangents`; ProblemError if these do not have
    the expected shape.
    """
    own = bound.linearised_at(samples)
    if own is not None:
        return Linearised(*own)
    tangents = bound.tangents(samples, motion)
    if np.ndim(tangents) != 3 or tangents.shape[2] != motion.size:
        raise ProblemError(
            f"constraint '{bound.name}': tangents() has shape {np.shape(tangents)}, expected that "
            f"of the residual with ({motion.size},) appended"
        )
    return Linearised(tangents.shape[:2], tangents.reshape(-1, motion.size))


def motion_of_order(samples: Samples, order: int) -> Array:
    """Return q (0), q̇ (1), q̈ (2) or the jerk (3) at the nodes, (N + 1, n)."""
    table = (samples.q, samples.qd)[order] if order < 2 else (samples.qdd, samples.qddd)[order - 2]
    nodes: Array = table[samples.nodes]
    return nodes


def motion_at_nodes(samples: Samples) -> tuple[Array, Array, Array]:
    """Return q, q̇ and q̈ at the nodes, (N + 1, n) each."""
    q, qd, qdd = (motion_of_order(samples, order) for order in range(3))
    return q, qd, qdd


@dataclass(frozen=True, eq=False)
class BoundQuantity(BoundConstraint):
    """A quantity's limits, for the columns that have one, with a margin.

    Of numbers h = ±x / limit - 1 + margin, with x the distance from the centre; of vectors
    h = |x|² / limit² - (1 - margin)².

    Attributes
    ----------
    quantity : Quantity
    margin : float
        Share of each limit that is aimed to be left unused; at least half of it is.
    """

    quantity: Quantity
    margin: float
    name: str = field(init=False)
    tolerance: float = field(init=False)

    def __post_init__(self) -> None:
        # Half the margin is left.
        left = (1.0 - 0.5 * self.margin) ** 2 - (1.0 - self.margin) ** 2
        tolerance = 0.5 * self.margin if self.quantity.components == 1 else left
        object.__setattr__(self, "name", self.quantity.name)
        object.__setattr__(self, "tolerance", tolerance)

    @override
    def residual(self, samples: Samples) -> Array:
        used = self._used(samples)
        if self.quantity.components == 1:
            return np.hstack([used, -used]) - 1.0 + self.margin
        return np.asarray(np.sum(used**2, axis=2) - (1.0 - self.margin) ** 2)

    @override
    def tangents(self, samples: Samples, motion: NodeTangents) -> Array:
        slopes = self._slopes(samples)
        every = (np.einsum("kmj,kjd->kmd", by, motion.of_order(k)) for k, by in enumerate(slopes))
        return np.asarray(sum(every))

    @override
    def linearised_at(self, samples: Samples) -> tuple[tuple[int, int], Linear]:
        slopes = self._slopes(samples)
        rows, columns, _ = slopes[0].shape
        return (rows, columns), _ByMotion(slopes)

    def _slopes(self, samples: Samples) -> tuple[Array, ...]:
        """Return ∂h by q, and by q̇ and q̈ where it depends on these, (N + 1, C, n) each."""
        changes = self.quantity.derivatives(*motion_at_nodes(samples))
        some, limit = self.quantity.limited, self._limit
        if self.quantity.components == 1:
            above = [part[:, some] / limit[:, None] for part in changes]
            return tuple(np.concatenate([part, -part], axis=1) for part in above)
        share = 2.0 * self._used(samples) / limit[:, None]
        return tuple(np.einsum("kmc,kmcj->kmj", share, part[:, some]) for part in changes)

    @override
    def uses_accelerations(self, dof: int) -> bool:
        somewhere = np.full((1, dof), 0.3)
        changes = self.quantity.derivatives(somewhere, somewhere, somewhere)
        return len(changes) > 2 and bool(np.any(changes[2][:, self.quantity.limited]))

    @override
    def squares(self, samples: Samples) -> Array | None:
        # Where a limit is narrow, its curvature is all that limits a step: a vector at the edge of
        # its limit keeps its length to first order whichever way it turns.
        if self.quantity.components == 1 or len(self.quantity.columns) > 1:
            return None
        changes = self.quantity.derivatives(*motion_at_nodes(samples))
        slopes = np.sqrt(2.0) / float(self.quantity.bounds[0]) * changes[0][:, 0]
        # The dependence on q̇, if any, is left to the first derivatives.
        return np.asarray(slopes if len(changes) == 1 else np.zeros_like(slopes))

    @override
    def easing(self, column: int) -> tuple[float, str]:
        # In both directions.
        share = 0.02 if self.quantity.components == 1 else 0.04
        return share, f"2 % more room for the {self._column(column).label}"

    @override
    def describe(self, samples: Samples, row: int, column: int) -> str:
        which = column % len(self.quantity.limited)
        away = self._used(samples)[row, which] * self._limit[which]
        size = float(away) if self.quantity.components == 1 else float(np.linalg.norm(away))
        time = float(samples.sampling.node_times[row])
        return self.quantity.said(int(self.quantity.limited[which]), size, time)

    @property
    def _limit(self) -> Array:
        return self.quantity.bounds[self.quantity.limited]

    def _column(self, column: int) -> Column:
        limited = self.quantity.limited
        return self.quantity.columns[int(limited[column % len(limited)])]

    def _used(self, samples: Samples) -> Array:
        """Return shares of limits at the nodes, (N + 1, m) or of vectors (N + 1, m, c)."""
        away = self.quantity.away(*motion_at_nodes(samples))[:, self.quantity.limited]
        return np.asarray(away / (self._limit if away.ndim == 2 else self._limit[:, None]))


class _ByMotion(NamedTuple):
    """Derivatives of a quantity's conditions, by those of h by q, q̇ and q̈, (N + 1, C, n) each."""

    slopes: tuple[Array, ...]

    def picked(self, motion: NodeTangents, rows: Ints, columns: Ints) -> Array:
        found = np.zeros((len(rows), motion.size))
        for order, by in enumerate(self.slopes):
            found += np.einsum("kj,kjd->kd", by[rows, columns], motion.of_order(order)[rows])
        return found


# Weight of a violation, squared and integrated, at which a constraint counts as ten times the cost.
_NOTICED = 2e-3


Evaluated = Iterable[tuple[BoundConstraint, Samples]]
"""Conditions, each with the motion in the coordinates that it is a function of."""


def violated(conditions: Evaluated) -> tuple[str, ...]:
    """Return a message for each violated condition, on its worst place."""
    messages = []
    for item, samples in conditions:
        h = item.residual(samples)
        size = np.abs(h) if item.equality else h
        # Written so that NaN counts as violated.
        if not np.max(size, initial=-np.inf) <= item.tolerance:
            row, column = np.unravel_index(int(np.argmax(size)), h.shape)
            text = item.describe(samples, int(row), int(column))
            messages.append(f"{item.name}: {text}")
    return tuple(messages)


def worst_time(conditions: Evaluated) -> float | None:
    """Return the time [s] of the largest violation of inequalities; None where all hold."""
    worst, time = 0.0, None
    for item, samples in conditions:
        if not item.equality:
            h = item.residual(samples).max(axis=1, initial=-np.inf)
            row = int(np.argmax(h))
            if h[row] > max(worst, item.tolerance):
                worst, time = float(h[row]), float(samples.sampling.node_times[row])
    return time


def penalised(cost: float, conditions: Evaluated) -> float:
    """Return a cost, much larger where conditions are violated: for ranking motions."""
    return cost + max(abs(cost), 1e-3) * penalty(conditions)


def penalty(conditions: Evaluated) -> float:
    """Return up to 10 for each violated condition, 0 where all hold."""
    total = 0.0
    for item, samples in conditions:
        steps = np.diff(samples.sampling.node_times)
        shares = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
        h = item.residual(samples)
        bad = np.abs(h) if item.equality else np.maximum(h, 0.0)
        weights = np.ones(1) if len(h) == 1 else shares
        total += 10.0 * min(1.0, float(np.sum(weights[:, None] * bad**2)) / _NOTICED)
    return total

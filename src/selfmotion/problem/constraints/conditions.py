"""Conditions h ≤ 0 or h = 0 at the nodes of the grid, their violations and multipliers."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from selfmotion.basics import Array, Flags, Ints, ProblemError
from selfmotion.certificate import Column, Quantity
from selfmotion.model.motion import Sampling
from selfmotion.problem.costs import Samples

# Conditions h ≤ 0 or h = 0 on the motion at the nodes of the grid, as the optimiser sees them.
#


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


class BoundConstraint(Protocol):
    """A condition on the motion of one arm."""

    @property
    def name(self) -> str:
        """Its name in messages."""

    @property
    def equality(self) -> bool:
        """Whether h = 0 is meant, rather than h ≤ 0."""

    @property
    def tolerance(self) -> float:
        """Largest h (|h| for an equality) that counts as satisfied."""

    def residual(self, samples: Samples) -> Array:
        """Return h: (N + 1, C) for conditions at every node, (1, C) for those on the ends."""

    def tangents(self, samples: Samples, motion: NodeTangents) -> Array:
        """Return ∂h/∂x for d variables: h's shape with d appended."""

    def describe(self, samples: Samples, row: int, column: int) -> str:
        """Return the violation at h[row, column] in words, with names and numbers."""


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

    The result of its own ``linearised_at(samples)``, if any: the shape of h, and a `Linear` that
    computes the requested rows alone. By default all `tangents`; ProblemError if these do not have
    the expected shape.
    """
    own = getattr(bound, "linearised_at", None)
    if callable(own):
        return Linearised(*own(samples))
    tangents = bound.tangents(samples, motion)
    if np.ndim(tangents) != 3 or tangents.shape[2] != motion.size:
        raise ProblemError(
            f"constraint '{bound.name}': tangents() has shape {np.shape(tangents)}, expected that "
            f"of the residual with ({motion.size},) appended"
        )
    return Linearised(tangents.shape[:2], tangents.reshape(-1, motion.size))


def easing_of(bound: BoundConstraint, column: int) -> tuple[float, str]:
    """Return a relaxation of h for a little less strict condition, and the same in words.

    The result of a constraint's own `easing(column)`, if any: ``(0.02, "2 % more speed for joint
    'elbow'")``. Columns with the same words are relaxed together. A number at the start of the
    words is reduced where the cost would fall by more than a first derivative can predict.
    """
    own = getattr(bound, "easing", None)
    return (0.01, f"0.01 more of {bound.name}") if own is None else own(column)


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
class BoundQuantity:
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
    equality = False

    @property
    def name(self) -> str:
        """See `BoundConstraint.name`."""
        return self.quantity.name

    @property
    def tolerance(self) -> float:
        """See `BoundConstraint.tolerance`: half the margin is left."""
        if self.quantity.components == 1:
            return 0.5 * self.margin
        return (1.0 - 0.5 * self.margin) ** 2 - (1.0 - self.margin) ** 2

    def residual(self, samples: Samples) -> Array:
        """See `BoundConstraint.residual`."""
        used = self._used(samples)
        if self.quantity.components == 1:
            return np.hstack([used, -used]) - 1.0 + self.margin
        return np.asarray(np.sum(used**2, axis=2) - (1.0 - self.margin) ** 2)

    def tangents(self, samples: Samples, motion: NodeTangents) -> Array:
        """See `BoundConstraint.tangents`."""
        changes = self.quantity.derivatives(*motion_at_nodes(samples))
        some, limit = self.quantity.limited, self._limit
        pairs = zip(changes, (motion.of_order(k) for k in range(3)), strict=False)
        by = np.asarray(sum(np.einsum("k...j,kjd->k...d", part[:, some], x) for part, x in pairs))
        if self.quantity.components == 1:
            above = by / limit[:, None]
            return np.concatenate([above, -above], axis=1)
        by /= limit[:, None, None]
        return np.asarray(2.0 * np.einsum("kmc,kmcd->kmd", self._used(samples), by))

    def is_of_accelerations(self, dof: int) -> bool:
        """Whether a limited quantity depends on q̈, for an arm of `dof` joints."""
        somewhere = np.full((1, dof), 0.3)
        changes = self.quantity.derivatives(somewhere, somewhere, somewhere)
        return len(changes) > 2 and bool(np.any(changes[2][:, self.quantity.limited]))

    @property
    def squares(self) -> Callable[[Samples], Array] | None:
        """``squares(samples)`` → slopes (K, c, n) whose squares h bends by; None of numbers.

        Where a limit is narrow, its curvature is all that limits a step: a vector at the edge of
        its limit keeps its length to first order whichever way it turns.
        """
        is_vector = self.quantity.components > 1 and len(self.quantity.columns) == 1
        return self._squares if is_vector else None

    def _squares(self, samples: Samples) -> Array:
        changes = self.quantity.derivatives(*motion_at_nodes(samples))
        slopes = np.sqrt(2.0) / float(self.quantity.bounds[0]) * changes[0][:, 0]
        # The dependence on q̇, if any, is left to the first derivatives.
        return np.asarray(slopes if len(changes) == 1 else np.zeros_like(slopes))

    def easing(self, column: int) -> tuple[float, str]:
        """See `easing_of`: 2 % of a limit, in both directions."""
        share = 0.02 if self.quantity.components == 1 else 0.04
        return share, f"2 % more room for the {self._column(column).label}"

    def describe(self, samples: Samples, row: int, column: int) -> str:
        """See `BoundConstraint.describe`."""
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


# Weight of a violation, squared and integrated, at which a constraint counts as ten times the cost.
_NOTICED = 2e-3


def violated(constraints: Sequence[BoundConstraint], samples: Samples) -> tuple[str, ...]:
    """Return a message for each violated constraint, on its worst place."""
    messages = []
    for item in constraints:
        h = item.residual(samples)
        size = np.abs(h) if item.equality else h
        # Written so that NaN counts as violated.
        if not np.max(size, initial=-np.inf) <= item.tolerance:
            row, column = np.unravel_index(int(np.argmax(size)), h.shape)
            text = item.describe(samples, int(row), int(column))
            messages.append(f"{item.name}: {text}")
    return tuple(messages)


def worst_time(constraints: Sequence[BoundConstraint], samples: Samples) -> float | None:
    """Return the time [s] of the largest violation of inequalities; None where all hold."""
    worst, time = 0.0, None
    for item in constraints:
        if not item.equality:
            h = item.residual(samples).max(axis=1, initial=-np.inf)
            row = int(np.argmax(h))
            if h[row] > max(worst, item.tolerance):
                worst, time = float(h[row]), float(samples.sampling.node_times[row])
    return time


def penalised(cost: float, constraints: Sequence[BoundConstraint], samples: Samples) -> float:
    """Return a cost, much larger where constraints are violated: for ranking motions."""
    return cost + max(abs(cost), 1e-3) * penalty(constraints, samples)


def penalty(constraints: Sequence[BoundConstraint], samples: Samples) -> float:
    """Return up to 10 for each violated constraint, 0 where all hold."""
    steps, total = np.diff(samples.sampling.node_times), 0.0
    shares = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
    for item in constraints:
        h = item.residual(samples)
        bad = np.abs(h) if item.equality else np.maximum(h, 0.0)
        weights = np.ones(1) if len(h) == 1 else shares
        total += 10.0 * min(1.0, float(np.sum(weights[:, None] * bad**2)) / _NOTICED)
    return total


# Active constraints, from the multipliers of conditions.

# A condition is active if its multiplier is above this share of its largest one: interior points
# leave small multipliers everywhere.
_ACTIVE = 1e-3
# Number at the start of the words of a relaxation.
_SIZE = re.compile(r"\d+(\.\d+)?")


@dataclass(frozen=True)
class ActiveConstraint:
    """An active constraint: one that keeps the plan from a lower cost.

    Attributes
    ----------
    constraint : str
        Its name.
    easing : str
        A small relaxation of it in words, with the joint or the pair.
    saving : float
        Decrease of F by that relaxation, to first order: the sum of the Lagrange multipliers times
        its amount. A larger relaxation saves less than in proportion; the amount is so small that
        this is some hundredth of F at most.
    spans : tuple of (float, float)
        First and last time [s] of each interval on which it is active.
    """

    constraint: str
    easing: str
    saving: float
    spans: tuple[tuple[float, float], ...]


class Multipliers(NamedTuple):
    """Lagrange multipliers of a constraint's conditions.

    Attributes
    ----------
    item : BoundConstraint
    multipliers : (K, C)
    times : (K,)
        Times [s], increasing; a single one for a condition on the whole motion.
    used : (K, C)
        Mask of conditions without room, as far as multipliers show.
    """

    item: BoundConstraint
    multipliers: Array
    times: Array
    used: Flags


def active_of(
    each: Sequence[Multipliers], span: Array, least: float, most: float = np.inf
) -> tuple[ActiveConstraint, ...]:
    """Return the active constraints by decreasing saving, without those that save below `least`.

    `span` (2,) is the time of start and end of the motion [s]. A relaxation that would save more
    than `most` is reduced: a first derivative is not valid that far.
    """
    found: dict[tuple[str, str], tuple[float, Array, Array, Array]] = {}
    for item, signed, times, used in each:
        multipliers = np.abs(signed)
        for column in np.flatnonzero(multipliers.any(axis=0)):
            amount, words = easing_of(item, int(column))
            none = 0.0, np.zeros(len(multipliers)), np.zeros(len(multipliers)), times
            saving, multiplier, at, _ = found.get((item.name, words), none)
            own = multipliers[:, column]
            at = np.maximum(at, np.where(used[:, column], own, 0.0))
            found[item.name, words] = (
                *(saving + amount * float(own.sum()), np.maximum(multiplier, own)),
                *(at, times),
            )
    selected = []
    for (name, words), (saving, multiplier, at, times) in found.items():
        if saving >= least:
            active = (at if at.any() else multiplier) > _ACTIVE * multiplier.max()
            spans = _intervals(
                active if active.any() else multiplier == multiplier.max(), times, span
            )
            selected.append((saving, ActiveConstraint(name, *_eased(words, saving, most), spans)))
    return tuple(item for _, item in sorted(selected, key=lambda item: -item[0]))


def _eased(words: str, saving: float, most: float) -> tuple[str, float]:
    """Return a relaxation in words and its saving, reduced so that it saves at most `most`."""
    size = _SIZE.match(words)
    if size is None or saving <= most:
        return words, saving
    whole = float(size[0])
    reported = f"{whole * most / saving:.2g}"
    return reported + words[size.end() :], saving * float(reported) / whole


def _intervals(active: Flags, times: Array, span: Array) -> tuple[tuple[float, float], ...]:
    """Return the intervals of active times, `span` for a single one; gaps of one are closed."""
    if len(active) == 1:
        return ((float(span[0]), float(span[-1])),)
    nodes = np.flatnonzero(active)
    parts = np.split(nodes, np.flatnonzero(np.diff(nodes) > 2) + 1)
    return tuple((float(times[part[0]]), float(times[part[-1]])) for part in parts)

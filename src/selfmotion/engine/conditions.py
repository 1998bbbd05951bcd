"""The constraints of a problem as one list of numbers: h ≤ 0 or h = 0, and its derivatives."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, Flags, Ints, ProblemError
from selfmotion.constraints import (
    Binding,
    BoundConstraint,
    Linearised,
    NodeTangents,
    easing_of,
    linearised,
)
from selfmotion.costs import Samples
from selfmotion.motion import Grid
from selfmotion.optimise import Residuals, Rows

# A constraint whose violation, squared and integrated, is above this counts as much as ten times
# the cost.
_NOTICED = 2e-3
# A condition binds where its price is above this share of what it is at most: interior points leave
# a little everywhere.
_BINDS = 1e-3


class Conditions:
    """All conditions of some constraints at the nodes of a grid, in one order.

    Parameters
    ----------
    constraints : sequence of BoundConstraint
    grid : Grid
    """

    def __init__(self, constraints: Sequence[BoundConstraint], grid: Grid) -> None:
        self.constraints = tuple(constraints)
        steps = np.diff(grid.nodes)
        self._shares = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
        # Tolerances of all conditions, and which are equalities: the same for every motion.
        self._kinds: tuple[Array, npt.NDArray[np.bool_]] | None = None
        # How many each constraint has, once they were looked at.
        self._counts: list[int] = []

    def residuals(self, samples: Samples) -> Residuals:
        """Return h of all conditions, with their tolerances."""
        tables = [item.residual(samples).ravel() for item in self.constraints]
        if self._kinds is None:
            self._counts = [len(table) for table in tables]
            tolerances = np.array([item.tolerance for item in self.constraints])
            equalities = np.array([item.equality for item in self.constraints], bool)
            self._kinds = (
                np.repeat(tolerances, self._counts),
                np.repeat(equalities, self._counts),
            )
        return Residuals(np.concatenate([np.zeros(0), *tables]), *self._kinds)

    def rows(self, samples: Samples, motion: NodeTangents) -> Rows:
        """Return the derivatives of all conditions."""
        parts = [linearised(item, samples, motion) for item in self.constraints]
        for item, part, count in zip(self.constraints, parts, self._counts, strict=False):
            if part.count != count:
                raise ProblemError(
                    f"constraint '{item.name}': there are derivatives of {part.count} conditions, "
                    f"expected {count}, as many as its residual has"
                )
        return _Stacked(parts, motion)

    @property
    def has_equalities(self) -> bool:
        """Whether a constraint is an equality."""
        return any(item.equality for item in self.constraints)

    def require_finite(self, samples: Samples) -> None:
        """Raise ProblemError where a condition has no finite value on a motion."""
        for item in self.constraints:
            if not np.all(np.isfinite(item.residual(samples))):
                raise ProblemError(
                    f"constraint '{item.name}': its residual is not finite on the motion at the "
                    f"start; expected numbers wherever the arm may be"
                )

    def penalty(self, samples: Samples) -> float:
        """Return about 10 for each constraint that is violated, 0 where all are kept."""
        total = 0.0
        for item in self.constraints:
            h = item.residual(samples)
            bad = np.abs(h) if item.equality else np.maximum(h, 0.0)
            shares = np.ones(1) if len(h) == 1 else self._shares
            total += 10.0 * min(1.0, float(np.sum(shares[:, None] * bad**2)) / _NOTICED)
        return total

    def active(self, samples: Samples, multipliers: Array, least: float) -> tuple[Binding, ...]:
        """Return what binds, for multipliers (C,) of all conditions, the most expensive first.

        What would save less than `least` is left out.
        """
        each, first, times = [], 0, samples.sampling.node_times
        for item in self.constraints:
            shape = item.residual(samples).shape
            prices = multipliers[first : first + shape[0] * shape[1]].reshape(shape)
            first += prices.size
            used = np.ones(shape, dtype=np.bool_)
            each.append(Priced(item, prices, times if shape[0] > 1 else times[:1], used))
        return active_of(each, times[[0, -1]], least)

    def violated(self, samples: Samples) -> tuple[str, ...]:
        """Return a message for each constraint that is not kept, on its worst place."""
        messages = []
        for item in self.constraints:
            h = item.residual(samples)
            size = np.abs(h) if item.equality else h
            # Written so that NaN counts as violated.
            if not np.max(size, initial=-np.inf) <= item.tolerance:
                row, column = np.unravel_index(int(np.argmax(size)), h.shape)
                text = item.describe(samples, int(row), int(column))
                messages.append(f"{item.name}: {text}")
        return tuple(messages)


class Priced(NamedTuple):
    """What the conditions of a constraint cost.

    Attributes
    ----------
    item : BoundConstraint
    prices : (K, C)
    times : (K,)
        When [s], increasing; one for what is asked of the whole motion.
    used : (K, C)
        Where what is asked for is used up, as far as prices say.
    """

    item: BoundConstraint
    prices: Array
    times: Array
    used: Flags


def active_of(each: Sequence[Priced], span: Array, least: float) -> tuple[Binding, ...]:
    """Return what binds, the most expensive first; what would save less than `least` is left out.

    `span` (2,) is when the motion begins and ends [s].
    """
    found: dict[tuple[str, str], tuple[float, Array, Array, Array]] = {}
    for item, signed, times, used in each:
        prices = np.abs(signed)
        for column in np.flatnonzero(prices.any(axis=0)):
            amount, words = easing_of(item, int(column))
            none = 0.0, np.zeros(len(prices)), np.zeros(len(prices)), times
            saving, price, at, _ = found.get((item.name, words), none)
            own = prices[:, column]
            at = np.maximum(at, np.where(used[:, column], own, 0.0))
            found[item.name, words] = (
                *(saving + amount * float(own.sum()), np.maximum(price, own)),
                *(at, times),
            )
    kept = []
    for (name, words), (saving, price, at, times) in found.items():
        if saving >= least:
            binds = (at if at.any() else price) > _BINDS * price.max()
            spans = _spans(binds if binds.any() else price == price.max(), times, span)
            kept.append(Binding(name, words, saving, spans))
    return tuple(sorted(kept, key=lambda item: -item.saving))


class _Stacked:
    """The rows of several constraints, one below the other."""

    def __init__(self, parts: Sequence[Linearised], motion: NodeTangents) -> None:
        self._parts, self._motion = parts, motion
        self._ends = np.cumsum([part.count for part in parts], dtype=np.intp)

    def along(self, p: Array) -> Array:
        """See `Rows.along`."""
        motion = self._motion.along(p)
        return np.concatenate([np.zeros(0), *(part.along(p, motion) for part in self._parts)])

    def picked(self, which: Ints) -> Array:
        """See `Rows.picked`."""
        rows = np.zeros((len(which), self._motion.size))
        owner = np.searchsorted(self._ends, which, side="right")
        for number in np.unique(owner):
            own, part = owner == number, self._parts[number]
            first = self._ends[number] - part.count
            rows[own] = part.picked(self._motion, which[own] - first)
        return rows


def _spans(binds: Flags, times: Array, span: Array) -> tuple[tuple[float, float], ...]:
    """Return the stretches of times that bind, `span` of one; one free time between is none."""
    if len(binds) == 1:
        return ((float(span[0]), float(span[-1])),)
    nodes = np.flatnonzero(binds)
    parts = np.split(nodes, np.flatnonzero(np.diff(nodes) > 2) + 1)
    return tuple((float(times[part[0]]), float(times[part[-1]])) for part in parts)

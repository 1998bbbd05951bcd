"""Quantities that constraints limit, defined once for optimiser and certificate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, Ints, ProblemError, as_number, read_only
from selfmotion.certificate.bounding import BoundedFunction, Bounds, MotionSegments, bounded
from selfmotion.certificate.requirement import Finding, FinishedMotion, Requirement

# Relative accuracy of the interpolation of shares of limits.
_FINE = 1e-6


class Column(NamedTuple):
    """One of the numbers that a quantity consists of.

    Attributes
    ----------
    subject : str
        Whose: a joint, a frame.
    label : str
        Its name in sentences: "torque of joint 'elbow'".
    unit : str
    slows : int
        The power of the duration that it falls with at a slower pace: 1 for speeds, 2 for
        accelerations, 0 where a slower pace does not help.
    """

    subject: str
    label: str
    unit: str
    slows: int = 0


@dataclass(frozen=True, eq=False)
class Quantity:
    """Numbers or vectors that are functions of q, q̇ and q̈, with limits.

    Attributes
    ----------
    name : str
        Its name in verdicts.
    columns : sequence of Column
    values : callable
        ``values(q, qd, qdd)`` of motions (K, n) each → numbers (K, m), or vectors (K, m, c).
    derivatives : callable
        ``derivatives(q, qd, qdd)`` → their derivatives by q, q̇ and q̈, as many of the three as
        they depend on, (K, m, n) or (K, m, c, n).
    limit : (m,)
        |value - center| ≤ limit, of vectors their length; inf for none.
    center : (m,) or float
        0 for vectors.
    series : callable, optional
        ``series(segments)`` → majorants of the values (m, K + 1, I), of vectors those of their
        lengths (`selfmotion.basics.series`). By default none: it is checked at samples.
    components : int
        Length c of vectors; 1 for numbers.
    of_pace : bool
        Whether a slower pace may keep its limits.
    period : float
        Difference of two equal values: 2π for angles.
    covers : tuple of str, optional
        Checks that a verdict may claim; by default its name.
    """

    name: str
    columns: Sequence[Column]
    values: Callable[[Array, Array, Array], Array]
    derivatives: Callable[[Array, Array, Array], tuple[Array, ...]]
    limit: npt.ArrayLike
    center: npt.ArrayLike = 0.0
    series: Callable[[MotionSegments], Array | None] | None = None
    components: int = 1
    of_pace: bool = False
    period: float = np.inf
    covers: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        count = len(self.columns)
        for name in ("limit", "center"):
            values = np.asarray(getattr(self, name), dtype=np.float64)
            object.__setattr__(self, name, read_only(np.broadcast_to(values, (count,))))
        # Written so that NaN is refused.
        if not (count and np.all(self.bounds > 0.0)):
            raise ProblemError(
                f"quantity '{self.name}': limit is {self.bounds.tolist()} for {count} columns, "
                f"expected numbers above 0, one for each"
            )

    @classmethod
    def between(
        cls,
        name: str,
        lower: float,
        upper: float,
        values: Callable[[Array, Array, Array], Array],
        derivatives: Callable[[Array, Array, Array], tuple[Array, ...]],
        series: Callable[[MotionSegments], Array] | None = None,
        unit: str = "",
    ) -> Quantity:
        """Return one number that is to stay within a band.

        Its `values` are (K,), its `derivatives` (K, n) each, its `series` (K + 1, I). Where one
        side is free, its end is a number that is just never reached: the room that planned motions
        leave inside the band is a share of its width.
        """
        ends = (("lower", lower), ("upper", upper))
        lower, upper = (as_number(end, f"quantity '{name}': {which}") for which, end in ends)
        return cls(
            name,
            (Column(name, name, unit),),
            lambda *motion: np.asarray(values(*motion))[:, None],
            lambda *motion: tuple(np.asarray(by)[:, None] for by in derivatives(*motion)),
            limit=0.5 * (upper - lower),
            center=0.5 * (upper + lower),
            series=None if series is None else lambda segments: series(segments)[None],
        )

    @property
    def bounds(self) -> Array:
        """The limits, (m,)."""
        return np.asarray(self.limit)

    @property
    def middle(self) -> Array:
        """The centres, (m,)."""
        return np.asarray(self.center)

    @property
    def limited(self) -> Ints:
        """Which columns have a limit."""
        return np.flatnonzero(np.isfinite(self.bounds))

    def away(self, q: Array, qd: Array, qdd: Array) -> Array:
        """Return the distances of values from the centres, modulo the period, (K, m) or (…, c)."""
        found = np.asarray(self.values(q, qd, qdd))
        away = found - (self.middle if found.ndim == 2 else self.middle[:, None])
        if np.isfinite(self.period):
            away = away - self.period * np.round(away / self.period)
        return away

    def said(self, column: int, away: float, time: float) -> str:
        """Return in words a column's value at a time, and its limit."""
        one, middle, limit = self.columns[column], self.middle[column], self.bounds[column]
        unit = f" {one.unit}" if one.unit else ""
        found = f"{one.label} is {middle + away:.4g}{unit} at t = {time:.3f} s"
        if middle:
            return f"{found}, expected {middle - limit:.4g} to {middle + limit:.4g}{unit}"
        share = abs(away) / limit
        said_text = f"{found}, {share:.5g} times its limit of {limit:.4g}{unit}"
        if not one.slows:
            return said_text
        return f"{said_text}: give it {share ** (1.0 / one.slows):.5g} times the duration"


@dataclass(frozen=True, eq=False)
class QuantityWithinLimits(Requirement):
    """A quantity stays within its limits, at all times.

    Attributes
    ----------
    quantity : Quantity
    """

    quantity: Quantity

    @property
    @override
    def name(self) -> str:  # type: ignore[override]  # it follows from the quantity
        return self.quantity.name

    @property
    @override
    def covers(self) -> tuple[str, ...]:
        """Nothing where there are no limits."""
        if not len(self.quantity.limited):
            return ()
        return (self.name,) if self.quantity.covers is None else self.quantity.covers

    @property
    @override
    def remarks(self) -> tuple[str, ...]:
        free = [item.label for item in self.quantity.columns]
        free = [free[k] for k in np.flatnonzero(~np.isfinite(self.quantity.bounds))]
        said = [f"not limited: {', '.join(free)}"] if free else []
        if self.quantity.series is None:
            said.append(f"{self.name}: checked at samples only, as it gives no bounds")
        return tuple(said)

    @override
    def judge(self, motion: FinishedMotion) -> Finding:
        """Return the largest share of a limit."""
        quantity, t = self.quantity, motion.trajectory.t
        if not len(quantity.limited):
            return Finding(self.name, "nothing", float(t[0]), 0.0, 1.0, True, "not limited")
        found = bounded(Shares(quantity), motion.robot, motion.trajectory, t)
        worst = int(np.argmax(np.where(np.isnan(found.values), np.inf, found.values)))
        column, share = int(quantity.limited[worst]), float(found.values[worst])
        time, subject = float(found.times[worst]), quantity.columns[column].subject
        # Written so that NaN is a violation.
        kept = not found.undecided and bool(share <= 1.0)
        text = quantity.said(column, self._amount(motion, column, time, share), time)
        if found.undecided and not share > 1.0:
            first, last = found.undecided[0]
            time, text = first, self._open(found, first, last)
        slows = quantity.columns[column].slows
        factor = 1.0 if kept else share ** (1.0 / slows) if slows and share > 1.0 else np.inf
        return Finding(self.name, subject, time, share, 1.0, kept, text, quantity.of_pace, factor)

    def _amount(self, motion: FinishedMotion, column: int, time: float, share: float) -> float:
        """Return the distance of a column from its centre at a time: the bounded size."""
        state = (motion.trajectory(np.array([time]), order) for order in range(3))
        away = self.quantity.away(*state)[0, column]
        sign = -1.0 if np.ndim(away) == 0 and away < 0.0 else 1.0
        return sign * share * float(self.quantity.bounds[column])

    def _open(self, found: Bounds, first: float, last: float) -> str:
        others = f", and on {len(found.undecided) - 1} more" if len(found.undecided) > 1 else ""
        return (
            f"whether {self.name} hold from t = {first:.6g} to {last:.6g} s is not "
            f"decided{others}: no bound is known there, or the limit is touched"
        )


class Shares(BoundedFunction):
    """Shares that a quantity uses of its limits, a block for each limited column.

    Parameters
    ----------
    quantity : Quantity
    """

    def __init__(self, quantity: Quantity) -> None:
        self._quantity, self._limited = quantity, quantity.limited
        self._limit = quantity.bounds[self._limited]
        count = len(self._limited)
        self.of, self.allowed = np.arange(count), np.ones(count)
        self.wanted, self.blocks = np.full(count, _FINE), np.arange(count) * quantity.components

    @override
    def series(self, segments: MotionSegments) -> Array | None:
        """Inf where an angle may turn by a period."""
        quantity = self._quantity
        known = quantity.series and quantity.series(segments)
        if known is None:
            return None
        asked = len(quantity.columns), len(segments.middle)
        if np.ndim(known) != 3 or (known.shape[0], known.shape[2]) != asked:
            raise ProblemError(
                f"quantity '{quantity.name}': series() has shape {np.shape(known)}, expected "
                f"({asked[0]}, K + 1, {asked[1]}): a number of each order for each value and "
                f"interval"
            )
        known = known[self._limited]
        if np.isfinite(quantity.period):
            far = ~(known[:, 1:].sum(axis=1) < 0.25 * quantity.period)
            known = np.where(far[:, None], np.inf, known)
        return np.asarray(known / self._limit[:, None, None])

    @override
    def values(self, segments: MotionSegments, u: Array) -> Array:
        quantity, shape = self._quantity, (len(segments.middle), len(u))
        away = quantity.away(*(segments.motion(u, order) for order in range(3)))
        away = away.reshape(*shape, len(quantity.columns), -1)[:, :, self._limited]
        if np.isfinite(quantity.period):
            away = np.unwrap(away, period=quantity.period, axis=1)
        return np.asarray((away / self._limit[:, None]).reshape(*shape, -1))

    @override
    def sizes(self, values: Array, segments: MotionSegments) -> Array:
        """Lengths, in units of the limits."""
        return np.asarray(np.sqrt(np.add.reduceat(values**2, self.blocks, axis=2)))

"""Limits of the pace of a joint path, as rows of a linear programme."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from selfmotion.basics import Array, Ints
from selfmotion.certificate import Quantity
from selfmotion.model.motion import Trajectory
from selfmotion.model.path import Pace
from selfmotion.planning.optimise import BandedRows


@dataclass(frozen=True, eq=False)
class Squares:
    """b, the square of how much faster a pace becomes: a quadratic spline over its time.

    Attributes
    ----------
    knots : (K + 1,)
        Of the time of the pace; those at the ends count three times.
    c : (K + 2,)
        Coefficients.
    """

    knots: Array
    c: Array

    @classmethod
    def constant(cls, knots: Array, value: float) -> "Squares":
        """Return a constant function."""
        return cls(knots, np.full(len(knots) + 1, value))

    @property
    def is_positive(self) -> bool:
        """Whether no coefficient is below 0, so that b is nowhere."""
        return bool(self.c.min() >= 0.0)

    def inside(self, share: float, order: int = 0) -> Array:
        """Return b, b' or b'' at a share of each interval, (K,)."""
        value, slope, bend = self._starts
        x = share * np.diff(self.knots)
        parts = (value + x * (slope + 0.5 * x * bend), slope + x * bend, bend)
        return np.asarray(parts[order])

    @cached_property
    def _starts(self) -> Array:
        """b, b' and b'' at the start of each interval, (3, K)."""
        three = np.stack([self.c[:-2], self.c[1:-1], self.c[2:]])
        return np.asarray((basis(self.knots, 0.0) * three).sum(axis=1))

    def at_knots(self, order: int = 0) -> Array:
        """Return b or b' at the knots, (K + 1,)."""
        return np.append(self.inside(0.0, order), self.inside(1.0, order)[-1])

    def on(self, knots: Array) -> "Squares":
        """Return about the same function over other knots of the same interval."""
        three = np.concatenate([[knots[0]] * 2, knots, [knots[-1]] * 2])
        places = 0.5 * (three[1:-2] + three[2:-1])
        old = np.clip(np.searchsorted(self.knots, places, side="right") - 1, 0, len(self.knots) - 2)
        share = (places - self.knots[old]) / np.diff(self.knots)[old]
        splines = _basis(*_neighbours(self.knots, old), share)[0]
        return Squares(
            knots, np.asarray((splines * self.c[old + np.arange(3)[:, None]]).sum(axis=0))
        )


def basis(t: Array, share: float) -> Array:
    """Return the three quadratic B-splines of each interval of knots t (K + 1,), (3, 3, K).

    Values, slopes and second derivatives (first axis) of the first, second and third spline that is
    not 0 there, at a share of the interval; knots at both ends count three times.
    """
    return _basis(*_neighbours(t, np.arange(len(t) - 1)), share)


def _neighbours(t: Array, k: Ints) -> tuple[Array, Array, Array]:
    """Return the lengths of intervals k, each with those of both neighbours."""
    h = np.diff(t)
    around = np.concatenate([[0.0], h, [0.0]])
    return h[k], h[k] + around[k], h[k] + around[k + 2]


def _basis(h: Array, before: Array, after: Array, share: Array | float) -> Array:
    x = share * h
    first = np.stack([(h - x) ** 2, -2.0 * (h - x), 0.0 * x + 2.0]) / (before * h)
    third = np.stack([x**2, 2.0 * x, 0.0 * x + 2.0]) / (after * h)
    second = np.array([[1.0], [0.0], [0.0]]) - first - third
    splines: Array = np.stack([first, second, third], axis=1)
    return splines


# Along a motion q(τ) run through at another pace, with b(τ) the square of dτ/dt,
#
#     q̇² = q_τ² b,   q̈ = q_ττ b + ½ q_τ b',   q⃛ = √b (q_τττ b + 3/2 q_ττ b' + ½ q_τ b'')
#
# (D. Verscheure et al., IEEE Trans. Automatic Control 54(10), 2009). The first two are linear in
# b; |…| ≤ J/√b of the third has its right side replaced by the tangent J (3 - b)/2 at b = 1,
# which lies below: what keeps that keeps the jerk. b is a quadratic spline, so that accelerations
# do not jump.
#
# Where the arm rests on its path, nothing of these bounds b. So the length of the joint path
# counts as one more joint, which goes on at a share of its largest speed there, within the limits
# that all joints have together.

# Smallest square of a rate, as a share of its earlier value.
MIN_SQUARED_RATE = 1e-6
# Places in an interval at which limits are evaluated: from just inside its start to its end.
PLACES = np.clip(0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 9)), 1e-6, 1.0 - 1e-6)
# Smaller values count as 0.
_NOTHING = 1e-150
# Places of rows in an interval: its middle, too, since b might oscillate near a rest.
SHARES = np.array([0.0, 0.5, 1.0])
# Distance from a knot that counts as rounding, as a share of the interval.
_BESIDE = 1e-6
# Directions in which vectors are limited on both sides: a polygon inside of the limit's circle,
# which is at most half a percent smaller. A circumscribed one with tangents added would chatter.
_SIDES = 16
# Rate of the joint path's length at rests, as a share of its largest speed.
_REST = 0.01


@dataclass(frozen=True, eq=False)
class PaceLimits:
    """Limits that depend on the pace of a joint path.

    Attributes
    ----------
    speed, acceleration, jerk : (n,)
        Of joints; inf for none.
    quantities : sequence of Quantity
        Such as torques, and how fast the tool is.
    """

    speed: Array
    acceleration: Array
    jerk: Array
    quantities: Sequence[Quantity] = ()

    @property
    def of_orders(self) -> tuple[Array, Array, Array]:
        """The limits of q̇, q̈ and the jerk."""
        return self.speed, self.acceleration, self.jerk

    @property
    def has_jerk(self) -> bool:
        """Whether the jerk of some joint is limited."""
        return bool(np.isfinite(self.jerk).any())

    def with_length(self) -> "PaceLimits":
        """Return the same with the length of the joint path as an additional joint."""
        speed, acceleration = (
            np.append(limit, np.linalg.norm(limit)) for limit in (self.speed, self.acceleration)
        )
        return PaceLimits(speed, acceleration, np.append(self.jerk, np.inf), self.quantities)

    def without_jerk(self) -> "PaceLimits":
        """Return the same without limits of the jerk."""
        free = np.full(len(self.jerk), np.inf)
        return PaceLimits(self.speed, self.acceleration, free, self.quantities)

    def shares(self, motion: Trajectory) -> tuple[list[Array], Array]:
        """Return the use of each limit in intervals, and the least use of any limit at their times.

        The largest in each interval, a table (I, n or m) for q̇, q̈, the jerk and the quantities,
        in this order, 0 without a limit; and (I,) the smallest over time of the largest use of any
        limit.
        """
        steps = np.diff(motion.t)
        at = np.minimum(motion.t[:-1, None] + steps[:, None] * PLACES, motion.t[-1]).ravel()
        used = self.shares_at(motion, at)
        some = np.max([table.max(axis=1, initial=0.0) for table in used], axis=0)
        most = [table.reshape(len(steps), len(PLACES), -1).max(axis=1) for table in used]
        return most, some.reshape(len(steps), len(PLACES)).min(axis=1)

    def shares_at(self, motion: Trajectory, t: Array) -> list[Array]:
        """Return the use of each limit at times (K,), a table (K, n or m) for each."""
        states = [motion(t, order) for order in range(4)]
        used = [np.abs(x) / limit for x, limit in zip(states[1:], self.of_orders, strict=True)]
        for item in self.quantities:
            away = item.away(*states[:3])
            sizes = np.linalg.norm(away, axis=2) if away.ndim == 3 else np.abs(away)
            used.append(sizes / item.bounds)
        return used


@dataclass(frozen=True, eq=False)
class States:
    """A joint path at a pace: its derivatives by the time of that pace, at knots.

    Attributes
    ----------
    q : (K + 1, n)
        At the knots.
    between : (K, n)
        In the middle of intervals.
    orders : three of (3, K, n + 1)
        First, second and third derivative of the joints and of the length at `SHARES` of each
        interval, as they are inside it.
    """

    q: Array
    between: Array
    orders: tuple[Array, Array, Array]

    @classmethod
    def of(cls, motion: Trajectory, pace: Pace, knots: Array) -> "States":
        """Return those of a motion at a pace of its own time, at knots (K + 1,) of the pace."""
        at = np.clip(pace(knots) + motion.t[0], *motion.t[[0, -1]])
        sides, count = _inside(knots), len(knots) - 1
        inside = np.clip(pace(sides.ravel()) + motion.t[0], *motion.t[[0, -1]]).reshape(-1, count)
        # Next to a knot, values are those of its side.
        beside = _BESIDE * np.diff(at)
        inside[0] = np.maximum(inside[0], at[:-1] + beside)
        inside[-1] = np.minimum(inside[-1], at[1:] - beside)
        by = _with_length(
            *(motion(inside.ravel(), k).reshape(len(SHARES), count, -1) for k in (1, 2, 3))
        )
        rate, bend, surge = (
            pace(sides.ravel(), order).reshape(len(SHARES), -1)[:, :, None] for order in (1, 2, 3)
        )
        return cls(
            motion(at),
            motion(inside[1]),
            (
                by[0] * rate,
                by[1] * rate**2 + by[0] * bend,
                by[2] * rate**3 + 3.0 * by[1] * rate * bend + by[0] * surge,
            ),
        )

    def at_knots(self, order: int) -> Array:
        """Return a derivative of the joints and of the length at the knots, (K + 1, n + 1)."""
        table = self.orders[order - 1]
        return np.vstack([table[0], table[-1, -1:]])


def _inside(t: Array) -> Array:
    """Return times at `SHARES` of each interval, inside it, (3, K)."""
    shares = np.clip(SHARES, _BESIDE, 1.0 - _BESIDE)
    return np.asarray(t[:-1] + shares[:, None] * np.diff(t))


def length_speed(qd: Array) -> Array:
    """Return the rate of the joint path's length at velocities (…, n), (…)."""
    size: Array = np.linalg.norm(qd, axis=-1)
    speed: Array = np.hypot(size, _REST * max(float(size.max()), np.finfo(float).tiny))
    return speed


def _with_length(first: Array, second: Array, third: Array) -> list[Array]:
    """Return derivatives (3, K, n) of joints with those of the length, (3, K, n + 1) each."""
    speed = length_speed(first)
    gain = np.einsum("skn,skn->sk", first, second) / speed
    change = (
        np.square(second).sum(axis=2) + np.einsum("skn,skn->sk", first, third) - gain**2
    ) / speed
    own = ((first, speed), (second, gain), (third, change))
    return [np.concatenate([joints, length[:, :, None]], axis=2) for joints, length in own]


def rows_of(
    states: States,
    limits: PaceLimits,
    room: Sequence[Array],
    near: Squares,
) -> BandedRows:
    """Return the limits of b as rows, for a spline over the same knots as a near one.

    Parameters
    ----------
    states : States
        At the pace that b is the square of a change of.
    limits : PaceLimits
    room : sequence of (K, n or m)
        Which share of each limit may be used, in the order of `PaceLimits.shares`.
    near : Squares
        Point of linearisation.
    """
    t = near.knots
    table, limits = _Table(len(t) - 1), limits.with_length()
    # The length has the largest room of all joints.
    room = [np.column_stack([own, own.max(axis=1)]) for own in room[:3]] + list(room[3:])
    for side, share in enumerate(SHARES.tolist()):
        value, slope, bend = (part[:, :, None] for part in basis(t, share))
        first, second, third = (order[side] for order in states.orders)
        fastest = (limits.speed * room[0] / np.maximum(np.abs(first), _NOTHING)) ** 2
        table.add(value, -np.inf, fastest.min(axis=1, keepdims=True))
        some = np.isfinite(limits.acceleration)
        bent = (second * value + 0.5 * first * slope)[:, :, some] / limits.acceleration[some]
        table.add(bent, -room[1][:, some], room[1][:, some])
        some = np.isfinite(limits.jerk)
        if some.any():
            b = np.maximum(near.inside(share), MIN_SQUARED_RATE)[:, None]
            surge = (third * value + 1.5 * second * slope + 0.5 * first * bend)[:, :, some]
            surge *= np.sqrt(b) / (limits.jerk[some] * room[2][:, some])
            for sign in (1.0, -1.0):
                table.add(sign * surge + 0.5 * value / b, -np.inf, 1.5)
    for item, own in zip(limits.quantities, room[3:], strict=True):
        _add_quantity(table, states, item, own, near)
    return table.rows()


class _Table:
    """Rows, as they are found."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._parts: list[tuple[Array, Array, Array]] = []

    def add(self, matrix: Array, lower: Array | float, upper: Array | float) -> None:
        shape = matrix.shape[1:]
        self._parts.append((matrix, np.broadcast_to(lower, shape), np.broadcast_to(upper, shape)))

    def rows(self) -> BandedRows:
        matrix, lower, upper = (
            np.concatenate(each, axis=-1) for each in zip(*self._parts, strict=True)
        )
        return BandedRows(matrix, lower, upper)


def _add_quantity(
    table: _Table, states: States, item: Quantity, room: Array, near: Squares
) -> None:
    """Add a quantity f(q, q̇, q̈), of first order around b, which is exact for torques.

    A vector is limited in some directions of the plane in which b and b' move it, its own among
    them.
    """
    some, limit = item.limited, item.bounds[item.limited]
    first, second = (states.at_knots(order)[:, :-1] for order in (1, 2))
    at_knots = _parts(item, states.q, first, second, near.at_knots(), near.at_knots(1))
    first, second = (order[1, :, :-1] for order in states.orders[:2])
    between = _parts(item, states.between, first, second, near.inside(0.5), near.inside(0.5, 1))
    places = (0.0, [x[:-1] for x in at_knots]), (0.5, between), (1.0, [x[1:] for x in at_knots])
    for share, parts in places:
        b, change = (near.inside(share, order)[:, None] for order in (0, 1))
        value, slope, _ = (x[:, :, None] for x in basis(near.knots, share))
        for direction, most in _directions(*parts):
            found, by_value, by_slope = (_along(direction, x) / limit for x in parts)
            constant_part = found - by_value * b - by_slope * change
            own = most * room[:, some]
            table.add(
                by_value * value + by_slope * slope, -own - constant_part, own - constant_part
            )


def _parts(
    item: Quantity, q: Array, first: Array, second: Array, b: Array, change: Array
) -> list[Array]:
    """Return a quantity at b and b', and its derivatives by these, (K, m) or (K, m, c).

    df = (½ f_q̇ q_τ / √b + f_q̈ q_ττ) db + ½ f_q̈ q_τ db'
    """
    b, change = b[:, None], change[:, None]
    root = np.sqrt(np.maximum(b, MIN_SQUARED_RATE))
    state = q, root * first, second * b + 0.5 * first * change
    found, (_, *by) = item.away(*state), item.derivatives(*state)
    by_value = by_slope = np.zeros_like(found)
    if by:
        by_value = 0.5 * np.einsum("k...n,kn->k...", by[0], first / root)
    if len(by) > 1:
        by_value = by_value + np.einsum("k...n,kn->k...", by[1], second)
        by_slope = 0.5 * np.einsum("k...n,kn->k...", by[1], first)
    return [x[:, item.limited] for x in (found, by_value, by_slope)]


def _directions(
    found: Array, by_value: Array, by_slope: Array
) -> Iterator[tuple[Array | None, float]]:
    """Yield directions (K, m, c) in which vectors (K, m, c) are limited, and their shares.

    None for numbers (K, m).
    """
    if found.ndim == 2:
        yield None, 1.0
        return
    yield _unit(found), 1.0
    if not by_slope.any():
        # A vector that depends on b alone keeps its direction.
        return
    across = _unit(by_slope)
    other = _unit(by_value - across * (by_value * across).sum(axis=2, keepdims=True))
    for angle in np.pi * np.arange(_SIDES) / _SIDES:
        yield np.cos(angle) * across + np.sin(angle) * other, float(np.cos(0.5 * np.pi / _SIDES))


def _along(direction: Array | None, vectors: Array) -> Array:
    """Return vectors (K, m, c) along directions, (K, m); numbers as they are."""
    return vectors if direction is None else np.einsum("kmc,kmc->km", direction, vectors)


def _unit(vectors: Array) -> Array:
    """Return vectors (…, c) with length 1, none of none."""
    sizes = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.maximum(sizes, _NOTHING))

"""Segments of a program, motions from rest to rest through joint targets; their interpolations."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar, NamedTuple

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.motion import Trajectory

# Blend at a corner of a polygon, as a share of the shorter adjacent interval.
_CORNER_SHARE = 1e-3
# Sample points of an interval between two joint targets, as shares of it.
_JOINT_SAMPLES = np.linspace(0.0, 1.0, 8, endpoint=False)
# The only sample point of an interval whose knots are its targets.
_TARGET_SAMPLE = np.zeros(1)

# An interpolation: times (K,) to rows of joints or poses.
Curve = Callable[[Array], Array]


class Event(NamedTuple):
    """An event at a target: the target's number in the segment, and the event's name."""

    target: int
    name: str


class Knots(NamedTuple):
    """A joint motion from rest to rest: cubics through positions and velocities at times.

    Attributes
    ----------
    t : (K,)
        [s]
    q, qd : (K, n)
        [rad or m, and per second]
    """

    t: Array
    q: Array
    qd: Array

    @classmethod
    def smooth(cls, t: Array, q: Array) -> "Knots":
        """Return the spline through positions (K, n) from rest to rest."""
        from scipy.interpolate import CubicSpline

        if not np.isfinite(q).all():
            return cls(t, q, q)
        rates: Array = CubicSpline(t, q, bc_type="clamped")(t, 1)
        # Rounding of the spline's rates at rest.
        rates[[0, -1]] = 0.0
        return cls(t, q, rates)

    @classmethod
    def cornered(cls, t: Array, q: Array, stride: int) -> "Knots":
        """Return a motion through positions (K, n), smooth but for corners.

        They are at every `stride`-th time. At corners and both ends the velocity changes within a
        short blend.
        """
        from scipy.interpolate import CubicSpline

        if not np.isfinite(q).all():
            return cls(t, q, q)
        corners = t[::stride]
        sides = np.diff(corners)
        blends = _CORNER_SHARE * np.minimum(np.append(sides, np.inf), np.append(np.inf, sides))
        times, positions, rates = [t[:1]], [q[:1]], [0.0 * q[:1]]
        for k in range(len(sides)):
            side = slice(k * stride, (k + 1) * stride + 1)
            ends = corners[k] + blends[k], corners[k + 1] - blends[k + 1]
            side_times = np.concatenate([ends[:1], t[side][1:-1], ends[1:]])
            if stride == 1:
                slope = (q[k + 1] - q[k]) / sides[k]
                side_positions = q[k] + (side_times - corners[k])[:, None] * slope
                side_rates = np.tile(slope, (2, 1))
            else:
                spline = CubicSpline(t[side], q[side])
                side_positions, side_rates = spline(side_times), spline(side_times, 1)
            times.append(side_times)
            positions.append(side_positions)
            rates.append(side_rates)
        times.append(t[-1:])
        positions.append(q[-1:])
        rates.append(0.0 * q[-1:])
        return cls(np.concatenate(times), np.concatenate(positions), np.concatenate(rates))


def by_interpolation(parts: Iterable[Iterable[Knots]]) -> list[list[Knots]]:
    """Return, for each interpolation of a controller, the knots of all parts.

    A part with fewer interpolations repeats its last one.
    """
    interpolations = [list(part) for part in parts]
    count = max(len(part) for part in interpolations)
    return [[part[min(k, len(part) - 1)] for part in interpolations] for k in range(count)]


@dataclass(frozen=True, eq=False)
class Segment:
    """A motion from rest to rest through targets, or a pause.

    Attributes
    ----------
    name : str
        Name of the seam or move.
    t : (K + 1,)
        Time of each target, from 0 [s].
    q : (K + 1, n)
        Initial configuration and targets [rad or m].
    events : tuple of Event
    remark : str
        Comment for the program.
    is_slow : bool
        Whether it is a slow connecting motion inserted into a shifted program, and not part of the
        plan.
    """

    name: str
    t: Array
    q: Array
    events: tuple[Event, ...] = ()
    remark: str = ""
    is_slow: bool = False

    # Times at which deviations are evaluated, as shares of an interval between targets.
    sample_shares: ClassVar[Array] = _JOINT_SAMPLES
    # Times of the knots of motions, as shares of an interval between targets.
    knot_shares: ClassVar[Array] = _TARGET_SAMPLE

    @property
    def duration(self) -> float:
        """Duration of the segment [s]."""
        return float(self.t[-1])

    @property
    def is_rest(self) -> bool:
        """Whether the arm is at rest throughout."""
        return bool((self.q == self.q[0]).all())

    def in_order(self, order: Sequence[int]) -> "Segment":
        """Return the segment with coordinates in another order."""
        return replace(self, q=self.q[:, order])

    @property
    def rows(self) -> Array:
        """Coordinates that are interpolated, a row per target: joints, (K + 1, n)."""
        return self.q

    def between(self, times: Array, t: Array, rows: Array) -> Array:
        """Return rows at times by linear interpolation of the rows at t."""
        return straight_joints(times, t, rows)

    def spline(self, times: Array) -> Array:
        """Return rows at times on the cubic spline through all rows, from rest to rest."""
        from scipy.interpolate import CubicSpline

        values: Array = CubicSpline(self.t, self.rows, bc_type="clamped")(times)
        return values

    def joints(self, rows: Array, times: Array) -> Array:
        """Return joint positions (K, n) of rows at times; NaN where inverse kinematics fails."""
        return rows

    @property
    def curves(self) -> list[Curve]:
        """Interpolations of a controller: polygon, polygon with blended corners, cubic spline."""
        lines = polygons(self.t, self.rows, self.between)
        curves: list[Curve] = [partial(self.between, t=t, rows=rows) for t, rows in lines]
        return curves if len(self.t) < 3 else [*curves, self.spline]

    def evaluation_times(self) -> Array:
        """Return times at targets and between them (K,) [s]."""
        return subdivided(self.t, self.sample_shares)

    def interpolated(self, times: Array) -> list[Array]:
        """Return joint positions (K, n) at times by each interpolation."""
        return [self.joints(curve(times), times) for curve in self.curves]

    def reference(self, motion: Trajectory, first: float) -> Array:
        """Return a planned motion from time `first` on, at the evaluation times (K, n)."""
        return motion(np.clip(first + self.evaluation_times(), motion.t[0], motion.t[-1]))

    def motions(self) -> Iterator[Knots]:
        """Yield the joint motion by each interpolation: spline, polygon, blended corners.

        See `deviation_of` for the interpolations. NaN where inverse kinematics fails.
        """
        times = subdivided(self.t, self.knot_shares)
        yield Knots.smooth(times, self.joints(self.spline(times), times))
        for t, rows in polygons(self.t, self.rows, self.between):
            times = subdivided(t, self.knot_shares)
            q = self.joints(self.between(times, t, rows), times)
            yield Knots.cornered(times, q, len(self.knot_shares))


def subdivided(t: Array, shares: Array) -> Array:
    """Return times with additional ones in each interval, at `shares` of it."""
    return np.append((t[:-1, None] + shares * np.diff(t)[:, None]).ravel(), t[-1])


def polygons(
    t: Array, rows: Array, between: Callable[[Array, Array, Array], Array]
) -> list[tuple[Array, Array]]:
    """Return the polygon through targets, and that through the midpoints of its sides.

    Parameters
    ----------
    t : (K,)
        Times of targets [s].
    rows : (K, m)
        Joints or poses.
    between : callable
        Interpolation: times, times of rows, rows → rows at these times.
    """
    if len(t) < 3:
        return [(t, rows)]
    knots = np.concatenate([t[:1], 0.5 * (t[:-1] + t[1:]), t[-1:]])
    return [(t, rows), (knots, between(knots, t, rows))]


def straight_joints(times: Array, t: Array, q: Array) -> Array:
    """Return joints (K, n) at times by linear interpolation."""
    return np.stack([np.interp(times, t, column) for column in q.T], axis=1)

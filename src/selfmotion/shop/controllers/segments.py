"""Segments of a motion from rest to rest, as targets of joints or as tool poses."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar, NamedTuple

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, Ints
from selfmotion.certificate import Tolerance
from selfmotion.model.motion import Trajectory
from selfmotion.model.robot import Chain
from selfmotion.shop.controllers.tool_frames import ToolFrames

# Ratio of the largest deviation to the largest one at the times that are evaluated.
SURE = 1.02
# Share of the shorter side of a corner within which the velocity changes.
_CORNER = 1e-3
# Shares of the interval between two joint targets at which the error is evaluated.
_BETWEEN = np.linspace(0.0, 1.0, 8, endpoint=False)
# Shares of the interval between two poses at which joints are evaluated, which bend in between.
_BETWEEN_POSES = np.linspace(0.0, 1.0, 16, endpoint=False)
# Share of an interval that is its target alone.
_AT_TARGET = np.zeros(1)
# Sine of the angle below which slerp is a straight line.
_SMALL = 1e-9

# Rows of joints or poses at times (K,), by one interpolation.
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
        # A spline leaves digits of rest.
        rates[[0, -1]] = 0.0
        return cls(t, q, rates)

    @classmethod
    def cornered(cls, t: Array, q: Array, each: int) -> "Knots":
        """Return a motion (K, n) that is smooth but for a corner at every `each`-th of its times.

        There the velocity changes within a short time, as it does at both ends.
        """
        from scipy.interpolate import CubicSpline

        if not np.isfinite(q).all():
            return cls(t, q, q)
        corners = t[::each]
        sides = np.diff(corners)
        reach = _CORNER * np.minimum(np.append(sides, np.inf), np.append(np.inf, sides))
        times, places, rates = [t[:1]], [q[:1]], [0.0 * q[:1]]
        for k in range(len(sides)):
            own = slice(k * each, (k + 1) * each + 1)
            ends = corners[k] + reach[k], corners[k + 1] - reach[k + 1]
            at = np.concatenate([ends[:1], t[own][1:-1], ends[1:]])
            if each == 1:
                slope = (q[k + 1] - q[k]) / sides[k]
                here, rate = q[k] + (at - corners[k])[:, None] * slope, np.tile(slope, (2, 1))
            else:
                spline = CubicSpline(t[own], q[own])
                here, rate = spline(at), spline(at, 1)
            times.append(at)
            places.append(here)
            rates.append(rate)
        times.append(t[-1:])
        places.append(q[-1:])
        rates.append(0.0 * q[-1:])
        return cls(np.concatenate(times), np.concatenate(places), np.concatenate(rates))


def by_interpolation(parts: Iterable[Iterable[Knots]]) -> list[list[Knots]]:
    """Return the parts of a motion by each interpolation that a controller may use.

    Where a part has fewer of them, its last one stands for the others.
    """
    each = [list(own) for own in parts]
    count = max(len(own) for own in each)
    return [[own[min(k, len(own) - 1)] for own in each] for k in range(count)]


@dataclass(frozen=True, eq=False)
class Segment:
    """A motion from rest to rest by its targets, or a rest.

    Attributes
    ----------
    name : str
        Of the seam or move.
    t : (K + 1,)
        When each target is reached, from 0 [s].
    q : (K + 1, n)
        Where it begins, and its targets [rad or m].
    events : tuple of Event
    remark : str
        What there is to say of it.
    is_slow : bool
        Whether it is no part of the plan but a slow motion to where a shifted program goes on.
    """

    name: str
    t: Array
    q: Array
    events: tuple[Event, ...] = ()
    remark: str = ""
    is_slow: bool = False

    # Shares of an interval at which deviations are evaluated, and at which motions have knots.
    evaluated: ClassVar[Array] = _BETWEEN
    knots: ClassVar[Array] = _AT_TARGET

    @property
    def duration(self) -> float:
        """How long it takes [s]."""
        return float(self.t[-1])

    @property
    def is_rest(self) -> bool:
        """Whether the arm rests all the while."""
        return bool((self.q == self.q[0]).all())

    def in_order(self, order: Sequence[int]) -> "Segment":
        """Return the segment with coordinates in another order."""
        return replace(self, q=self.q[:, order])

    @property
    def rows(self) -> Array:
        """Rows that are interpolated, one a target: joints, (K + 1, n)."""
        return self.q

    def between(self, times: Array, t: Array, rows: Array) -> Array:
        """Return rows at times, straight between those at t."""
        return straight_joints(times, t, rows)

    def spline(self, times: Array) -> Array:
        """Return rows at times on the cubic spline through all, from rest to rest."""
        from scipy.interpolate import CubicSpline

        found: Array = CubicSpline(self.t, self.rows, bc_type="clamped")(times)
        return found

    def joints(self, rows: Array, times: Array) -> Array:
        """Return the joint positions (K, n) of rows at times; NaN where none are known."""
        return rows

    @property
    def curves(self) -> list[Curve]:
        """Interpolations that a controller may use: straight, with cut corners, smooth."""
        lines = polygons(self.t, self.rows, self.between)
        found: list[Curve] = [partial(self.between, t=t, rows=rows) for t, rows in lines]
        return found if len(self.t) < 3 else [*found, self.spline]

    def evaluation_times(self) -> Array:
        """Return times at targets and between them (K,) [s]."""
        return finer(self.t, self.evaluated)

    def interpolated(self, times: Array) -> list[Array]:
        """Return joint positions (K, n) at times by each interpolation."""
        return [self.joints(curve(times), times) for curve in self.curves]

    def reference(self, motion: Trajectory, first: float) -> Array:
        """Return a motion begun at `first`, at the times that are evaluated, (K, n)."""
        return motion(np.clip(first + self.evaluation_times(), motion.t[0], motion.t[-1]))

    def motions(self) -> Iterator[Knots]:
        """Yield the joint motion by each interpolation: smooth, straight, with cut corners.

        With as few knots as it takes: see `miss_of` for what these are. NaN where no joints are
        known.
        """
        times = finer(self.t, self.knots)
        yield Knots.smooth(times, self.joints(self.spline(times), times))
        for t, rows in polygons(self.t, self.rows, self.between):
            times = finer(t, self.knots)
            q = self.joints(self.between(times, t, rows), times)
            yield Knots.cornered(times, q, len(self.knots))


class Miss(NamedTuple):
    """How far targets take a controller off the motion, at the time where it is farthest.

    Attributes
    ----------
    position, rotation : float
        Of the tool [m, rad].
    joint : float
        Of a joint [rad or m].
    """

    position: float
    rotation: float
    joint: float

    def share(self, allowed: Tolerance) -> float:
        """Return how much of what is allowed it takes: above 1 too much."""
        rotation = max(self.rotation, self.joint) / allowed.rotation
        return SURE * max(self.position / allowed.position, rotation)

    @property
    def stated(self) -> "Miss":
        """As files state it: the worst lies between the times that are looked at."""
        return Miss(SURE * self.position, SURE * self.rotation, SURE * self.joint)


class Misses(NamedTuple):
    """How far targets take a controller off what it makes, and off moves through the air.

    Attributes
    ----------
    path, moves : Miss
    """

    path: Miss
    moves: Miss

    def worse(self, other: "Misses") -> "Misses":
        """Return the larger ones of both."""
        return Misses(*(Miss(*map(max, *pair)) for pair in zip(self, other, strict=True)))


NO_MISS = Miss(0.0, 0.0, 0.0)


def miss_of(
    segment: Segment, motion: Trajectory, chains: Sequence[Chain], first: float = 0.0
) -> Miss:
    """Return how far a controller is off a motion at most, whichever interpolation it uses.

    In between it may go straight in joint space, past each corner on the line between the middles
    of the two sides, which is the largest corner that controllers round, or along the cubic spline
    through all targets that begins and ends at rest; at the times of the motion, which holds it to
    its speeds as well. Segments at a speed are held to where it goes alone.
    """
    times, exact = segment.evaluation_times(), segment.reference(motion, first)
    worst = NO_MISS
    for line in segment.interpolated(times):
        worst = Miss(*map(max, worst, miss_between(line, exact, chains)))
    return worst


def miss_between(q: Array, exact: Array, chains: Sequence[Chain]) -> Miss:
    """Return how far configurations (K, n) are off others at most, one by one.

    It is infinite where they are not numbers: no joints are known of a pose.
    """
    from scipy.spatial.transform import Rotation

    if not np.isfinite(q).all():
        return Miss(np.inf, np.inf, np.inf)
    position = rotation = 0.0
    for chain in chains:
        _, here, there = chain.along(q)
        _, turned, placed = chain.along(exact)
        position = max(position, float(np.linalg.norm(there - placed, axis=1).max()))
        turns = Rotation.from_matrix(np.einsum("kji,kjl->kil", here, turned)).magnitude()
        rotation = max(rotation, float(turns.max()))
    return Miss(position, rotation, float(np.abs(q - exact).max()))


def finer(t: Array, between: Array) -> Array:
    """Return times with others between each two, `between` as shares from 0 on."""
    return np.append((t[:-1, None] + between * np.diff(t)[:, None]).ravel(), t[-1])


def polygons(
    t: Array, rows: Array, between: Callable[[Array, Array, Array], Array]
) -> list[tuple[Array, Array]]:
    """Return the polygon of targets, and that whose corners are cut from middle to middle.

    Parameters
    ----------
    t : (K,)
    rows : (K, m)
        Of joints, or of poses.
    between : callable
        Times, the times of rows, rows → rows at these times, straight between those given.
    """
    if len(t) < 3:
        return [(t, rows)]
    knots = np.concatenate([t[:1], 0.5 * (t[:-1] + t[1:]), t[-1:]])
    return [(t, rows), (knots, between(knots, t, rows))]


def straight_joints(times: Array, t: Array, q: Array) -> Array:
    """Return joints (K, n) at times, linear between those at t."""
    return np.stack([np.interp(times, t, column) for column in q.T], axis=1)


# Tool poses as targets, and the joint motion that a controller makes of them.
#
# Between two poses the position is linear in the path parameter, the orientation turns about one
# axis evenly (slerp; Shoemake, "Animating rotation with quaternion curves", 1985), and external
# axes are linear; the arm's joints follow by inverse kinematics from where they are. That is what
# ``MoveL``, ``LIN`` and ``movel`` are documented to do. ``SPLINE`` goes smoothly through all
# poses.


@dataclass(frozen=True, eq=False, kw_only=True)
class PoseSegment(Segment):
    """A motion from rest to rest by tool poses.

    Attributes
    ----------
    places, turns : (K + 1, 3), (K + 1, 4)
        The tool in the work object: positions [m], and quaternions x, y, z, w, each on the side of
        the one before.
    frames : ToolFrames
    near : callable
        Times → joint positions (K, n) in the robot's order, from which inverse kinematics begins.
    order : (n,)
        Which of the robot's joints each column of `q` is.
    """

    places: Array
    turns: Array
    frames: ToolFrames
    near: Callable[[Array], Array]
    order: Ints

    evaluated: ClassVar[Array] = _BETWEEN_POSES
    knots: ClassVar[Array] = _BETWEEN_POSES

    @override
    def in_order(self, order: Sequence[int]) -> "PoseSegment":
        return replace(self, q=self.q[:, order], order=self.order[list(order)])

    @property
    @override
    def rows(self) -> Array:
        """See `Segment.rows`: positions, quaternions and external axes, (K + 1, 7 + m)."""
        own = self.q[:, np.argsort(self.order)]
        return np.hstack([self.places, self.turns, own[:, self.frames.external]])

    @override
    def between(self, times: Array, t: Array, rows: Array) -> Array:
        return straight(times, t, rows)

    @override
    def spline(self, times: Array) -> Array:
        rows = super().spline(times)
        rows[:, 3:7] /= np.linalg.norm(rows[:, 3:7], axis=1, keepdims=True)
        return rows

    @override
    def joints(self, rows: Array, times: Array) -> Array:
        q = np.array(self.near(times))
        q[:, self.frames.external] = rows[:, 7:]
        found, arrived = self.frames.solved(rows[:, :3], rows[:, 3:7], q)
        return np.where(arrived[:, None], found, np.nan)[:, self.order]


def straight(times: Array, t: Array, rows: Array) -> Array:
    """Return rows (K, 7 + m) at times between those at t: linear, orientations by slerp."""
    k = np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(t) - 2)
    share = ((times - t[k]) / (t[k + 1] - t[k]))[:, None]
    found: Array = (1.0 - share) * rows[k] + share * rows[k + 1]
    first, last = rows[k, 3:7], rows[k + 1, 3:7]
    # Below 90°, as each is on the side of the one before.
    apart, together = (
        np.linalg.norm(each, axis=1, keepdims=True) for each in (first - last, first + last)
    )
    angle = 2.0 * np.arctan2(apart, together)
    sine = np.sin(angle)
    near = sine < _SMALL
    sine = np.where(near, 1.0, sine)
    one, other = np.sin((1.0 - share) * angle) / sine, np.sin(share * angle) / sine
    turned = np.where(near, found[:, 3:7], one * first + other * last)
    found[:, 3:7] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    return found


def fastest_between(t: Array, places: Array, turns: Array) -> tuple[float, float]:
    """Return how fast the tool moves and turns at most by timed poses [m/s, rad/s].

    Straight between them, or on the spline through them that begins and ends at rest.
    """
    from scipy.interpolate import CubicSpline

    steps = np.diff(t)
    fast = float((np.linalg.norm(np.diff(places, axis=0), axis=1) / steps).max())
    apart = np.linalg.norm(np.diff(turns, axis=0), axis=1)
    turning = float((4.0 * np.arcsin(np.minimum(0.5 * apart, 1.0)) / steps).max())
    spline = CubicSpline(t, np.hstack([places, turns]), bc_type="clamped")
    rates = spline(finer(t, _BETWEEN_POSES), 1)
    fast = max(fast, float(np.linalg.norm(rates[:, :3], axis=1).max()))
    # A unit quaternion turns half as fast as what it stands for.
    return fast, max(turning, 2.0 * float(np.linalg.norm(rates[:, 3:], axis=1).max()))


def on_one_side(turns: Array) -> Array:
    """Return quaternions (K, 4), each on the side of the one before."""
    found = np.array(turns)
    for k in range(1, len(found)):
        if found[k] @ found[k - 1] < 0.0:
            found[k] *= -1.0
    return found

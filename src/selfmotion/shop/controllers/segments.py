"""Segments of a motion from rest to rest, as targets of joints or as tool poses."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

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
# Shares of the interval between two targets at which the error is evaluated.
_BETWEEN = np.array([0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875])


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
    def cornered(cls, t: Array, q: Array, each: int) -> "Knots":
        """Return a motion (K, n) that is smooth but for a corner at every `each`-th of its times.

        There the velocity changes within a short time, as it does at both ends.
        """
        from scipy.interpolate import CubicSpline

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
    """Return the parts of a motion by each way in which a controller may make it.

    Where a part has fewer ways, its last one stands for the others.
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

    def looked_at(self) -> Array:
        """Return times at targets and between them (K,) [s]."""
        return finer(self.t, _BETWEEN)

    def ways(self, times: Array) -> list[Array]:
        """Return joint positions (K, n) at times by each way in which controllers join targets."""
        return ways(self.t, self.q, times)

    def matched(self, motion: Trajectory, first: float) -> Array:
        """Return a motion begun at `first`, at the times that are evaluated, (K, n)."""
        return motion(np.clip(first + self.looked_at(), motion.t[0], motion.t[-1]))

    def smooth(self) -> tuple[Array, Array, Array]:
        """Return times (K,) [s], positions and velocities (K, n) of a spline through the targets.

        It begins and ends at rest.
        """
        from scipy.interpolate import CubicSpline

        times = self.looked_at()
        spline = CubicSpline(self.t, self.q, bc_type="clamped")
        return times, spline(times), spline(times, 1)

    def joined(self) -> Iterator[Knots]:
        """Yield the motion by each way in which controllers join targets: smooth, straight, cut.

        As few knots as it takes: see `miss_of` for what these are.
        """
        from scipy.interpolate import CubicSpline

        rates = CubicSpline(self.t, self.q, bc_type="clamped")(self.t, 1)
        rates[[0, -1]] = 0.0
        yield Knots(self.t, self.q, rates)
        for line in polygons(self.t, self.q, _straight):
            yield Knots.cornered(*line, 1)


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
    """Return how far a controller is off a motion at most, whichever way it joins the targets.

    In between it may go straight in joint space, past each corner on the line between the middles
    of the two sides, which is the largest corner that controllers round, or along the cubic spline
    through all targets that begins and ends at rest; at the times of the motion, which holds it to
    its speeds as well. Segments at a speed are held to where it goes alone.
    """
    times, exact = segment.looked_at(), segment.matched(motion, first)
    worst = NO_MISS
    for line in segment.ways(times):
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


def ways(t: Array, q: Array, times: Array) -> list[Array]:
    """Return joint positions (K, n) at times by each way of joining targets."""
    from scipy.interpolate import CubicSpline

    lines = [_straight(times, *line) for line in polygons(t, q, _straight)]
    if len(t) < 3:
        return lines
    return [*lines, CubicSpline(t, q, bc_type="clamped")(times)]


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


def _straight(times: Array, t: Array, q: Array) -> Array:
    return np.stack([np.interp(times, t, column) for column in q.T], axis=1)


# Tool poses as targets, and the joint motion that a controller makes of them.
#
# Between two poses the position is linear in the path parameter, the orientation turns about one
# axis evenly (slerp; Shoemake, "Animating rotation with quaternion curves", 1985), and external
# axes are linear; the arm's joints follow by inverse kinematics from where they are. That is what
# ``MoveL``, ``LIN`` and ``movel`` are documented to do. ``SPLINE`` goes smoothly through all
# poses.

# Shares of the interval between two poses at which joints are evaluated, which bend in between.
_BETWEEN_POSES = np.linspace(0.0, 1.0, 16, endpoint=False)


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

    @override
    def in_order(self, order: Sequence[int]) -> "PoseSegment":
        return replace(self, q=self.q[:, order], order=self.order[list(order)])

    @override
    def looked_at(self) -> Array:
        return finer(self.t, _BETWEEN_POSES)

    def ways(self, times: Array) -> list[Array]:
        """See `Segment.ways`: straight lines, rounded corners, a smooth curve; in tool poses.

        Where no joints are known they are not numbers.
        """
        lines = polygons(self.t, self._rows(), straight)
        found = [straight(times, *line) for line in lines]
        if len(self.t) > 2:
            found.append(self._spline(times))
        return [self._joints(rows, times)[:, self.order] for rows in found]

    @override
    def smooth(self) -> tuple[Array, Array, Array]:
        from scipy.interpolate import CubicSpline

        times = self.looked_at()
        q = self._joints(self._spline(times), times)[:, self.order]
        if not np.isfinite(q).all():
            return times, q, q
        return times, q, CubicSpline(times, q, bc_type="clamped")(times, 1)

    def joined(self) -> Iterator[Knots]:
        """See `Segment.joined`; where no joints are known they are not numbers."""
        yield _at_rest(*self.smooth())
        for knots, rows in polygons(self.t, self._rows(), straight):
            times = finer(knots, _BETWEEN_POSES)
            q = self._joints(straight(times, knots, rows), times)[:, self.order]
            known = bool(np.isfinite(q).all())
            yield Knots.cornered(times, q, len(_BETWEEN_POSES)) if known else Knots(times, q, q)

    def _spline(self, times: Array) -> Array:
        from scipy.interpolate import CubicSpline

        rows: Array = CubicSpline(self.t, self._rows(), bc_type="clamped")(times)
        rows[:, 3:7] /= np.linalg.norm(rows[:, 3:7], axis=1, keepdims=True)
        return rows

    def _rows(self) -> Array:
        """Return positions, quaternions and external axes, (K + 1, 7 + m)."""
        own = self.q[:, np.argsort(self.order)]
        return np.hstack([self.places, self.turns, own[:, self.frames.external]])

    def _joints(self, rows: Array, times: Array) -> Array:
        q = np.array(self.near(times))
        q[:, self.frames.external] = rows[:, 7:]
        found, arrived = self.frames.solved(rows[:, :3], rows[:, 3:7], q)
        return np.where(arrived[:, None], found, np.nan)


def _at_rest(t: Array, q: Array, qd: Array) -> Knots:
    """Return knots that begin and end at rest, where a spline leaves digits of it."""
    rates = np.array(qd)
    rates[[0, -1]] = 0.0
    return Knots(t, q, rates)


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


# Sine of the angle below which slerp is a straight line.
_SMALL = 1e-9


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

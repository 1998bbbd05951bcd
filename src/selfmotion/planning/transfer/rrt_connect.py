"""Ways of straight legs between configurations, and the smooth paths that round their corners.

Two trees grow towards each other: RRT-Connect (J. Kuffner, S. LaValle, "RRT-Connect: an efficient
approach to single-query path planning", ICRA 2000). The best of several polylines is shortened by
straight shortcuts. A smooth path is a cubic B-spline whose control points are on the legs: it is
within the hulls of four neighbours, so that it differs from the legs near corners only, by less
with denser points.
"""

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, Ints
from selfmotion.model.motion import Trajectory
from selfmotion.model.robot import RobotModel
from selfmotion.problem.constraints import Envelope

# Excess of a limit that counts as rounding, as in the certificate.
ROUNDING = 1e-12
# Additional clearance [m], since bodies are checked at samples.
MOVE_MARGIN = 5e-4
# Largest motion of a point of a body between two checks of a leg [m] …
_LEG_STEP = 0.02
# … and of a final path [m].
_FINE_STEP = 0.005
# The same of joints, without bodies [rad].
_TURN_STEP = 0.05
# Length of the trees' legs at full speed [s].
_LEG_RANGE = 1.0
# Share of the samples around the middle; others are anywhere …
_AROUND_MIDDLE = 0.2
# … and their standard deviation, as a share of the distance.
_SPREAD = 0.5
# Number of polylines of which the best is chosen.
_CANDIDATES = 4
# Largest number of shortcuts that are tried on each …
_SHORTCUTS = 120
# … until this number in turn is blocked.
_BLOCKED_SHORTCUTS = 30
# First number of control points of a path.
_FIRST_POINTS = 12
# Smallest distance of control points around corners, as a share of the path.
_FINEST = 1e-3
# Smallest number of samples of a path.
PATH_SAMPLES = 64


# Distance of samples from limits, as a share of the range.
_INSIDE = 1e-6
# Configurations nearer than this are the same [rad or m].
_SAME = 1e-9
# Degree of the splines.
_DEGREE = 3


@dataclass(frozen=True, eq=False)
class Room:
    """Allowed configurations, and their distances in time.

    Attributes
    ----------
    envelope : Envelope
        Limits, bodies and quantities.
    robot : RobotModel
    margin : float
        Additional clearance, since bodies are checked at samples [m].
    finer : float
        Factor of the density of checks along legs.
    """

    envelope: Envelope
    robot: RobotModel
    margin: float = MOVE_MARGIN
    finer: float = 1.0

    def free(self, q: Array) -> npt.NDArray[np.bool_]:
        """Return the mask of allowed configurations (K, n), (K,)."""
        envelope = self.envelope
        inside = (q >= envelope.lower - ROUNDING) & (q <= envelope.upper + ROUNDING)
        allowed = np.asarray(inside.all(axis=1))
        if envelope.quantities:
            allowed &= envelope.admits(q)
        for model, far in envelope.bodies:
            rows = np.flatnonzero(allowed)
            allowed[rows] = ~model.colliding(q[rows], far + self.margin)
        return allowed

    def steps(self, polyline: Array, step: float = _LEG_STEP) -> Ints:
        """Return the numbers of checks along legs from each of configurations (K, n) to the next.

        In each no point of a body moves farther than `step` [m].
        """
        turned = np.abs(np.diff(polyline, axis=0))
        count = (turned * self.robot.joint_weights).max(axis=1) / _TURN_STEP
        for model, _ in self.envelope.bodies:
            count = np.maximum(count, (turned @ model.lever_arms.T).max(axis=1) / step)
        return np.asarray(np.maximum(1, np.ceil(self.finer * count)), dtype=np.int64)

    def share(self, first: Array, last: Array) -> float:
        """Return up to which share of it a straight leg is free, seen from its beginning."""
        count = int(self.steps(np.stack([first, last]))[0])
        shares = np.arange(1, count + 1) / count
        for chunk in _chunks(count):
            some = shares[chunk]
            blocked = np.flatnonzero(~self.free(first + some[:, None] * (last - first)))
            if blocked.size:
                return float((chunk.start + blocked[0]) / count)
        return 1.0

    def is_open(self, first: Array, last: Array, step: float = _LEG_STEP) -> bool:
        """Whether all of a straight leg is free; coarse checks come first."""
        count = int(self.steps(np.stack([first, last]), step)[0])
        order = _spread_out(count)
        for chunk in _chunks(count):
            some = order[chunk] / count
            if not self.free(first + some[:, None] * (last - first)).all():
                return False
        return True

    @property
    def rates(self) -> Array:
        """Time of each joint's unit at full speed, (n,) [s]; 1 without a limit."""
        return np.where(np.isfinite(self.envelope.speed), 1.0 / self.envelope.speed, 1.0)


def find_path(
    room: Room, starts: Array, goals: Array, end: float, rng: np.random.Generator
) -> Array | None:
    """Return a polyline of free legs, (m, n), from one of starts to one of goals.

    Parameters
    ----------
    room : Room
    starts, goals : (a, n), (b, n)
        Free configurations.
    end : float
        When to give up, by the clock of the processor `time.thread_time` [s].
    rng : Generator

    Returns
    -------
    (m, n) or None
        The quickest of a few; None where none was found in time.
    """
    polyline = straight_legs(room, starts, goals)
    if polyline is not None:
        return polyline
    found: list[Array] = []
    while len(found) < _CANDIDATES:
        polyline = _connected(room, starts, goals, end, rng)
        if polyline is None:
            break
        found.append(shortened(room, polyline, rng))
    return min(found, key=lambda polyline: _duration(polyline, room.rates), default=None)


def straight_legs(room: Room, starts: Array, goals: Array) -> Array | None:
    """Return the quickest straight leg that is free from a start to a goal, (2, n); see above."""
    times = (np.abs(starts[:, None] - goals[None]) * room.rates).max(axis=2)
    for pair in np.argsort(times, axis=None)[: len(starts) + len(goals)].tolist():
        i, j = divmod(pair, len(goals))
        if room.is_open(starts[i], goals[j]):
            return np.stack([starts[i], goals[j]])
    return None


def shortened(room: Room, polyline: Array, rng: np.random.Generator) -> Array:
    """Return a polyline (m, n) with free straight shortcuts between points of it."""
    blocked_count = 0
    for _ in range(_SHORTCUTS):
        if len(polyline) < 3 or blocked_count >= _BLOCKED_SHORTCUTS:
            break
        lengths = (np.abs(np.diff(polyline, axis=0)) * room.rates).max(axis=1)
        ends = np.concatenate([[0.0], np.cumsum(lengths)])
        places = np.sort(rng.uniform(0.0, ends[-1], 2))
        # Now and then whole legs: only these lose their ends.
        if rng.uniform() < 0.5:
            places = np.array([ends[np.argmin(np.abs(ends - place))] for place in places])
        legs = np.minimum(np.searchsorted(ends, places, side="right") - 1, len(polyline) - 2)
        shares = (places - ends[legs]) / np.maximum(lengths[legs], 1e-12)
        between = polyline[legs] + shares[:, None] * (polyline[legs + 1] - polyline[legs])
        blocked_count += 1
        if legs[1] > legs[0] and room.is_open(*between):
            polyline = _distinct(
                np.concatenate([polyline[: legs[0] + 1], between, polyline[legs[1] + 1 :]])
            )
            blocked_count = 0
    return polyline


def _distinct(polyline: Array) -> Array:
    """Return a polyline without repeated configurations, with the same ends."""
    retained = np.append(True, np.abs(np.diff(polyline, axis=0)).max(axis=1) > _SAME)
    if not retained[-1] and len(polyline) > 2:
        retained[-1] = True
        retained[np.flatnonzero(retained[:-1])[-1]] = len(np.flatnonzero(retained[:-1])) == 1
    return np.asarray(polyline[retained])


def _duration(polyline: Array, rates: Array) -> float:
    """Return the approximate time of a polyline at full speed [s]; corners count as well."""
    legs = np.abs(np.diff(polyline, axis=0)) * rates
    return float(legs.max(axis=1).sum() + 0.1 * np.linalg.norm(legs, axis=1).sum())


class _Tree:
    """Configurations that are reached from roots by straight legs that are free."""

    def __init__(self, roots: Array, rates: Array) -> None:
        self._q = np.empty((256, roots.shape[1]))
        self._q[: len(roots)] = roots
        self._before = [-1] * len(roots)
        self._rates = rates

    def nearest(self, q: Array) -> int:
        """Return the index of the configuration nearest to q (n,), in time."""
        reached = self._q[: len(self._before)]
        return int(np.argmin((((reached - q) * self._rates) ** 2).sum(axis=1)))

    def add(self, q: Array, before: int) -> int:
        """Add a configuration (n,) that a leg leads to from another one; return its number."""
        if len(self._before) == len(self._q):
            self._q = np.concatenate([self._q, np.empty_like(self._q)])
        self._q[len(self._before)] = q
        self._before.append(before)
        return len(self._before) - 1

    def grow(self, room: Room, q: Array, most: float) -> tuple[int, bool]:
        """Grow towards q, by a leg of `most` [s]; return the new or nearest one, and if it is q."""
        near = self.nearest(q)
        first = self._q[near]
        far = float((np.abs(q - first) * self._rates).max())
        last = q if far <= most else first + most / far * (q - first)
        share = room.share(first, last)
        if share <= 0.0:
            return near, far < _SAME
        reached = last if share == 1.0 else first + share * (last - first)
        return self.add(reached, near), share == 1.0 and far <= most

    def at(self, k: int) -> Array:
        """Return a configuration, (n,)."""
        return np.asarray(self._q[k])

    def polyline(self, k: int) -> Array:
        """Return the polyline from a root to a configuration, (m, n)."""
        found = []
        while k >= 0:
            found.append(self._q[k])
            k = self._before[k]
        return np.array(found[::-1])


def _connected(
    room: Room, starts: Array, goals: Array, end: float, rng: np.random.Generator
) -> Array | None:
    """Return a way by two trees, None where the time is over before."""
    rates = room.rates
    lower, upper = room.envelope.arm(room.robot).finite_limits()
    # Not on the limits themselves, which rounding would lead beyond.
    inside = _INSIDE * (upper - lower)
    lower, upper = lower + inside, upper - inside
    one, other, forward = _Tree(starts, rates), _Tree(goals, rates), True
    middle = 0.5 * (starts[0] + goals[0])
    spread = _SPREAD * float((np.abs(goals[0] - starts[0]) * rates).max()) / rates
    while time.thread_time() < end:
        near = rng.uniform() < _AROUND_MIDDLE
        sample = rng.normal(middle, spread) if near else rng.uniform(lower, upper)
        k, _ = one.grow(room, np.clip(sample, lower, upper), _LEG_RANGE)
        j, met = other.grow(room, one.at(k), math.inf)
        if met:
            halves = (
                (one.polyline(k), other.polyline(j))
                if forward
                else (other.polyline(j), one.polyline(k))
            )
            return _distinct(np.concatenate([halves[0], halves[1][::-1]]))
        one, other, forward = other, one, not forward
    return None


def _chunks(count: int) -> Iterator[slice]:
    """Yield slices of 0 to count - 1, small ones first: collisions are often found early."""
    first, size = 0, 1
    while first < count:
        yield slice(first, first + size)
        first, size = first + size, 2 * size


def _spread_out(count: int) -> Array:
    """Return 1 to count in an order in which each one is far from those before."""
    bits = max(1, math.ceil(math.log2(count + 1)))
    order = np.zeros(2**bits, dtype=np.int64)
    for bit in range(bits):
        order |= ((np.arange(2**bits) >> bit) & 1) << (bits - 1 - bit)
    return order[(order > 0) & (order <= count)].astype(np.float64)


def rounded(room: Room, polyline: Array, passed: Sequence[int] = ()) -> Trajectory | None:
    """Return a polyline (m, n) as a smooth joint path over a time of its own from 0 to 1.

    It has the same ends, and goes through the corners that are `passed`. None if it is not free
    even close to the legs.
    """
    lengths = (np.abs(np.diff(polyline, axis=0)) * room.rates).max(axis=1)
    whole = max(float(lengths.sum()), np.finfo(float).tiny)
    spacing = np.full(len(lengths), whole / _FIRST_POINTS)
    # Near its ends a clamped spline goes through no other control point.
    fewest = _DEGREE + 1 if len(passed) else 1
    while True:
        counts = np.maximum(fewest, np.ceil(lengths / spacing)).astype(np.int64)
        legs = np.repeat(np.arange(len(lengths)), counts)
        points = [
            np.linspace(polyline[k], polyline[k + 1], count, endpoint=False)
            for k, count in enumerate(counts.tolist())
        ]
        path = _spline(_through(points, polyline, passed))
        blocked = _blocked(room, path)
        if not blocked.size:
            return path
        # Of the legs next to a collision.
        at = np.clip(blocked * len(legs), 0, len(legs) - 1).astype(np.int64)
        near = np.unique(np.clip(at[:, None] + np.arange(-2, 3), 0, len(legs) - 1))
        tight = np.unique(legs[near])
        if np.all(spacing[tight] <= whole * _FINEST):
            return None
        spacing[tight] *= 0.5


def _through(points: Sequence[Array], polyline: Array, passed: Sequence[int]) -> Array:
    """Return control points of legs as one list, with three in line around corners to pass.

    The spline goes through a control point that lies halfway between its neighbours.
    """
    legs = list(points)
    for corner in passed:
        here, (one, other) = polyline[corner], (legs[corner - 1][-1], legs[corner][1])
        step = 0.25 * (other - one)
        legs[corner] = np.concatenate([[here - step, here, here + step], legs[corner][1:]])
    return np.concatenate([*legs, polyline[-1:]])


def _spline(points: Array) -> Trajectory:
    """Return the clamped cubic B-spline of control points (k, n) over 0 to 1."""
    from scipy.interpolate import BSpline

    joints = points.shape[1]
    if len(points) <= _DEGREE:
        points = np.stack(
            [
                np.interp(np.linspace(0, 1, _DEGREE + 1), np.linspace(0, 1, len(points)), column)
                for column in points.T
            ],
            axis=1,
        )
    inner = np.linspace(0.0, 1.0, len(points) - _DEGREE + 1)
    knots = np.concatenate([np.zeros(_DEGREE), inner, np.ones(_DEGREE)])
    spline = BSpline(knots, points, _DEGREE)
    # Between knots a quintic with these ends is the cubic itself.
    split = max(1, -(-PATH_SAMPLES // (len(inner) - 1)))
    t = np.linspace(0.0, 1.0, split * (len(inner) - 1) + 1)
    names = tuple(map(str, range(joints)))
    q = spline(t)
    q[0], q[-1] = points[0], points[-1]
    return Trajectory(t, q, spline(t, 1), names, spline(t, 2))


def _blocked(room: Room, path: Trajectory) -> Array:
    """Return the times at which a path is not free, by fine checks."""
    counts = room.steps(path.q, _FINE_STEP)
    steps = [
        np.linspace(one, other, count, endpoint=False)
        for one, other, count in zip(path.t[:-1], path.t[1:], counts.tolist(), strict=True)
    ]
    t = np.concatenate([*steps, path.t[-1:]])
    return t[~room.free(path(t))]

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

# Factor from the largest deviation at the sampled times to an upper bound between them.
SAMPLING_FACTOR = 1.02
# Blend at a corner of a polygon, as a share of the shorter adjacent interval.
_CORNER_SHARE = 1e-3
# Sample points of an interval between two joint targets, as shares of it.
_JOINT_SAMPLES = np.linspace(0.0, 1.0, 8, endpoint=False)
# Sample points of an interval between two poses, as shares of it: joints curve in between.
_POSE_SAMPLES = np.linspace(0.0, 1.0, 16, endpoint=False)
# The only sample point of an interval whose knots are its targets.
_TARGET_SAMPLE = np.zeros(1)
# Sine of an angle below which slerp is replaced by linear interpolation.
_SMALL_SINE = 1e-9

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
        # Rounding of the spline's rates at rest.
        rates[[0, -1]] = 0.0
        return cls(t, q, rates)

    @classmethod
    def cornered(cls, t: Array, q: Array, each: int) -> "Knots":
        """Return a motion (K, n) that is smooth but for a corner at every `each`-th of its times.

        There, and at both ends, the velocity changes within a short time.
        """
        from scipy.interpolate import CubicSpline

        if not np.isfinite(q).all():
            return cls(t, q, q)
        corners = t[::each]
        sides = np.diff(corners)
        reach = _CORNER_SHARE * np.minimum(np.append(sides, np.inf), np.append(np.inf, sides))
        times, positions, rates = [t[:1]], [q[:1]], [0.0 * q[:1]]
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
            positions.append(here)
            rates.append(rate)
        times.append(t[-1:])
        positions.append(q[-1:])
        rates.append(0.0 * q[-1:])
        return cls(np.concatenate(times), np.concatenate(positions), np.concatenate(rates))


def by_interpolation(parts: Iterable[Iterable[Knots]]) -> list[list[Knots]]:
    """Return the parts of a motion by each interpolation that a controller may use.

    Where a part has fewer of them, its last one stands for the others.
    """
    each = [list(part) for part in parts]
    count = max(len(part) for part in each)
    return [[part[min(k, len(part) - 1)] for part in each] for k in range(count)]


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
        Whether it is an inserted slow motion to the next target of a shifted program, and no part
        of the plan.
    """

    name: str
    t: Array
    q: Array
    events: tuple[Event, ...] = ()
    remark: str = ""
    is_slow: bool = False

    # Sample points of an interval for deviations, and knots of motions, as shares of the interval.
    evaluated: ClassVar[Array] = _JOINT_SAMPLES
    knots: ClassVar[Array] = _TARGET_SAMPLE

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
        """Return rows at times on the cubic spline through all, from rest to rest."""
        from scipy.interpolate import CubicSpline

        values: Array = CubicSpline(self.t, self.rows, bc_type="clamped")(times)
        return values

    def joints(self, rows: Array, times: Array) -> Array:
        """Return the joint positions (K, n) of rows at times; NaN where none are known."""
        return rows

    @property
    def curves(self) -> list[Curve]:
        """Interpolations of a controller: polygon, polygon with blended corners, cubic spline."""
        lines = polygons(self.t, self.rows, self.between)
        curves: list[Curve] = [partial(self.between, t=t, rows=rows) for t, rows in lines]
        return curves if len(self.t) < 3 else [*curves, self.spline]

    def evaluation_times(self) -> Array:
        """Return times at targets and between them (K,) [s]."""
        return finer(self.t, self.evaluated)

    def interpolated(self, times: Array) -> list[Array]:
        """Return joint positions (K, n) at times by each interpolation."""
        return [self.joints(curve(times), times) for curve in self.curves]

    def reference(self, motion: Trajectory, first: float) -> Array:
        """Return a planned motion from time `first` on, at the evaluation times (K, n)."""
        return motion(np.clip(first + self.evaluation_times(), motion.t[0], motion.t[-1]))

    def motions(self) -> Iterator[Knots]:
        """Yield the joint motion by each interpolation: spline, polygon, blended corners.

        With as few knots as it takes; `deviation_of` describes the interpolations. NaN where no
        joints are known.
        """
        times = finer(self.t, self.knots)
        yield Knots.smooth(times, self.joints(self.spline(times), times))
        for t, rows in polygons(self.t, self.rows, self.between):
            times = finer(t, self.knots)
            q = self.joints(self.between(times, t, rows), times)
            yield Knots.cornered(times, q, len(self.knots))


class Deviation(NamedTuple):
    """Largest deviation of a controller's motion from the planned one.

    Attributes
    ----------
    position, rotation : float
        Of the tool [m, rad].
    joint : float
        Of any joint [rad or m].
    """

    position: float
    rotation: float
    joint: float

    def share(self, allowed: Tolerance) -> float:
        """Return the deviation as a share of the tolerance; above 1 it is violated."""
        rotation = max(self.rotation, self.joint) / allowed.rotation
        return SAMPLING_FACTOR * max(self.position / allowed.position, rotation)

    @property
    def stated(self) -> "Deviation":
        """The value that files state: with a factor for maxima between the sampled times."""
        return Deviation(
            SAMPLING_FACTOR * self.position,
            SAMPLING_FACTOR * self.rotation,
            SAMPLING_FACTOR * self.joint,
        )


class Deviations(NamedTuple):
    """Largest deviations along seams, and in free moves.

    Attributes
    ----------
    path, moves : Miss
    """

    path: Deviation
    moves: Deviation

    def worse(self, other: "Deviations") -> "Deviations":
        """Return the componentwise maximum."""
        return Deviations(*(Deviation(*map(max, *pair)) for pair in zip(self, other, strict=True)))


NO_DEVIATION = Deviation(0.0, 0.0, 0.0)


def deviation_of(
    segment: Segment, motion: Trajectory, chains: Sequence[Chain], first: float = 0.0
) -> Deviation:
    """Return the largest deviation of a segment from a motion over all interpolations.

    Between targets a controller may interpolate linearly in joint space; blend each corner along
    the line between the midpoints of its two sides, the largest blend of any controller; or follow
    the clamped cubic spline through all targets. All are compared at equal times, which bounds the
    speeds as well; segments at a speed are compared at equal arc lengths.
    """
    times, exact = segment.evaluation_times(), segment.reference(motion, first)
    worst = NO_DEVIATION
    for line in segment.interpolated(times):
        worst = Deviation(*map(max, worst, deviation_between(line, exact, chains)))
    return worst


def deviation_between(q: Array, exact: Array, chains: Sequence[Chain]) -> Deviation:
    """Return the largest deviation between two sequences of configurations (K, n).

    Infinite where a configuration is NaN: inverse kinematics has no solution there.
    """
    from scipy.spatial.transform import Rotation

    if not np.isfinite(q).all():
        return Deviation(np.inf, np.inf, np.inf)
    position = rotation = 0.0
    for chain in chains:
        _, here, there = chain.along(q)
        _, turned, placed = chain.along(exact)
        position = max(position, float(np.linalg.norm(there - placed, axis=1).max()))
        quaternions = Rotation.from_matrix(np.einsum("kji,kjl->kil", here, turned)).magnitude()
        rotation = max(rotation, float(quaternions.max()))
    return Deviation(position, rotation, float(np.abs(q - exact).max()))


def finer(t: Array, between: Array) -> Array:
    """Return times with further ones in each interval, at `between` as shares of it."""
    return np.append((t[:-1, None] + between * np.diff(t)[:, None]).ravel(), t[-1])


def polygons(
    t: Array, rows: Array, between: Callable[[Array, Array, Array], Array]
) -> list[tuple[Array, Array]]:
    """Return the polygon through targets, and that through the midpoints of its sides.

    Parameters
    ----------
    t : (K,)
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


# Tool poses as targets, and the joint motion that a controller makes of them.
#
# Between two poses the position is linear in the path parameter, the orientation turns about one
# axis evenly (slerp; Shoemake, "Animating rotation with quaternion curves", 1985), and external
# axes are linear; the arm's joints follow by inverse kinematics from where they are. That is what
# ``MoveL``, ``LIN`` and ``movel`` are documented to do. ``SPLINE`` goes smoothly through all
# poses.


@dataclass(frozen=True, eq=False, kw_only=True)
class PoseSegment(Segment):
    """A motion from rest to rest through tool poses.

    Attributes
    ----------
    positions, quaternions : (K + 1, 3), (K + 1, 4)
        Tool poses in the work object: positions [m], and quaternions x, y, z, w, each with the sign
        that is nearer to the previous one.
    frames : ToolFrames
    near : callable
        Times → initial guesses of inverse kinematics (K, n), in the robot's order.
    order : (n,)
        Index of the robot's joint for each column of `q`.
    """

    positions: Array
    quaternions: Array
    frames: ToolFrames
    near: Callable[[Array], Array]
    order: Ints

    evaluated: ClassVar[Array] = _POSE_SAMPLES
    knots: ClassVar[Array] = _POSE_SAMPLES

    @override
    def in_order(self, order: Sequence[int]) -> "PoseSegment":
        return replace(self, q=self.q[:, order], order=self.order[list(order)])

    @property
    @override
    def rows(self) -> Array:
        """Positions, quaternions and external axes, (K + 1, 7 + m)."""
        by_robot = self.q[:, np.argsort(self.order)]
        return np.hstack([self.positions, self.quaternions, by_robot[:, self.frames.external]])

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
        joints, arrived = self.frames.inverse_kinematics(rows[:, :3], rows[:, 3:7], q)
        return np.where(arrived[:, None], joints, np.nan)[:, self.order]


def straight(times: Array, t: Array, rows: Array) -> Array:
    """Return rows (K, 7 + m) at times: positions linear, orientations by slerp."""
    k = np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(t) - 2)
    share = ((times - t[k]) / (t[k + 1] - t[k]))[:, None]
    values: Array = (1.0 - share) * rows[k] + share * rows[k + 1]
    first, last = rows[k, 3:7], rows[k + 1, 3:7]
    # Below 90°, as consecutive quaternions have the nearer sign.
    apart, together = (
        np.linalg.norm(each, axis=1, keepdims=True) for each in (first - last, first + last)
    )
    angle = 2.0 * np.arctan2(apart, together)
    sine = np.sin(angle)
    near = sine < _SMALL_SINE
    sine = np.where(near, 1.0, sine)
    one, other = np.sin((1.0 - share) * angle) / sine, np.sin(share * angle) / sine
    turned = np.where(near, values[:, 3:7], one * first + other * last)
    values[:, 3:7] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    return values


def fastest_between(t: Array, positions: Array, quaternions: Array) -> tuple[float, float]:
    """Return the largest linear and angular speed of the tool through timed poses [m/s, rad/s].

    By linear interpolation, and on the clamped cubic spline.
    """
    from scipy.interpolate import CubicSpline

    steps = np.diff(t)
    fast = float((np.linalg.norm(np.diff(positions, axis=0), axis=1) / steps).max())
    apart = np.linalg.norm(np.diff(quaternions, axis=0), axis=1)
    turning = float((4.0 * np.arcsin(np.minimum(0.5 * apart, 1.0)) / steps).max())
    spline = CubicSpline(t, np.hstack([positions, quaternions]), bc_type="clamped")
    rates = spline(finer(t, _POSE_SAMPLES), 1)
    fast = max(fast, float(np.linalg.norm(rates[:, :3], axis=1).max()))
    # The rate of a unit quaternion is half the angular speed.
    return fast, max(turning, 2.0 * float(np.linalg.norm(rates[:, 3:], axis=1).max()))


def aligned_quaternions(quaternions: Array) -> Array:
    """Return quaternions (K, 4), each with the sign that is nearer to the previous one."""
    aligned = np.array(quaternions)
    for k in range(1, len(aligned)):
        if aligned[k] @ aligned[k - 1] < 0.0:
            aligned[k] *= -1.0
    return aligned

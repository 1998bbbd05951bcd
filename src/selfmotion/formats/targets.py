"""Joint targets that a controller passes, and how far that takes it off the motion.

A motion is cut where the arm rests, be it for an instant: controllers stop there, and what happens
there happens on time. Of what is left, targets are as far apart as the
error of straight joint lines between them allows, h²|Jq̈|/8 ≤ deviation, spread over the time
evenly in ∫ √(|Jq̈|/8) dt (de Boor, "Good approximation by splines with variable knots", 1973).
What is left of error is then measured by forward kinematics.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from selfmotion.basics import Array, Flags, PlanError, ProblemError
from selfmotion.certificate import Tolerance
from selfmotion.job import Program
from selfmotion.motion import Trajectory
from selfmotion.result import Move, Parts, Plan
from selfmotion.robot import Chain

# Programs count times [s], angles [°] and lengths [mm] in so many digits behind the point.
TIME_DIGITS, ANGLE_DIGITS, LENGTH_DIGITS = 5, 5, 4
# The arm rests where it is as slow as this [rad or m/s] for at least so long [s].
_REST, _WHILE = 1e-7, 0.02
# Programs go from rest to rest: this is rest [rad or m/s], and so is such a share of the fastest.
_SLOW, _SHARE = 1e-4, 1e-3
# Where between two targets, and how near to each, the error is looked at.
_BETWEEN = np.array([0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875])
# Times at which the motion's curvature is looked at, for each of its samples; targets at least
# between two events or rests, tries, and more targets than this no controller takes.
_FINER, _FEWEST, _TRIES, _MOST = 4, 4, 20, 100_000


class Event(NamedTuple):
    """What happens when a target is reached: its number in the stretch, and what."""

    target: int
    name: str


@dataclass(frozen=True, eq=False)
class Stretch:
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
    """

    name: str
    t: Array
    q: Array
    events: tuple[Event, ...] = ()

    @property
    def is_rest(self) -> bool:
        """Whether the arm rests all the while."""
        return bool((self.q == self.q[0]).all())


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
        return max(self.position / allowed.position, rotation)


class Piece(NamedTuple):
    """A part of a motion with a name, events at times from its start, and the tools' chains."""

    name: str
    motion: Trajectory
    events: tuple[tuple[float, str], ...]
    chains: tuple[Chain, ...]


def pieces_of(plan: Plan | Parts | Move | Program) -> list[Piece]:
    """Return what a plan, parts, a move or a program is made of, in order.

    Raises
    ------
    PlanError
        A move was not found, or there is nothing.
    """
    match plan:
        case Plan():
            return [_of_plan("path", plan)]
        case Move():
            return [Piece("move", plan.motion, (), (plan.robot.chain,))]
        case Parts():
            found = []
            for number, part in enumerate(plan.plans, 1):
                found.append(_of_plan(f"part {number}", part))
                for move in plan.moves[number - 1 : number]:
                    found.append(Piece(f"move {number}", move.motion, (), (move.robot.chain,)))
            return found
    found = []
    for step in plan.steps:
        events = tuple((at, name) for name, at in sorted(step.events, key=lambda item: item[1]))
        made = step.made
        several = _of_plan("", made).chains if isinstance(made, Plan) else (made.robot.chain,)
        found.append(Piece(step.name, step.motion, events, several))
    if not found:
        raise PlanError(f"{plan.robot.name}: {plan.verdict}")
    return found


def _of_plan(name: str, plan: Plan) -> Piece:
    chains = tuple(item.chain for item in plan.problem.follows.items)
    return Piece(name, plan.trajectory, (), chains)


def stretches_of(
    pieces: Sequence[Piece], slides: Flags, allowed: Tolerance
) -> tuple[list[Stretch], Miss]:
    """Return the targets of a motion, as its file has them, and how far they are off it.

    Raises
    ------
    ProblemError
        It does not begin and end at rest, or takes more targets than any controller has.
    """
    found: list[Stretch] = []
    worst = Miss(0.0, 0.0, 0.0)
    for piece in pieces:
        motion = piece.motion
        for when in motion.t[[0, -1]]:
            speed = np.abs(motion(when, 1))
            if speed.max() > _SLOW:
                raise ProblemError(
                    f"'{piece.name}' has joint '{motion.joint_names[int(speed.argmax())]}' at "
                    f"{speed.max():.3g} rad/s or m/s at t = {when:.6g} s; programs of controllers "
                    f"go from rest to rest: plan it with a ramp, or rest=True"
                )
        for first, last in _moving(motion, [motion.t[0] + at for at, _ in piece.events]):
            stretch, miss = _thinned(piece, slides, allowed, first, last)
            worst = Miss(*map(max, worst, miss))
            found.append(stretch)
    return found, worst


def _moving(motion: Trajectory, events: Sequence[float]) -> list[tuple[float, float]]:
    """Return when motions from rest to rest, and rests, begin and end, in turn [s]."""
    still = np.abs(motion.qd).max(axis=1) < _REST
    still[:-1] &= np.abs(np.diff(motion.q, axis=0)).max(axis=1) < 1e-9
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still[:-1], [False]]).astype(int)))
    marks = [float(motion.t[0])]
    for begin, end in edges.reshape(-1, 2):
        if motion.t[end] - motion.t[begin] >= _WHILE:
            marks += [float(motion.t[begin]), float(motion.t[end])]
    marks.append(float(motion.t[-1]))
    for stop in _stops(motion, events):
        if np.abs(stop - np.array(marks)).min() >= _WHILE and not _within(stop, marks, motion):
            marks.append(stop)
    marks = sorted(set(marks))
    return list(pairwise(marks))


def _within(stop: float, marks: Sequence[float], motion: Trajectory) -> bool:
    """Whether a time is in one of the rests that last."""
    first, last = max(m for m in marks if m < stop), min(m for m in marks if m > stop)
    return bool(np.abs(motion(last) - motion(first)).max() < 1e-9) and _rests(motion, first, last)


def _stops(motion: Trajectory, events: Sequence[float]) -> list[float]:
    """Return when the arm rests for an instant [s]: where an event is then, at that."""
    speeds = np.abs(motion.qd).max(axis=1)
    slow = min(_SLOW, _SHARE * float(speeds.max()))
    inside = np.clip(events, motion.t[0], motion.t[-1]).tolist()
    found = [at for at in inside if np.abs(motion(at, 1)).max() < slow]
    edges = np.diff(np.concatenate([[False], speeds < slow, [False]]).astype(int))
    for begin, end in np.flatnonzero(edges).reshape(-1, 2):
        found.append(float(motion.t[begin + int(speeds[begin:end].argmin())]))
    return found


def _thinned(
    piece: Piece, slides: Flags, allowed: Tolerance, first: float, last: float
) -> tuple[Stretch, Miss]:
    """Return the targets from one time to another, and how far they are off."""
    motion = piece.motion
    begins, ends = first == motion.t[0], last == motion.t[-1]
    events = [
        (motion.t[0] + at, name)
        for at, name in piece.events
        if (begins or first < motion.t[0] + at) and (ends or motion.t[0] + at <= last)
    ]
    fixed = _apart(first, last, [at for at, _ in events])
    still = bool(np.abs(motion(last) - motion(first)).max() < 1e-9) and _rests(motion, first, last)
    more = 1.0
    for _ in range(_TRIES):
        t = fixed if still else _spread(piece, fixed, allowed, more)
        if len(t) > _MOST:
            raise ProblemError(
                f"'{piece.name}' takes more than {_MOST} targets within {allowed}; allow more"
            )
        q = _in_digits(motion(t), slides)
        if still:
            q[:] = q[0]
        offset = np.round(t - first, TIME_DIGITS)
        named = tuple(Event(int(np.abs(t - at).argmin()), name) for at, name in events)
        stretch = Stretch(piece.name, offset, q, named)
        miss = miss_of(stretch, motion, piece.chains, first)
        if still or miss.share(allowed) <= 1.0:
            return stretch, miss
        more *= max(1.05, 1.02 * float(np.sqrt(miss.share(allowed))))
    raise ProblemError(
        f"'{piece.name}' is off by {1e3 * miss.position:.3g} mm and {miss.rotation:.3g} rad by "
        f"rounding alone; allow more than {allowed}"
    )


def _apart(first: float, last: float, times: Sequence[float]) -> Array:
    """Return first, last and times between them, but for those that are written as the same."""
    least, found = 2.0 * 10.0**-TIME_DIGITS, [first]
    for t in sorted(times):
        if found[-1] + least < t < last - least:
            found.append(t)
    return np.array([*found, last])


def _rests(motion: Trajectory, first: float, last: float) -> bool:
    times = np.linspace(first, last, 33)
    return bool(np.abs(motion(times) - motion(first)).max() < 1e-9)


def _spread(piece: Piece, fixed: Array, allowed: Tolerance, more: float) -> Array:
    """Return times between fixed ones, even in the root of how much the motion bends."""
    found = [fixed[:1]]
    motion = piece.motion
    for begin, end in pairwise(fixed):
        inside = motion.t[(motion.t > begin) & (motion.t < end)]
        marks = np.concatenate([[begin], inside, [end]])
        count = _FINER * (len(marks) - 1) + 1
        t = np.interp(np.linspace(0, len(marks) - 1, count), np.arange(len(marks)), marks)
        bend = _bend(piece, t, allowed)
        # Floor: no stretch is without targets where it bends nowhere.
        rate = np.sqrt(bend / 8.0) + 1e-3 / max(end - begin, 1e-6)
        way = np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t)))
        targets = max(_FEWEST, int(np.ceil(more * way[-1])))
        # Programs count whole digits of time: targets may not fall on each other.
        targets = min(targets, max(1, int((end - begin) * 10**TIME_DIGITS / 2)))
        found.append(np.interp(np.linspace(0.0, way[-1], targets + 1)[1:], way, t))
        found[-1][-1] = end
    return np.concatenate(found)


def _bend(piece: Piece, t: Array, allowed: Tolerance) -> Array:
    """Return the accelerations of tool and joints as shares of what is allowed, (K,) [1/s²]."""
    motion = piece.motion
    q, qdd = motion(t), motion(t, 2)
    found: Array = np.abs(qdd).max(axis=1) / allowed.rotation
    for chain in piece.chains:
        rates = np.einsum("kij,kj->ki", chain.along(q)[0], qdd)
        for rows, limit in ((slice(0, 3), allowed.position), (slice(3, 6), allowed.rotation)):
            found = np.maximum(found, np.linalg.norm(rates[:, rows], axis=1) / limit)
    return found


def _in_digits(q: Array, slides: Flags) -> Array:
    """Return coordinates [rad or m] as they are when their digits in a file are read again."""
    degrees = np.radians(np.round(np.degrees(q), ANGLE_DIGITS))
    return np.where(slides, 1e-3 * np.round(1e3 * q, LENGTH_DIGITS), degrees)


def miss_of(
    stretch: Stretch, motion: Trajectory, chains: Sequence[Chain], first: float = 0.0
) -> Miss:
    """Return how far a controller is off a motion at most, whichever way it joins the targets.

    In between it may go straight in joint space, past each corner on the line between the middles
    of the two sides, which is the largest corner that controllers round, or along the cubic spline
    through all targets that begins and ends at rest; at the times of the motion, which holds it to
    its speeds as well.
    """
    t, q = stretch.t, stretch.q
    times = np.append((t[:-1, None] + _BETWEEN * np.diff(t)[:, None]).ravel(), t[-1])
    exact = motion(np.clip(first + times, motion.t[0], motion.t[-1]))
    worst = Miss(0.0, 0.0, 0.0)
    for line in _ways(t, q, times):
        joint = float(np.abs(line - exact).max())
        worst = worst._replace(joint=max(worst.joint, joint))
        for chain in chains:
            _, here, there = chain.along(line)
            _, turned, placed = chain.along(exact)
            position = float(np.linalg.norm(there - placed, axis=1).max())
            turns = Rotation.from_matrix(np.einsum("kji,kjl->kil", here, turned)).magnitude()
            worst = Miss(
                max(worst.position, position), max(worst.rotation, float(turns.max())), worst.joint
            )
    return worst


def _ways(t: Array, q: Array, times: Array) -> list[Array]:
    """Return joint positions (K, n) at times by each way of joining targets."""
    lines = _straight(times, t, q)
    if len(t) < 3:
        return [lines]
    middles = 0.5 * (t[:-1] + t[1:])
    knots = np.concatenate([t[:1], middles, t[-1:]])
    corners = _straight(times, knots, _straight(knots, t, q))
    spline = CubicSpline(t, q, bc_type="clamped")(times)
    return [lines, corners, spline]


def _straight(times: Array, t: Array, q: Array) -> Array:
    return np.stack([np.interp(times, t, column) for column in q.T], axis=1)

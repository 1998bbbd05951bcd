"""Seams and moves of a motion, and the fewest joint targets that keep a controller near it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import islice, pairwise
from typing import ClassVar, NamedTuple

import numpy as np

from selfmotion.basics import Array, Flags, PlanError, ProblemError
from selfmotion.certificate import Requirement, Separation, Tolerance, arm_limits, limits_of_joints
from selfmotion.model.motion import Trajectory
from selfmotion.model.path import REST_SPEED as _REST, FeedProfile, Path
from selfmotion.model.robot import Chain
from selfmotion.model.task import Task
from selfmotion.planning.result import Move, Parts, Plan
from selfmotion.problem.constraints import (
    Constraint,
)
from selfmotion.problem.problem import Problem
from selfmotion.shop.controllers.segments import (
    NO_DEVIATION,
    Deviation,
    Event,
    Segment,
    deviation_between,
    deviation_of,
)
from selfmotion.work.job import Program

# Largest deviation of a move through the air, however much room there is [m, rad].
_ROOMY = Tolerance(5e-3, 5e-3)
# Share of the room between bodies that is used: distances are found to a fiftieth.
_SURE = 0.9


class Operation(NamedTuple):
    """A seam or a move of a motion: its name, events at times from its start, the tools' chains.

    Of a move through the air also how far a controller may be off it, where there is room; of a
    seam the feeds that its tools keep, one list for each chain. `speeds` (n,) are what joints may
    have [rad/s or m/s]. `keeps` says whether another motion keeps all that a seam's has to but
    accelerations, within a tolerance; `rotation_task` is the task whose rows prescribe the
    tool's rotation, but for relaxed ones; `tool_rests` are the times at which the tool rests [s].
    """

    name: str
    motion: Trajectory
    events: tuple[tuple[float, str], ...]
    chains: tuple[Chain, ...]
    is_move: bool = False
    room: Tolerance | None = None
    feeds: tuple[tuple[FeedProfile, ...], ...] = ()
    speeds: Array | None = None
    keeps: Callable[[Trajectory, Tolerance], bool] | None = None
    rotation_task: Task = Task.POSE
    tool_rests: tuple[float, ...] = ()


def operations_of(plan: Plan | Parts | Move | Program) -> list[Operation]:
    """Return the seams and moves of a plan, parts, a move or a program, in order.

    Raises
    ------
    PlanError
        A move was not found, or there is nothing.
    """
    match plan:
        case Plan():
            return [_plan_operation("path", plan)]
        case Move():
            return [_move_operation("move", plan)]
        case Parts():
            operations = []
            for number, part in enumerate(plan.plans, 1):
                operations.append(_plan_operation(f"part {number}", part))
                operations += [
                    _move_operation(f"move {number}", m) for m in plan.moves[number - 1 : number]
                ]
            return operations
    operations = []
    for step in plan.steps:
        planned = step.made
        operation = (
            _plan_operation(step.name, planned)
            if isinstance(planned, Plan)
            else _move_operation(step.name, planned)
        )
        operations.append(
            operation._replace(events=tuple((at, name) for name, at in step.happenings))
        )
    if not operations:
        raise PlanError(f"{plan.robot.name}: {plan.verdict}")
    return operations


def _plan_operation(name: str, plan: Plan) -> Operation:
    items = plan.problem.follows.items
    chains = tuple(item.chain for item in items)
    feeds = tuple(tuple(feed for feed in item.path.feeds if feed.kept) for item in items)
    speeds = _speeds((*arm_limits(plan.robot, plan.requirements), *plan.requirements))

    def keeps(motion: Trajectory, within: Tolerance) -> bool:
        return by_targets(plan.problem).certify(motion, within).verified

    relaxed = {row for item in plan.problem.relaxations for row in item.rows}
    rotation_task = Task.POSITION if relaxed & {"rx", "ry", "rz"} else plan.problem.task
    return Operation(
        name,
        plan.trajectory,
        (),
        chains,
        feeds=feeds,
        speeds=speeds,
        keeps=keeps,
        rotation_task=rotation_task,
        tool_rests=_rests_of(plan.problem.path),
    )


def _rests_of(path: Path) -> tuple[float, ...]:
    """Return at which of its marks a path is at rest, but for its ends [s]."""
    marks = path.marks[1:-1]
    at_rest = np.linalg.norm(path.samples(marks).twist, axis=1) < _REST if len(marks) else []
    return tuple(float(t) for t in marks[at_rest])


def by_targets(problem: Problem) -> Problem:
    """Return a problem with the constraints that targets can keep."""
    return replace(problem, constraints=constraints_of_targets(problem.constraints))


def constraints_of_targets(constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
    """Return the constraints that targets can keep: accelerations are the controller's own."""
    kept = (item.for_controller() for item in constraints)
    return tuple(item for item in kept if item is not None)


def constraints_of_lines(constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
    """Return the constraints that straight lines can keep: corners have no acceleration.

    Nor torques, then, which are judged along the smooth curve.
    """
    kept = (item.for_controller(lines=True) for item in constraints)
    return tuple(item for item in kept if item is not None)


def _move_operation(name: str, move: Move) -> Operation:
    room = safe_deviation(move)
    return Operation(
        name,
        move.motion,
        (),
        (move.robot.chain,),
        is_move=True,
        room=room,
        speeds=_speeds(move.requirements),
    )


def _speeds(requirements: Sequence[Requirement]) -> Array | None:
    """Return the limits of joint speed (n,) among requirements; None for none."""
    limits = [item.upper for item in limits_of_joints(requirements, 1)]
    return np.minimum.reduce(limits) if limits else None


def safe_deviation(move: Move) -> Tolerance | None:
    """Return how far a controller may be off a move so that it keeps apart; None for not at all.

    The distance of a pair of bodies changes by Σ_j l_j |Δq_j| at most, with l its levers: so joints
    may be off by the room that is left over the required distance, divided by the largest Σ_j l_j.
    """
    joint = _ROOMY.rotation
    for item, finding in zip(move.requirements, move.findings, strict=True):
        if isinstance(item, Separation) and item.model.pairs:
            lever = float(item.model.pair_levers_up_to(_farthest(move)).sum(axis=1).max())
            joint = min(joint, _SURE * (finding.amount - item.distance) / max(lever, 1e-9))
    return Tolerance(_ROOMY.position, joint) if joint > 0.0 else None


def _farthest(move: Move) -> Array:
    return np.asarray(np.abs(move.motion.q).max(axis=0))


# As few joint targets as keep a controller near a motion.
#
# Targets are as far apart as the error of straight joint lines between them allows, h²|Jq̈|/8 ≤
# deviation, spread over the time evenly in ∫ √(|Jq̈|/8) dt (de Boor, "Good approximation by
# splines with variable knots", 1973). What is left of it is then measured by forward kinematics.
# Steps in which the spline through the targets misses a feed, or passes a limit of speed, are
# halved.

# Decimals of times in programs [s].
TIME_DIGITS = 5
# Decimals of angles in programs [°].
ANGLE_DIGITS = 5
# Decimals of lengths in programs [mm].
LENGTH_DIGITS = 4
# Share of a feed's tolerance that targets may use at the times that are evaluated: it is larger in
# between.
_OF_FEED = 0.8
# Shortest step [s]: no controller has shorter cycles, and the digits of angles would be jumps of
# speed.
_SHORTEST = 2e-3
# Share of a limit of speed that the spline may use if the motion uses no more.
_OF_SPEED = 0.9995
# Times at which the motion's curvature is evaluated, per interval between two samples.
_FINER = 4
# Largest number of refinements of the targets.
_MAX_REFINEMENTS = 20
# Largest number of targets that a controller takes.
_MOST = 100_000


@dataclass(frozen=True, eq=False)
class Section:
    """Section of an operation between two rests.

    Attributes
    ----------
    operation : Operation
    slides : (n,)
        Whether each joint is prismatic.
    first, last : float
        Begin and end [s].
    """

    operation: Operation
    slides: Flags
    first: float
    last: float
    # Smallest density of targets, as a share of the largest one.
    min_density: ClassVar[float] = 0.1
    # Smallest number of targets between two events or rests.
    fewest: ClassVar[int] = 4

    @property
    def events(self) -> list[tuple[float, str]]:
        """Times of the section's events [s], and their names."""
        start, end = float(self.operation.motion.t[0]), float(self.operation.motion.t[-1])
        return [
            (start + at, name)
            for at, name in self.operation.events
            if (self.first == start or self.first < start + at)
            and (self.last == end or start + at <= self.last)
        ]

    def segments(self, allowed: Tolerance) -> list[tuple[Segment, Deviation]]:
        """Return the segments of the section: several if the tool rests in between.

        Raises
        ------
        ProblemError
            See `thinned`.
        """
        return [self.thinned(allowed)]

    def thinned(self, allowed: Tolerance) -> tuple[Segment, Deviation]:
        """Return the segment with the fewest targets, and its deviation.

        Raises
        ------
        ProblemError
            The digits of files are too few for the tolerance, or the targets too many.
        """
        fixed = _distinct_times(self.first, self.last, [at for at, _ in self.events])
        if is_at_rest(self.operation.motion, self.first, self.last):
            return self._segment_through(fixed, at_rest=True), NO_DEVIATION
        self._check_digits(allowed)
        t = self._target_times(allowed, fixed)
        for _ in range(_MAX_REFINEMENTS):
            segment = self._segment_through(t)
            exceeded = self._exceeds_speed(segment)
            if not exceeded.any():
                break
            # With the neighbouring intervals, so that their lengths vary slowly.
            near = np.convolve(exceeded, np.ones(3), mode="same") > 0.0
            near &= np.diff(t) > 2.0 * _SHORTEST
            if not near.any():
                break
            t = np.sort(np.append(t, 0.5 * (t[1:] + t[:-1])[near]))
        return segment, self._deviation(segment)

    def _target_times(self, allowed: Tolerance, fixed: Array) -> Array:
        """Return times of targets with which the deviation is within the tolerance."""
        more = 1.0
        for _ in range(_MAX_REFINEMENTS):
            t = self.spread_targets(fixed, allowed, more)
            deviation = self._deviation(self._segment_through(t))
            if deviation.share(allowed) <= 1.0:
                return t
            more *= max(1.05, 1.02 * float(np.sqrt(deviation.share(allowed))))
        raise ProblemError(
            f"'{self.operation.name}' is off by {1e3 * deviation.position:.3g} mm and "
            f"{np.degrees(max(deviation.rotation, deviation.joint)):.3g}° with {len(t)} targets; "
            f"allow more than {_tolerance_text(self.operation, allowed)}"
        )

    def spread_targets(self, fixed: Array, allowed: Tolerance, more: float) -> Array:
        """Return times between fixed ones, with a density by the root of the acceleration."""
        times, motion = [fixed[:1]], self.operation.motion
        for begin, end in pairwise(fixed):
            inside = motion.t[(motion.t > begin) & (motion.t < end)]
            marks = np.concatenate([[begin], inside, [end]])
            count = _FINER * (len(marks) - 1) + 1
            t = np.interp(np.linspace(0, len(marks) - 1, count), np.arange(len(marks)), marks)
            rate = np.sqrt(self.scaled_acceleration(t, allowed) / 8.0)
            # A spline oscillates where interval lengths jump.
            rate = np.maximum(rate, self.min_density * float(rate.max())) + 1e-3 / max(
                end - begin, 1e-6
            )
            total = np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t)))
            targets = max(self.fewest, int(np.ceil(more * total[-1])))
            # Times have few digits in programs: targets may not coincide.
            targets = min(targets, max(1, int((end - begin) * 10**TIME_DIGITS / 2)))
            times.append(np.interp(np.linspace(0.0, total[-1], targets + 1)[1:], total, t))
            times[-1][-1] = end
        return np.concatenate(times)

    def scaled_acceleration(self, t: Array, allowed: Tolerance) -> Array:
        """Return accelerations of tool and joints divided by their tolerances, (K,) [1/s²]."""
        motion = self.operation.motion
        q, qdd = motion(t), motion(t, 2)
        scaled: Array = np.abs(qdd).max(axis=1) / allowed.rotation
        for chain in self.operation.chains:
            rates = np.einsum("kij,kj->ki", chain.along(q)[0], qdd)
            for rows, limit in ((slice(0, 3), allowed.position), (slice(3, 6), allowed.rotation)):
                scaled = np.maximum(scaled, np.linalg.norm(rates[:, rows], axis=1) / limit)
        return scaled

    def _segment_through(self, t: Array, *, at_rest: bool = False) -> Segment:
        """Return the segment of targets at times, rounded to the digits of the file."""
        if len(t) > _MOST:
            raise ProblemError(
                f"'{self.operation.name}' takes more than {_MOST} targets; allow a larger deviation"
            )
        offset = np.round(t - self.first, TIME_DIGITS)
        # Configurations at the rounded times.
        q = self._rounded(self.operation.motion(np.minimum(self.first + offset, self.last)))
        if at_rest:
            q[:] = q[0]
        events = (Event(int(np.abs(t - at).argmin()), name) for at, name in self.events)
        return Segment(self.operation.name, offset, q, tuple(events))

    def _deviation(self, segment: Segment) -> Deviation:
        return deviation_of(segment, self.operation.motion, self.operation.chains, self.first)

    def _rounded(self, q: Array) -> Array:
        """Return coordinates [rad or m] rounded to the digits of files."""
        degrees = np.radians(np.round(np.degrees(q), ANGLE_DIGITS))
        return np.where(self.slides, 1e-3 * np.round(1e3 * q, LENGTH_DIGITS), degrees)

    def _check_digits(self, allowed: Tolerance) -> None:
        """Refuse a tolerance below the rounding of targets to the digits of files."""
        q = self.operation.motion.q
        deviation = deviation_between(self._rounded(q), q, self.operation.chains)
        if deviation.share(allowed) > 1.0:
            raise ProblemError(
                f"'{self.operation.name}': programs count angles in {10.0**-ANGLE_DIGITS:g}°, "
                f"which is up to {1e3 * deviation.position:.2g} mm and "
                f"{np.degrees(deviation.rotation):.2g}° of the tool; allow more than "
                f"{_tolerance_text(self.operation, allowed)}"
            )

    def _exceeds_speed(self, segment: Segment) -> Flags:
        """Whether a feed or a speed limit is violated in each interval between targets, (K,).

        Only where the motion itself satisfies it; on the spline through the targets, and by linear
        interpolation. Blended corners are slower than these.
        """
        far = np.zeros(len(segment.t) - 1)
        for times, q, qd in islice(segment.motions(), 2):
            step = np.clip(np.searchsorted(segment.t, times, side="right") - 1, 0, len(far) - 1)
            np.maximum.at(far, step, self._speed_shares(times, q, qd))
        return np.asarray(far > 1.0)

    def _speed_shares(self, times: Array, q: Array, qd: Array) -> Array:
        """Return deviations of speeds as shares of the margins of feeds and speed limits, (K,)."""
        motion = self.operation.motion
        t = np.clip(self.first + times, self.first, motion.t[-1])
        exact, rates = motion(t), motion(t, 1)
        shares = np.zeros(len(t))
        if self.operation.speeds is not None:
            within = np.abs(rates) <= _OF_SPEED * self.operation.speeds
            shares = np.where(within, np.abs(qd) / (_OF_SPEED * self.operation.speeds), 0.0).max(
                axis=1
            )
        for chain, feeds in zip(self.operation.chains, self.operation.feeds, strict=False):
            moved, wanted = (
                np.einsum("kcn,kn->kc", chain.along(at)[0][:, :3], speeds)
                for at, speeds in ((q, qd), (exact, rates))
            )
            off = np.abs(np.einsum("kc,kc->k", moved - wanted, wanted))
            for feed in feeds:
                room = _OF_FEED * feed.slowest * feed.left_over
                for begin, end in feed.during + motion.t[0]:
                    during = (t > begin) & (t < end)
                    shares = np.maximum(shares, np.where(during, off / max(room, 1e-12), 0.0))
        return shares


def _tolerance_text(operation: Operation, allowed: Tolerance) -> str:
    """Return a tolerance as a line of a file of settings."""
    key = "move_deviation" if operation.is_move else "deviation"
    return (
        f"{key} = {{ position_mm = {1e3 * allowed.position:.3g}, "
        f"rotation_deg = {np.degrees(allowed.rotation):.3g} }}"
    )


def _distinct_times(first: float, last: float, times: Sequence[float]) -> Array:
    """Return first, last and the times between them that are distinct after rounding."""
    least, distinct = 2.0 * 10.0**-TIME_DIGITS, [first]
    for t in sorted(times):
        if distinct[-1] + least < t < last - least:
            distinct.append(t)
    return np.array([*distinct, last])


def is_at_rest(motion: Trajectory, first: float, last: float) -> bool:
    """Whether all joints are at rest between two times."""
    times = np.linspace(first, last, 33)
    return bool(np.abs(motion(times) - motion(first)).max() < 1e-9)

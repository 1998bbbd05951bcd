"""Operations of a plan or program: seams and moves with the tolerances of a controller."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, PlanError
from selfmotion.certificate import Requirement, Separation, Tolerance, arm_limits, limits_of_joints
from selfmotion.model.motion import Trajectory
from selfmotion.model.path import REST_SPEED, FeedProfile, Path
from selfmotion.model.robot import Chain
from selfmotion.model.task import Task
from selfmotion.planning.result import Move, Parts, Plan
from selfmotion.shop.controllers.target_constraints import problem_of_targets
from selfmotion.work.job import Program

# Largest deviation of a free move [m, rad].
_MAX_MOVE_DEVIATION = Tolerance(5e-3, 5e-3)
# Share of the spare clearance that a deviation may use: distances are exact to 2 %.
_CLEARANCE_SHARE = 0.9
# Smallest lever of a pair of bodies, against division by zero [m].
_MIN_LEVER = 1e-9


class Operation(NamedTuple):
    """A seam or a move of a motion.

    Attributes
    ----------
    name : str
    motion : Trajectory
    events : tuple of (float, str)
        Times from the start of the operation [s], and names.
    chains : tuple of Chain
        The kinematic chains to the tools.
    is_move : bool
        Whether it is a free move.
    deviation_limit : Tolerance or None
        Largest safe deviation of a move; None for none.
    feeds : tuple of tuple of FeedProfile
        Feeds that the tools of a seam keep, for each chain.
    speed_limits : (n,) or None
        Limits of joint speeds [rad/s or m/s].
    is_valid : callable or None
        Whether another motion satisfies the constraints of the seam, accelerations excepted,
        within a tolerance.
    rotation_task : Task
        The task whose rows prescribe the tool's rotation, relaxed rows excepted.
    tool_rests : tuple of float
        Times at which the tool rests [s].
    """

    name: str
    motion: Trajectory
    events: tuple[tuple[float, str], ...]
    chains: tuple[Chain, ...]
    is_move: bool = False
    deviation_limit: Tolerance | None = None
    feeds: tuple[tuple[FeedProfile, ...], ...] = ()
    speed_limits: Array | None = None
    is_valid: Callable[[Trajectory, Tolerance], bool] | None = None
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
            return _parts_operations(plan)
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


def _parts_operations(parts: Parts) -> list[Operation]:
    operations = []
    for number, part in enumerate(parts.plans, 1):
        operations.append(_plan_operation(f"part {number}", part))
        # A move follows the last part only if the path is closed.
        if number <= len(parts.moves):
            operations.append(_move_operation(f"move {number}", parts.moves[number - 1]))
    return operations


def _plan_operation(name: str, plan: Plan) -> Operation:
    items, requirements = plan.problem.follows.items, plan.requirements

    def is_valid(motion: Trajectory, within: Tolerance) -> bool:
        return problem_of_targets(plan.problem).certify(motion, within).verified

    relaxed_rows = {row for item in plan.problem.relaxations for row in item.rows}
    return Operation(
        name,
        plan.trajectory,
        (),
        tuple(item.chain for item in items),
        feeds=tuple(tuple(feed for feed in item.path.feeds if feed.kept) for item in items),
        speed_limits=_speed_limits((*arm_limits(plan.robot, requirements), *requirements)),
        is_valid=is_valid,
        rotation_task=Task.POSITION if relaxed_rows & {"rx", "ry", "rz"} else plan.problem.task,
        tool_rests=_rest_times(plan.problem.path),
    )


def _rest_times(path: Path) -> tuple[float, ...]:
    """Return the inner marks at which a path is at rest [s]."""
    marks = path.marks[1:-1]
    at_rest = np.linalg.norm(path.samples(marks).twist, axis=1) < REST_SPEED if len(marks) else []
    return tuple(float(t) for t in marks[at_rest])


def _move_operation(name: str, move: Move) -> Operation:
    return Operation(
        name,
        move.motion,
        (),
        (move.robot.chain,),
        is_move=True,
        deviation_limit=safe_deviation(move),
        speed_limits=_speed_limits(move.requirements),
    )


def _speed_limits(requirements: Sequence[Requirement]) -> Array | None:
    """Return the limits of joint speed (n,) among requirements; None for none."""
    limits = [item.upper for item in limits_of_joints(requirements, 1)]
    return np.minimum.reduce(limits) if limits else None


def safe_deviation(move: Move) -> Tolerance | None:
    """Return the largest deviation of a move that keeps its clearances; None if none is spare.

    The distance of a pair of bodies changes by at most Σ_j l_j |Δq_j|, with l its levers. Joints
    may therefore deviate by the spare clearance divided by the largest Σ_j l_j.
    """
    joint = _MAX_MOVE_DEVIATION.rotation
    for item, finding in zip(move.requirements, move.findings, strict=True):
        if isinstance(item, Separation) and item.model.pairs:
            lever = float(item.model.pair_levers_up_to(_farthest(move)).sum(axis=1).max())
            spare = _CLEARANCE_SHARE * (finding.amount - item.distance)
            joint = min(joint, spare / max(lever, _MIN_LEVER))
    return Tolerance(_MAX_MOVE_DEVIATION.position, joint) if joint > 0.0 else None


def _farthest(move: Move) -> Array:
    """Return the largest |q| of each joint along a move, (n,)."""
    return np.asarray(np.abs(move.motion.q).max(axis=0))

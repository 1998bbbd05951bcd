"""What a motion is made of: seams, and moves through the air with room around them."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, PlanError
from selfmotion.certificate import JointLimits, Requirement, Separation, Tolerance, arm_limits
from selfmotion.constraints import Constraint, JointAccelerationLimits, JointJerkLimits
from selfmotion.job import Program
from selfmotion.motion import Trajectory
from selfmotion.path import STILL as _STILL, FeedKept, Path
from selfmotion.problem import Problem
from selfmotion.result import Move, Parts, Plan
from selfmotion.robot import Chain
from selfmotion.task import Task

# What a move through the air may be off at most, however much room there is [m, rad].
_ROOMY = Tolerance(5e-3, 5e-3)
# How much of the room that is left between bodies is used: distances are found to a fiftieth.
_SURE = 0.9


class Piece(NamedTuple):
    """A part of a motion with a name, events at times from its start, and the tools' chains.

    Of a move through the air also how far a controller may be off it, where there is room; of a
    seam the feeds that its tools keep, one list for each chain. `speeds` (n,) are what joints may
    have [rad/s or m/s]. `keeps` says whether another motion keeps all that a seam's has to but
    accelerations, within a tolerance; `turns` is the task by whose rows its tool turns as it has
    to, but for relaxed ones, and `tool_rests` when that rests on its way [s].
    """

    name: str
    motion: Trajectory
    events: tuple[tuple[float, str], ...]
    chains: tuple[Chain, ...]
    is_move: bool = False
    room: Tolerance | None = None
    feeds: tuple[tuple[FeedKept, ...], ...] = ()
    speeds: Array | None = None
    keeps: Callable[[Trajectory, Tolerance], bool] | None = None
    turns: Task = Task.POSE
    tool_rests: tuple[float, ...] = ()


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
            return [_of_move("move", plan)]
        case Parts():
            found = []
            for number, part in enumerate(plan.plans, 1):
                found.append(_of_plan(f"part {number}", part))
                found += [_of_move(f"move {number}", m) for m in plan.moves[number - 1 : number]]
            return found
    found = []
    for step in plan.steps:
        made = step.made
        piece = _of_plan(step.name, made) if isinstance(made, Plan) else _of_move(step.name, made)
        found.append(piece._replace(events=tuple((at, name) for name, at in step.happenings)))
    if not found:
        raise PlanError(f"{plan.robot.name}: {plan.verdict}")
    return found


def _of_plan(name: str, plan: Plan) -> Piece:
    items = plan.problem.follows.items
    chains = tuple(item.chain for item in items)
    feeds = tuple(tuple(feed for feed in item.path.feeds if feed.kept) for item in items)
    speeds = _speeds((*arm_limits(plan.robot, plan.requirements), *plan.requirements))

    def keeps(motion: Trajectory, within: Tolerance) -> bool:
        return by_targets(plan.problem).certify(motion, within).verified

    relaxed = {row for item in plan.problem.relaxations for row in item.rows}
    turns = Task.POSITION if relaxed & {"rx", "ry", "rz"} else plan.problem.task
    return Piece(
        name,
        plan.trajectory,
        (),
        chains,
        feeds=feeds,
        speeds=speeds,
        keeps=keeps,
        turns=turns,
        tool_rests=_rests_of(plan.problem.path),
    )


def _rests_of(path: Path) -> tuple[float, ...]:
    """Return at which of its marks a path is at rest, but for its ends [s]."""
    marks = path.marks[1:-1]
    still = np.linalg.norm(path.samples(marks).twist, axis=1) < _STILL if len(marks) else []
    return tuple(float(t) for t in marks[still])


def by_targets(problem: Problem) -> Problem:
    """Return what targets can keep of a problem."""
    return replace(problem, constraints=what_targets_keep(problem.constraints))


def what_targets_keep(constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
    """Return what targets can keep: how a controller accelerates between them is its own."""
    own = (JointAccelerationLimits, JointJerkLimits)
    return tuple(item for item in constraints if not isinstance(item, own))


def _of_move(name: str, move: Move) -> Piece:
    room = safe_deviation(move)
    return Piece(
        name,
        move.motion,
        (),
        (move.robot.chain,),
        is_move=True,
        room=room,
        speeds=_speeds(move.requirements),
    )


def _speeds(asked: Sequence[Requirement]) -> Array | None:
    """Return the limits of joint speed (n,) among requirements; None for none."""
    limits = [item.upper for item in asked if isinstance(item, JointLimits) and item.order == 1]
    return np.minimum.reduce(limits) if limits else None


def safe_deviation(move: Move) -> Tolerance | None:
    """Return how far a controller may be off a move so that it keeps apart; None for not at all.

    The distance of a pair of bodies changes by Σ_j l_j |Δq_j| at most, with l its levers: so joints
    may be off by the room that is left over what is asked, divided by the largest Σ_j l_j.
    """
    joint = _ROOMY.rotation
    for item, finding in zip(move.requirements, move.findings, strict=True):
        if isinstance(item, Separation) and item.model.pairs:
            lever = float(item.model.pair_levers_up_to(_farthest(move)).sum(axis=1).max())
            joint = min(joint, _SURE * (finding.amount - item.distance) / max(lever, 1e-9))
    return Tolerance(_ROOMY.position, joint) if joint > 0.0 else None


def _farthest(move: Move) -> Array:
    return np.asarray(np.abs(move.motion.q).max(axis=0))

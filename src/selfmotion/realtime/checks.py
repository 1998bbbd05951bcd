"""Checks of a replanner's arguments and measurements."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from selfmotion.basics import (
    Array,
    PathError,
    ProblemError,
    RobotError,
    as_numbers,
    as_several,
    plain_numbers,
    shown,
)
from selfmotion.model.follow import Follows, single_tip
from selfmotion.model.motion import NullMotion
from selfmotion.model.path import Path
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import Task
from selfmotion.problem.constraints import Constraint
from selfmotion.problem.costs import Cost
from selfmotion.realtime.chunks import Blended, Chunk
from selfmotion.realtime.reference import Approach, MovingPose


def check_kinds(robot: Any, null_motion: Any, approach: Any) -> None:
    """Check the types of arm, null motion and approach."""
    for name, given, kind, example in (
        ("robot", robot, RobotModel, "a RobotModel (load_robot)"),
        ("null_motion", null_motion, NullMotion | None, "a NullMotion or None"),
        ("approach", approach, Approach | None, "an Approach or None"),
    ):
        if not isinstance(given, kind):
            raise ProblemError(f"{name} is {shown(given)}, expected {example}")


def checked_terms(
    follows: Follows, costs: Any, constraints: Any
) -> tuple[Sequence[Cost], Sequence[Constraint]]:
    """Return costs and constraints as tuples, of kinds that fit the arm and a task it can follow.

    Raises
    ------
    ProblemError
        They do not.
    """
    robot, task = follows.robot, single_tip(follows).task
    if not robot.can_follow(task):
        able = [other.value for other in Task if robot.can_follow(other)]
        raise ProblemError(
            f"{robot.name}: cannot move the tool in every row of task '{task.value}'; "
            f"expected one of those that it can: {', '.join(able) or 'none'}"
        )
    wanted = as_several(costs, "costs", Cost)  # type: ignore[type-abstract]
    for cost in wanted:
        cost.check(follows)
    kept = as_several(constraints, "constraints", Constraint)
    return wanted, kept


def checked_state(values: Any, what: str, dof: int) -> Array:
    """Return the initial state (n,) of the command; RobotError if it is none."""
    return as_numbers(values, what, f"{dof} finite numbers, one for each joint", (dof,), RobotError)


def measured_state(values: Any, dof: int) -> Array:
    """Return a measured state (n,) as it is, or NaN where it is no numbers at all."""
    numbers = plain_numbers(values)
    return np.full(dof, np.nan) if numbers is None else numbers


def observed_target(
    path: object, target: Any, twist: Any, seen: float, reasons: list[str]
) -> MovingPose | None:
    """Return the motion of a target as it was seen; None where it is none, and add the reason.

    A camera without a detection, or with NaN, must not leave the arm without a command.

    Raises
    ------
    ProblemError
        There is a path, too, or no target.
    """
    if path is not None or target is None:
        named = "path and target" if path is not None else "twist and seen"
        raise ProblemError(
            f"{named}: a target moves by its twist from when it was seen, in place of a path; "
            f"give target= with them, and no path"
        )
    try:
        return MovingPose(target, np.zeros(6) if twist is None else twist, seen)
    except PathError as error:
        reasons.append(f"the target is of no use: {error}")
        return None


def known_chunk(
    path: object, target: object, times: Any, chunk: Any, t: float, reasons: list[str]
) -> Chunk | None:
    """Return a chunk of poses at times; None where it is of no use, and add the reason.

    A policy that fails must not leave the arm without a command.

    Raises
    ------
    ProblemError
        There is a path or a target, too, or one of chunk and times is missing.
    """
    if path is not None or target is not None:
        raise ProblemError(
            "chunk: there is a path or a target, too; expected one of the three at a step"
        )
    if chunk is None or times is None:
        missing = "chunk" if chunk is None else "times"
        raise ProblemError(
            f"{missing} is missing: a chunk is poses and their times: give chunk= and times="
        )
    try:
        found = Chunk.of(times, chunk)
    except PathError as error:
        reasons.append(f"the chunk is of no use: {error}")
        return None
    if found.until < t:
        reasons.append(f"the chunk is left out: it ended {t - found.until:.3g} s ago")
        return None
    return found


def age_of_target(path: Path | None, t: float) -> float:
    """Return the age of a target's observation [s]; 0 of a path, which is none."""
    if isinstance(path, Chunk | Blended):
        return 0.0
    while path is not None and not isinstance(path, MovingPose):
        # Of derived paths, the original.
        path = next((item for item in vars(path).values() if isinstance(item, Path)), None)
    return 0.0 if path is None else t - path.seen


def check_null_space(motion: NullMotion) -> NullMotion:
    """Return a null motion; ProblemError unless it is one in the null space."""
    if motion.space != "null":
        raise ProblemError(
            f"null motion: space is '{motion.space}', expected 'null': while the arm moves, "
            f"self-motions are in the null space"
        )
    return motion

"""Checks that an arm can move in all prescribed rows, and that some self-motion is left."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from selfmotion.basics import ProblemError, RedundancyError
from selfmotion.model.follow import Follows, row_names, with_tolerances
from selfmotion.model.robot import Chain, RobotModel
from selfmotion.model.task import Relaxation, Task
from selfmotion.problem.problem.least_tolerance import that_would_do

# Entries of Jacobians below this [m, rad] are zero.
_ZERO_ENTRY = 1e-6


def check_redundancy(follows: Follows, relaxations: Sequence[Relaxation], start: Any) -> None:
    """Refuse a task whose rows the arm cannot all move in, or that leaves no self-motion.

    Parameters
    ----------
    follows : Follows
        Arm, paths and tasks.
    relaxations : sequence of Relaxation
        Of the first path.
    start : (n,), str or None
        Where the search for a sufficient tolerance begins; an error recommends that tolerance.

    Raises
    ------
    ProblemError
        The arm cannot move the tool in all rows.
    RedundancyError
        There are as many rows as joints, and none is relaxed.
    """
    if len(follows.items) > 1:
        _check_rows_of_several(follows, relaxations)
        _check_self_motion_of_several(follows, relaxations)
        return
    _check_rows(follows, relaxations, start)
    _check_self_motion(follows, relaxations)


def _check_rows(follows: Follows, relaxations: Sequence[Relaxation], start: Any) -> None:
    """Raise ProblemError where the arm cannot move in all rows of its one task."""
    robot, task = follows.robot, follows.items[0].task
    if robot.can_follow(task) or _can_follow_relaxed(follows, relaxations):
        return
    rows = f"{task.dimension} rows ({', '.join(task.row_names)})"
    if relaxations:
        raise ProblemError(
            f"{robot.name}: task '{task.value}' prescribes {rows}, and the arm cannot move "
            f"'{robot.tool}' freely in all of them with its {robot.dof} joints and what is relaxed "
            f"({', '.join(row for item in relaxations for row in item.rows)}); relax other "
            f"rows as well"
        )
    tasks = _redundant_tasks(robot)
    remedy = (
        f"choose another task ({', '.join(tasks)})"
        if tasks
        else "no other task is left: choose a tool that more joints move"
    )
    raise ProblemError(
        f"{robot.name}: task '{task.value}' prescribes {rows}, but the arm cannot move "
        f"'{robot.tool}' freely in all of them; {remedy}, or relax rows that it cannot move "
        f"(relaxations=){that_would_do(follows, start)}"
    )


def _check_self_motion(follows: Follows, relaxations: Sequence[Relaxation]) -> None:
    """Raise RedundancyError where one task has as many rows as the arm has joints."""
    if follows.redundancy > 0 or relaxations:
        return
    robot, task = follows.robot, follows.items[0].task
    tasks = _redundant_tasks(robot)
    remedy = f"choose a task with fewer rows ({', '.join(tasks)}), " if tasks else ""
    raise RedundancyError(
        f"{robot.name}: {robot.dof} joints and task '{task.value}' with "
        f"{task.dimension} rows leave no self-motion; {remedy}relax some (relaxations=), "
        f"or take an arm with more joints",
        dof=robot.dof,
        rows=task.dimension,
    )


def _check_rows_of_several(follows: Follows, relaxations: Sequence[Relaxation]) -> None:
    """Raise ProblemError where the arm cannot move several frames in all rows of their tasks."""
    robot = follows.robot
    for item in follows.items:
        if item.task is Task.PLANAR_POSE and not _moves_in_plane(robot, item.chain):
            raise ProblemError(
                f"{robot.name}: task 'planar_pose' is for frames that move in the x-y plane only, "
                f"which '{item.chain.tip_name}' does not; choose another one (Follow(task=))"
            )
    rank = robot.dof - follows.redundancy
    if rank < follows.dimension and not _can_follow_relaxed(follows, relaxations):
        raise ProblemError(
            f"{robot.name}: {_frame_names(follows)} have {follows.dimension} rows prescribed "
            f"({', '.join(row_names(follows))}), but {robot.dof} joints cannot move them freely "
            f"in all of these; prescribe fewer (Follow(task=))"
        )


def _check_self_motion_of_several(follows: Follows, relaxations: Sequence[Relaxation]) -> None:
    """Raise RedundancyError where several tasks have as many rows as the arm has joints."""
    if follows.redundancy > 0 or relaxations:
        return
    robot, rows = follows.robot, follows.dimension
    raise RedundancyError(
        f"{robot.name}: {robot.dof} joints and {rows} rows of {_frame_names(follows)} leave no "
        f"self-motion; prescribe fewer (Follow(task=)), relax some of the first (relaxations=), "
        f"or take arms with more joints",
        dof=robot.dof,
        rows=rows,
    )


def _can_follow_relaxed(follows: Follows, relaxations: Sequence[Relaxation]) -> bool:
    """Return whether the arm with tolerances as joints can move in all rows."""
    if not relaxations:
        return False
    item = follows.items[0]
    if item.task is Task.PLANAR_POSE and not _moves_in_plane(follows.robot, item.chain):
        return False
    relaxed = with_tolerances(follows, relaxations)
    return relaxed.dof - relaxed.redundancy >= relaxed.dimension


def _moves_in_plane(robot: RobotModel, chain: Chain) -> bool:
    """Return whether a chain's tip moves in the x-y plane of its base: else ωz is no angle."""
    jacobians, _, _ = chain.along(robot.generic_configurations())
    return bool(np.abs(jacobians[:, 2:5]).max() <= _ZERO_ENTRY)


def _redundant_tasks(robot: RobotModel) -> list[str]:
    """Return the names of tasks that the arm can follow and that leave self-motion."""
    return [task.value for task in Task if task.dimension < robot.dof and robot.can_follow(task)]


def _frame_names(follows: Follows) -> str:
    """Return the names of the frames that follow paths, as one phrase."""
    return " and ".join(f"'{item.chain.tip_name}'" for item in follows.items)

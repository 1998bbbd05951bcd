"""A quick 'no': poses that no configuration was found for, before anything is planned."""

import numpy as np

from selfmotion.basics import InverseKinematicsError, NoSequenceError, SelfmotionError
from selfmotion.planning.search import Search
from selfmotion.problem import Problem
from selfmotion.search import Obstruction, obstruction


def looked_at(problem: Problem, search: Search) -> Obstruction | None:
    """Return a pose that the arm cannot be at; None where it can be at all that were looked at.

    Or where it goes on all the same: damped motions leave their path, and what only keeps the arm
    apart from itself was not asked for.

    Raises
    ------
    InverseKinematicsError
        It is the first pose, which is out of reach.
    NoSequenceError
        Bodies that were asked to be kept apart are met there.
    """
    if problem.damping is not None:
        return None
    blocked = obstruction(problem, np.random.default_rng(search.rng))
    if blocked is None:
        return None
    if blocked.is_met and problem.own_collision is not None:
        return blocked
    if blocked.is_met or blocked.time == 0.0:
        raise no_way(problem, blocked)
    return blocked


def no_way(problem: Problem, blocked: Obstruction) -> SelfmotionError:
    """Return the error that says what is in the way, and what would help."""
    robot, pose = problem.robot, problem.path.pose(blocked.time)
    task = problem.asked.task.value
    if not blocked.is_met and blocked.time == 0.0:
        position, rotation = blocked.misses
        return InverseKinematicsError(
            f"{robot.name}: no configuration within the limits puts '{robot.tool}' at "
            f"{np.round(pose.translation, 4).tolist()} m for task '{task}', where "
            f"the path begins: {blocked.reason}; move the pose into the workspace{blocked.help}",
            position_miss=position,
            rotation_miss=rotation,
        )
    return NoSequenceError(
        f"{robot.name}: no motion along the path passes t = {blocked.time:.6g} s: "
        f"{blocked.reason}{blocked.help}",
        time=blocked.time,
        reason=blocked.reason,
    )

"""Whether an arm can follow a task, and what self-motion that leaves."""

from selfmotion.basics import ProblemError, RedundancyError
from selfmotion.follow import Follows
from selfmotion.robot import RobotModel
from selfmotion.task import Task


def check_redundancy(follows: Follows, is_relaxed: bool) -> None:
    """Refuse a task that the arm cannot follow, or that leaves no self-motion and no row relaxed.

    Raises
    ------
    ProblemError
        The arm cannot move the tool in all rows.
    RedundancyError
        There are as many rows as joints.
    """
    robot, task = follows.robot, follows.task
    if not robot.can_follow(task):
        others = _redundant_tasks(robot)
        choice = (
            f"choose another task ({', '.join(others)})"
            if others
            else "no other task is left: choose a tool that more joints move"
        )
        raise ProblemError(
            f"{robot.name}: task '{task.value}' prescribes {task.dimension} rows "
            f"({', '.join(task.row_names)}), but the arm cannot move '{robot.tool}' freely in "
            f"all of them; {choice}"
        )
    if follows.redundancy == 0 and not is_relaxed:
        others = _redundant_tasks(robot)
        choice = f"choose a task with fewer rows ({', '.join(others)}), " if others else ""
        raise RedundancyError(
            f"{robot.name}: {robot.dof} joints and task '{task.value}' with "
            f"{task.dimension} rows leave no self-motion; {choice}relax some (relaxations=), "
            f"or take an arm with more joints",
            dof=robot.dof,
            rows=task.dimension,
        )


def _redundant_tasks(robot: RobotModel) -> list[str]:
    """Return the tasks that the arm can follow and that leave self-motion."""
    return [x.value for x in Task if x.dimension < robot.dof and robot.can_follow(x)]

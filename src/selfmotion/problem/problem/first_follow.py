"""The first of several paths that an arm follows, and the arm with its tool."""

from collections.abc import Sequence
from dataclasses import replace

from selfmotion.basics import ProblemError
from selfmotion.model.follow import Follow
from selfmotion.model.path import Path
from selfmotion.model.robot import RobotModel


def first_follow(follows: Sequence[Follow], robot: RobotModel) -> tuple[Follow, RobotModel]:
    """Return the first of several frames that follow paths, and the arm with it as its tool.

    Raises
    ------
    ProblemError
        There is none, it is at a pose, or the arm has no chain to it.
    """
    if not follows:
        raise ProblemError("path is an empty list, expected a Path, or what follows one")
    first = follows[0]
    if not isinstance(first.path, Path):
        raise ProblemError(
            "the first Follow is at a pose, which does not tell how long the motion lasts; "
            "begin with one that has a path, or take Dwell(pose, seconds)"
        )
    if isinstance(robot, RobotModel) and (first.tool or first.reference):
        tool = first.tool or robot.tool
        tools = (tool, *(name for name in robot.tools if name != tool))
        usual = robot.reference if tool == robot.tool else None
        reference = usual if first.reference is None else first.reference
        robot = replace(robot, tools=tools, reference=reference)
        # Raises where the arm has no such chain.
        robot.chain_to(tool, reference)
    return first, robot

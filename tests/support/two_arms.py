"""Two arms on one body, and two Pandas side by side."""

from functools import cache

import numpy as np

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.follow import BoundTaskFrame, Follows

LEFT, RIGHT = "left_gripper", "right_gripper"


@cache
def baxter_with_both_arms(reference: str | None = None) -> sm.RobotModel:
    """Return Baxter with both hands as tools: 14 joints."""
    tools = LEFT if reference else (LEFT, RIGHT)
    return sm.load_robot("baxter", tool=tools, reference=reference)


def both_arms(left: str, right: str) -> tuple[Follows, Array]:
    """Return that one hand follows a path in the world, the other one relative to it."""
    robot = baxter_with_both_arms()
    start = robot.dexterous_configuration("position")
    items = []
    for tool, reference, task in ((LEFT, None, left), (RIGHT, LEFT, right)):
        chain = robot.chain_to(tool, reference)
        items.append(
            BoundTaskFrame(chain, sm.paths.Dwell(chain.place(start), 1.0), sm.Task.of(task))
        )
    return Follows(robot, tuple(items)), np.array(start)

"""What an arm follows, where no path matters."""

from collections.abc import Sequence

import selfmotion as sm
from selfmotion.model.follow import Follows
from selfmotion.planning.formulation import Formulation


def standing(robot: sm.RobotModel, task: sm.Task | str) -> Follows:
    """Return that the tool stays where it is at a dexterous configuration."""
    place = sm.paths.Dwell(robot.pose(robot.dexterous_configuration()), 1.0)
    return Follows.of(robot, place, task)


def charging(robot: sm.RobotModel, task: sm.Task, costs: Sequence[sm.costs.Cost]) -> Formulation:
    """Return that an arm stands still at a price."""
    pose = robot.pose(robot.dexterous_configuration(task))
    path = sm.paths.Dwell(pose, 1.0)
    return Formulation.of(sm.Problem(robot, path, task, costs=costs, clearance=None))

"""What an arm follows, where no path matters."""

import selfmotion as sm
from selfmotion.model.follow import Follows


def standing(robot: sm.RobotModel, task: sm.Task | str) -> Follows:
    """Return that the tool stays where it is at a dexterous configuration."""
    place = sm.paths.Dwell(robot.pose(robot.dexterous_configuration()), 1.0)
    return Follows.of(robot, place, task)

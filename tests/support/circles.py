"""Problems of a Panda that starts at home and draws a circle, and where their plans pass."""

import numpy as np

import selfmotion as sm
from selfmotion.basics import Array
from support.arms import PANDA_HOME


def small_circle(robot: sm.RobotModel, **options) -> sm.Problem:
    """Return a circle of 0.1 m in the tool's own plane, in 3 s."""
    path = sm.paths.Circle.around(robot.pose(PANDA_HOME), 0.1, 3.0)
    return sm.Problem(robot, path, start=PANDA_HOME, **options)


def upright_circle(robot: sm.RobotModel, **options) -> sm.Problem:
    """Return a circle of 0.15 m about the base's x axis, in 4 s."""
    path = sm.paths.Circle.around(robot.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    return sm.Problem(robot, path, start=PANDA_HOME, **options)


def coordinate_along(plan: sm.Plan, coordinate: sm.robot.Coordinate) -> Array:
    """Return a coordinate at 4001 times of a plan."""
    t = np.linspace(0.0, plan.path.duration, 4001)
    return coordinate(plan.robot, plan.trajectory(t))[0]

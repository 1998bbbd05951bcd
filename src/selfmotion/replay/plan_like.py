"""What the replay reads of a plan."""

from typing import Any, Protocol

from selfmotion.robot import RobotModel
from selfmotion.task import Task
from selfmotion.trajectory import Trajectory


class Plan(Protocol):
    """A finished plan: motion, path, report and certificate."""

    robot: RobotModel
    path: Any
    task: Task
    trajectory: Trajectory
    initial_trajectory: Trajectory | None
    report: Any
    certificate: Any

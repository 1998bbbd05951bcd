"""How freely the joints of an arm move its tool in the rows of a task."""

from typing import TYPE_CHECKING

import numpy as np

from selfmotion.basics import Array
from selfmotion.task import Task

if TYPE_CHECKING:
    from selfmotion.robot.model import RobotModel

# Singular values, and rates of rows, below this [m, rad] are zero.
_ZERO = 1e-6
# Samples among which the most dexterous one is.
_SAMPLES = 1000


def redundancy(robot: "RobotModel", task: Task) -> int:
    """Return n - rank J of a task at generic configurations."""
    jacobians = [robot.task_jacobian(q, task) for q in robot.generic_configurations()]
    return robot.dof - int(max(np.linalg.matrix_rank(jacobians, tol=_ZERO)))


def can_follow(robot: "RobotModel", task: Task) -> bool:
    """Return whether the tool can be moved in all rows of a task; see `RobotModel.can_follow`."""
    if task is Task.PLANAR_POSE:
        jacobians = np.array([robot.jacobian(q) for q in robot.generic_configurations()])
        if np.abs(jacobians[:, 2:5]).max() > _ZERO:
            return False
    return robot.dof - redundancy(robot, task) == task.dimension


def most_dexterous(robot: "RobotModel", task: Task) -> Array:
    """Return the sample (n,) in the middle half of the limits with the largest √det(JJᵀ)."""
    lower, upper = robot.finite_limits()
    share = np.random.default_rng(0).uniform(0.25, 0.75, (_SAMPLES, robot.dof))
    samples = lower + (upper - lower) * share
    jacobians = np.array([robot.task_jacobian(q, task) for q in samples])
    determinants = np.linalg.det(jacobians @ jacobians.transpose(0, 2, 1))
    return np.array(samples[np.argmax(determinants)])

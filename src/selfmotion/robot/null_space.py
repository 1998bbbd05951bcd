"""Bases of the self-motion directions: the null space of the task Jacobian."""

import numpy as np

from selfmotion.basics import Array
from selfmotion.robot.model import RobotModel
from selfmotion.task import Task


def null_basis(robot: RobotModel, task: Task, q: Array) -> Array:
    """Return an orthonormal basis of the null space of the task Jacobian at q, (n, r)."""
    _, _, right = np.linalg.svd(robot.task_jacobian(q, task))
    return np.asarray(right[task.dimension :].T)

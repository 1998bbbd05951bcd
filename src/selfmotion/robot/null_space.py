"""Bases of the self-motion directions: the null space of the task Jacobian."""

import numpy as np

from selfmotion.basics import Array
from selfmotion.robot.model import RobotModel
from selfmotion.task import Task


def null_space(jacobians: Array) -> Array:
    """Return orthonormal null-space bases of matrices (…, m, n) of rank m ≤ n, (…, n, n - m).

    The last right singular vectors; their signs and order are arbitrary.
    """
    rows = jacobians.shape[-2]
    _, _, right = np.linalg.svd(jacobians)
    return np.asarray(np.swapaxes(right[..., rows:, :], -1, -2))


def null_basis(robot: RobotModel, task: Task, q: Array) -> Array:
    """Return an orthonormal basis of the null space of the task Jacobian at q, (n, r)."""
    return null_space(robot.task_jacobian(q, task))

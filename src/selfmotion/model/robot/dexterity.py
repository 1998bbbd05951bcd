"""Redundancy, null space and dexterity of configurations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from selfmotion.basics import (
    Array,
    RobotError,
)
from selfmotion.model.task import Task

if TYPE_CHECKING:
    from selfmotion.model.robot.model import RobotModel

# Singular values, and rates of rows, below this [m, rad] are zero.
_ZERO = 1e-6
# Relative singular values below this are rounding.
_ROUNDING = 1e-12
# Samples of which the most dexterous one is chosen.
_SAMPLES = 1000


def redundancy(robot: RobotModel, task: Task) -> int:
    """Return n - rank J of a task at generic configurations."""
    jacobians = robot.task_jacobian(robot.generic_configurations(), task)
    return robot.dof - int(max(np.linalg.matrix_rank(jacobians, tol=_ZERO)))


def can_follow(robot: RobotModel, task: Task) -> bool:
    """Return whether the tool can move in all rows of a task; see `RobotModel.can_follow`."""
    if task is Task.PLANAR_POSE:
        jacobians = robot.jacobian(robot.generic_configurations())
        if np.abs(jacobians[:, 2:5]).max() > _ZERO:
            return False
    return robot.dof - redundancy(robot, task) == task.dimension


def most_dexterous(robot: RobotModel, task: Task) -> Array:
    """Return the sample (n,) in the middle half of the limits with the largest √det(JJᵀ)."""
    lower, upper = robot.finite_limits()
    share = np.random.default_rng(0).uniform(0.25, 0.75, (_SAMPLES, robot.dof))
    samples = lower + (upper - lower) * share
    jacobians = robot.task_jacobian(samples, task)
    determinants = np.linalg.det(jacobians @ jacobians.transpose(0, 2, 1))
    return np.array(samples[np.argmax(determinants)])


def null_space_at(robot: RobotModel, q: Array, task: Task) -> Array:
    """Return orthonormal null-space bases at checked `q`; see `RobotModel.null_space`."""
    jacobians = robot.task_jacobian(q, task)
    _, values, right = np.linalg.svd(jacobians)
    large = values > _ROUNDING * values.max(axis=-1, keepdims=True)
    ranks = np.atleast_1d(np.sum(large, axis=-1))
    # Without configurations, the generic rank.
    rank = int(ranks[0]) if len(ranks) else robot.dof - redundancy(robot, task)
    other = np.flatnonzero(ranks != rank)
    if len(other):
        raise RobotError(
            f"{robot.name}: the Jacobian of task '{task.value}' has rank {rank} at configuration 0 "
            f"and {ranks[other[0]]} at configuration {other[0]}, expected one rank; ask for "
            f"the null space of these one at a time"
        )
    return np.asarray(np.swapaxes(right[..., rank:, :], -1, -2))

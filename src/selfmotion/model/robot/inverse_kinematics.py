"""Inverse kinematics: Levenberg-Marquardt on the rows of a task, within joint limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.basics import (
    Array,
    InverseKinematicsError,
    RobotError,
    as_whole,
)
from selfmotion.model.task import Task, as_pose

if TYPE_CHECKING:
    from selfmotion.model.robot.model import RobotModel

# Error of a solution, far below a certificate's tolerance.
_IK_TOLERANCE = 1e-10
# Largest number of steps from one start.
_IK_STEPS = 100


def inverse_kinematics(
    robot: RobotModel,
    pose: pin.SE3 | npt.ArrayLike,
    task: Task,
    seed: npt.ArrayLike | None,
    rng: np.random.Generator,
    attempts: int,
) -> Array:
    """Return a configuration that puts the tool at a pose; see `RobotModel.inverse_kinematics`."""
    pose = as_pose(pose, f"{robot.name}: the pose", RobotError)
    attempts = as_whole(attempts, "attempts", 1, 10**6, RobotError)
    lower, upper = robot.finite_limits()
    start = 0.5 * (lower + upper) if seed is None else robot.configuration(seed)
    best = (np.inf, np.inf)
    for _ in range(attempts):
        q, residual = _levenberg_marquardt(robot, pose, task, start)
        if max(residual) < _IK_TOLERANCE:
            return q
        best = min(best, residual, key=sum)
        start = rng.uniform(lower, upper)
    raise InverseKinematicsError(
        f"{robot.name}: no configuration within the limits puts '{robot.tool}' at "
        f"{np.round(pose.translation, 4).tolist()} m for task '{task.value}': the best of "
        f"{attempts} attempts misses by {best[0]:.3g} m and {best[1]:.3g} rad; "
        f"move the pose into the workspace",
        position_miss=best[0],
        rotation_miss=best[1],
    )


def _levenberg_marquardt(
    robot: RobotModel, pose: pin.SE3, task: Task, start: Array
) -> tuple[Array, tuple[float, float]]:
    q, damping = np.clip(start, robot.lower, robot.upper), 1e-3
    actual = robot.pose(q)
    error = task.select(task.twist_error(pose, actual)[:, None], actual.rotation)[:, 0]
    for _ in range(_IK_STEPS):
        if np.linalg.norm(error) < 0.01 * _IK_TOLERANCE:
            break
        jacobian = robot.task_jacobian(q, task)
        gradient = jacobian.T @ error
        # Joints held at a limit that the step would leave take no part in it.
        free = ~((q <= robot.lower) & (gradient < 0) | (q >= robot.upper) & (gradient > 0))
        jacobian = jacobian * free
        normal = jacobian @ jacobian.T + damping * np.eye(task.dimension)
        trial = np.clip(q + jacobian.T @ np.linalg.solve(normal, error), robot.lower, robot.upper)
        actual = robot.pose(trial)
        new = task.select(task.twist_error(pose, actual)[:, None], actual.rotation)[:, 0]
        if np.linalg.norm(new) < np.linalg.norm(error):
            q, error, damping = trial, new, max(0.1 * damping, 1e-14)
        else:
            damping *= 10.0
            if damping > 1e6:
                break
    return q, task.miss(pose, robot.pose(q))

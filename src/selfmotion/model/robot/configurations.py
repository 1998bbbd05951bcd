"""Configurations of an arm: as they are given, weighed, found for a pose, and free to move."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.basics import (
    Array,
    InverseKinematicsError,
    RobotError,
    as_number,
    as_whole,
    nearest,
    plain_numbers,
    shown,
)
from selfmotion.model.task import Task, as_pose

if TYPE_CHECKING:
    from selfmotion.model.robot.model import RobotModel


def as_configuration(robot: RobotModel, q: npt.ArrayLike) -> Array:
    """Return `q` as finite numbers (n,); see `RobotModel.configuration`."""
    return _checked(robot, q, several=False)


def as_configurations(robot: RobotModel, q: npt.ArrayLike) -> Array:
    """Return `q` as finite numbers, (n,) or (K, n).

    Raises
    ------
    RobotError
        It has another shape, or a number is not finite; row and joint are named.
    """
    return _checked(robot, q, several=True)


def _checked(robot: RobotModel, q: npt.ArrayLike, several: bool) -> Array:
    array, names = plain_numbers(q), ", ".join(robot.joint_names)
    if array is None:
        raise RobotError(
            f"configuration is {shown(q)}, expected {robot.dof} numbers, one for each of {names}"
        )
    if array.shape[-1:] != (robot.dof,) or array.ndim > 1 + several:
        rows = f" or (K, {robot.dof})" if several else ""
        raise RobotError(
            f"configuration has shape {array.shape}, expected ({robot.dof},){rows} for joints "
            f"{names}"
        )
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        where = f"configuration {bad[0][0]}: " if array.ndim == 2 else ""
        joint = robot.joint_names[bad[0][-1]]
        raise RobotError(f"{where}joint '{joint}' is {array[tuple(bad[0])]}, not finite")
    return np.array(array)


# Largest weight of a metre [rad/m]: a slower prismatic joint hardly moves already, and weights of
# hundreds make optima badly conditioned.
_MOST = 10.0


def joint_weights(robot: RobotModel) -> Array:
    """Return the weight of each joint's unit, (n,); see `RobotModel.joint_weights`."""
    return np.where(robot.is_revolute, 1.0, 1.0 / mean_lever(robot))


def speed_weights(robot: RobotModel) -> Array:
    """Return the weight of each joint's unit, (n,); see `RobotModel.speed_weights`."""
    turns, limits = robot.is_revolute, robot.velocity_limit
    known = np.isfinite(limits) & (limits > 0.0)
    if not (turns & known).any():
        return joint_weights(robot)
    fastest = float(limits[turns & known].mean())
    by_speed = np.minimum(fastest / np.where(known, limits, 1.0), _MOST)
    return np.where(turns, 1.0, np.where(known, by_speed, joint_weights(robot)))


def mean_lever(robot: RobotModel) -> float:
    """Return the mean motion of the tool [m] per radian of a revolute joint."""
    arrays = robot.chain.arrays
    beyond = np.cumsum(arrays.link_lengths[:0:-1])[::-1]
    lever_arms = beyond[arrays.tree.is_revolute]
    return float(lever_arms.mean()) if lever_arms.size and lever_arms.max() > 0.0 else 1.0


def part_weights(robot: RobotModel, weights: Mapping[str, float]) -> Array:
    """Return these with some parts' times a number, (n,); see `RobotModel.part_weights`."""
    if not isinstance(weights, Mapping):
        raise RobotError(f"weights are {shown(weights)}, expected a dict of parts or joints")
    found = robot.joint_weights.copy()
    for name, weight in weights.items():
        mine = np.array([j == name or j.startswith(f"{name}/") for j in robot.joint_names])
        if not mine.any():
            raise RobotError(
                f"{robot.name}: no part or joint '{name}' to weigh"
                f"{nearest(name, robot.joint_names)}; joints: {', '.join(robot.joint_names)}"
            )
        found[mine] *= as_number(weight, f"weight of '{name}'", least=0.0, error=RobotError)
    return found


# How freely the joints of an arm move its tool in the rows of a task.

# Singular values, and rates of rows, below this [m, rad] are zero.
_ZERO = 1e-6
# Relative singular values below this are rounding.
_ROUNDING = 1e-12
# Samples of which the most dexterous one is chosen.
_SAMPLES = 1000


def redundancy(robot: RobotModel, task: Task) -> int:
    """Return n - rank J of a task at generic configurations."""
    jacobians = [robot.task_jacobian(q, task) for q in robot.generic_configurations()]
    return robot.dof - int(max(np.linalg.matrix_rank(jacobians, tol=_ZERO)))


def can_follow(robot: RobotModel, task: Task) -> bool:
    """Return whether the tool can move in all rows of a task; see `RobotModel.can_follow`."""
    if task is Task.PLANAR_POSE:
        jacobians = np.array([robot.jacobian(q) for q in robot.generic_configurations()])
        if np.abs(jacobians[:, 2:5]).max() > _ZERO:
            return False
    return robot.dof - redundancy(robot, task) == task.dimension


def most_dexterous(robot: RobotModel, task: Task) -> Array:
    """Return the sample (n,) in the middle half of the limits with the largest √det(JJᵀ)."""
    lower, upper = robot.finite_limits()
    share = np.random.default_rng(0).uniform(0.25, 0.75, (_SAMPLES, robot.dof))
    samples = lower + (upper - lower) * share
    jacobians = np.array([robot.task_jacobian(q, task) for q in samples])
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


# Inverse kinematics: Levenberg-Marquardt on the rows of a task, within joint limits.

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

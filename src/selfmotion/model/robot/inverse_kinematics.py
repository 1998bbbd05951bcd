"""Inverse kinematics: Levenberg-Marquardt on the rows of a task, within joint limits."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.basics import (
    Array,
    InverseKinematicsError,
    RobotError,
    as_whole,
    inlined,
    kernel,
)
from selfmotion.basics.layout import Layout, layout_of
from selfmotion.model.kernels import cholesky, errors_and_rows, gram, rows_of, solve_cholesky
from selfmotion.model.robot.placements import place_tips
from selfmotion.model.task import Task, as_pose

if TYPE_CHECKING:
    from selfmotion.model.robot.model import RobotModel

# Error of a solution, far below a certificate's tolerance.
_IK_TOLERANCE = 1e-10
# Largest number of steps from one start.
_IK_STEPS = 100
# Smallest damping: steps are as good as Newton's.
_MIN_DAMPING = 1e-14
# Damping beyond which steps gain nothing.
_MAX_DAMPING = 1e6
# A tool that points the other way round misses by more than this [rad] …
_HALF_TURN = 3.141
# … and is turned out of it by moving all joints by this [rad or m].
_BESIDE = 1e-3


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
    search = _Search(robot, pose, task)
    best = (np.inf, np.inf)
    for _ in range(attempts):
        q, residual = search.run(start)
        if residual[1] > _HALF_TURN:
            # It says in no direction where to turn; a little beside it does.
            q, residual = search.run(start + _BESIDE)
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


class _Search:
    """Levenberg-Marquardt's method towards one pose, from several starts."""

    def __init__(self, robot: RobotModel, pose: pin.SE3, task: Task) -> None:
        self._robot, self._pose, self._task = robot, pose, task
        self._limits = np.array(robot.lower), np.array(robot.upper)
        self._chains = np.array(robot.chain.table)[None]
        self._target = np.concatenate([pose.translation, pose.rotation.ravel()])
        self._layout = layout_of([(task.rows, task.tool_axes, robot.chain.joints)], robot.dof)

    def run(self, start: Array) -> tuple[Array, tuple[float, float]]:
        """Return where it ends from a start (n,), and by how much the tool misses there."""
        q = np.clip(start, *self._limits)
        _levenberg_marquardt(q, self._chains, self._target, self._layout, *self._limits)
        return q, self._task.miss(self._pose, self._robot.pose(q))


@kernel
def _levenberg_marquardt(
    q: Array, chains: Array, target: Array, layout: Layout, lower: Array, upper: Array
) -> None:
    """Move q (n,) within limits towards a tip's pose, as `Follows.targets` has it, (12,)."""
    n, m = len(q), rows_of(layout)
    turns, places = np.empty((chains.shape[1], 3, 3)), np.empty((chains.shape[1], 3))
    rotations, positions = np.empty((1, 3, 3)), np.empty((1, 3))
    jacobians, rows, error = np.zeros((1, 6, n)), np.empty((m, n)), np.empty(m)
    trial, new_rows, new = np.empty(n), np.empty((m, n)), np.empty(m)
    normal, step = np.empty((m, m)), np.empty(m)
    place_tips(q, chains, turns, places, rotations, positions, jacobians)
    errors_and_rows(layout, target, jacobians, rotations, positions, error, rows)
    size, damping = _length(error), 1e-3
    for _ in range(_IK_STEPS):
        if size < 0.01 * _IK_TOLERANCE or damping > _MAX_DAMPING:
            break
        for k in range(n):
            gradient = 0.0
            for i in range(m):
                gradient += rows[i, k] * error[i]
            # Joints held at a limit that the step would leave take no part in it.
            if (q[k] <= lower[k] and gradient < 0.0) or (q[k] >= upper[k] and gradient > 0.0):
                rows[:, k] = 0.0
        gram(rows, normal)
        for i in range(m):
            normal[i, i] += damping
            step[i] = error[i]
        if not cholesky(normal):
            damping *= 10.0
            continue
        solve_cholesky(normal, step)
        for k in range(n):
            total = q[k]
            for i in range(m):
                total += rows[i, k] * step[i]
            trial[k] = min(max(total, lower[k]), upper[k])
        place_tips(trial, chains, turns, places, rotations, positions, jacobians)
        errors_and_rows(layout, target, jacobians, rotations, positions, new, new_rows)
        if _length(new) < size:
            q[:], rows[:], error[:], size = trial, new_rows, new, _length(new)
            damping = max(0.1 * damping, _MIN_DAMPING)
        else:
            damping *= 10.0


@inlined
def _length(vector: Array) -> float:
    total = 0.0
    for value in vector:
        total += value * value
    return sqrt(total)

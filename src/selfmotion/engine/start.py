"""The start configuration: given, or free to move along its self-motion."""

from typing import Protocol

import numpy as np
import pinocchio as pin

from selfmotion.basics import Array
from selfmotion.robot import RobotModel, null_basis
from selfmotion.task import Task

# Newton's method onto the start of the path is quadratic: few steps, and the one after an error of
# this is exact. Far moves fail and say so.
_STEPS, _ARRIVED = 20, 1e-9


class Start(Protocol):
    """q(0) as a function of `size` decision variables z and of the tool's first pose."""

    @property
    def size(self) -> int:
        """Number of decision variables."""

    def configuration(self, z: Array, pose: pin.SE3) -> Array | None:
        """Return q(0) (n,), or None where no configuration belongs to z and the pose."""

    def tangent(self) -> tuple[Array, Array]:
        """Return ∂q(0)/∂z (n, size) and that with respect to the pose (n, 6), at the last q(0).

        The pose's change is [m, world rotation vector].
        """


class FixedStart:
    """A given start configuration."""

    size = 0

    def __init__(self, q: Array) -> None:
        self._q = q

    def configuration(self, z: Array, pose: pin.SE3) -> Array:
        """See `Start.configuration`."""
        return self._q

    def tangent(self) -> tuple[Array, Array]:
        """See `Start.tangent`."""
        return np.zeros((len(self._q), 0)), np.zeros((len(self._q), 6))


class FreeStart:
    """The start moves along the self-motion manifold of the tool's first pose.

    q(0) solves F(q) = x(0) and N0ᵀ(q - q_ref) = z, with N0 an orthonormal null-space basis at the
    reference: coordinates of the manifold, exact and smooth near it.

    Parameters
    ----------
    robot, task
    reference : (n,)
        q_ref, on the path's first pose; z = 0.
    """

    def __init__(self, robot: RobotModel, task: Task, reference: Array) -> None:
        self._robot, self._task, self._reference = robot, task, reference
        self._null = null_basis(robot, task, reference)
        self._at = reference

    @property
    def size(self) -> int:
        """See `Start.size`: the redundancy r."""
        return int(self._null.shape[1])

    def configuration(self, z: Array, pose: pin.SE3) -> Array | None:
        """See `Start.configuration`."""
        q = self._reference + self._null @ z
        for _ in range(_STEPS):
            if not np.all(np.isfinite(q)):
                return None
            actual = self._robot.pose(q)
            twist = self._task.twist_error(pose, actual)
            error = self._task.select(twist[:, None], actual.rotation)[:, 0]
            rest = z - self._null.T @ (q - self._reference)
            arrived = max(np.abs(error).max(), np.abs(rest).max(initial=0.0)) < _ARRIVED
            try:
                q = q + np.linalg.solve(self._system(q), np.concatenate([error, rest]))
            except np.linalg.LinAlgError:
                return None
            if arrived:
                self._at = q
                return q
        return None

    def tangent(self) -> tuple[Array, Array]:
        """See `Start.tangent`: [J; N0ᵀ]⁻¹ [0; I] and [J; N0ᵀ]⁻¹ [S; 0]."""
        m = self._task.dimension
        rows = self._task.select(np.eye(6), self._robot.pose(self._at).rotation)
        right = np.zeros((m + self.size, self.size + 6))
        right[m:, : self.size] = np.eye(self.size)
        right[:m, self.size :] = rows
        both = np.linalg.solve(self._system(self._at), right)
        return np.asarray(both[:, : self.size]), np.asarray(both[:, self.size :])

    def _system(self, q: Array) -> Array:
        return np.vstack([self._robot.task_jacobian(q, self._task), self._null.T])

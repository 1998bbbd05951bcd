"""A motion at sample times, as costs and constraints see it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from selfmotion import kernels
from selfmotion.basics import Array
from selfmotion.motion import Grid
from selfmotion.robot import RobotModel
from selfmotion.task import Task


@dataclass(frozen=True, eq=False)
class Samples:
    """A joint motion at S times, with the tool's kinematics there.

    Attributes
    ----------
    grid : Grid
        Whose stages the samples are.
    q, qd : (S, n)
        Joint coordinates and velocities.
    jacobian : (S, 6, n)
        The tool's Jacobian [v, ω], world axes.
    rotation, translation : (S, 3, 3), (S, 3)
        The tool's pose.
    task : Task
        The rows the path prescribes.
    task_jacobian : (S, m, n)
        Those rows of the Jacobian.
    """

    grid: Grid
    q: Array
    qd: Array
    jacobian: Array
    rotation: Array
    translation: Array
    task: Task
    task_jacobian: Array

    @classmethod
    def along(cls, robot: RobotModel, task: Task, grid: Grid, q: Array, qd: Array) -> "Samples":
        """Return the samples of a motion known at the stages of `grid`, q and q̇ (S, n) each."""
        jacobian = np.empty((len(q), 6, robot.dof))
        rotation, translation = np.empty((len(q), 3, 3)), np.empty((len(q), 3))
        for k, configuration in enumerate(q):
            jacobian[k], rotation[k], translation[k] = robot.kinematics(configuration)
        rows = jacobian
        if task.tool_axes:
            turned = rotation.transpose(0, 2, 1) @ jacobian[:, 3:]
            rows = np.concatenate([jacobian[:, :3], turned], axis=1)
        task_jacobian = np.ascontiguousarray(rows[:, task.rows])
        return cls(grid, q, qd, jacobian, rotation, translation, task, task_jacobian)

    @property
    def t(self) -> Array:
        """Times [s], (S,)."""
        return self.grid.stage_times

    @property
    def weights(self) -> Array:
        """Quadrature weights [s]: ∫ G dt ≈ weights · G, (S,)."""
        return self.grid.weights

    @cached_property
    def qdd(self) -> Array:
        """Joint accelerations, (S, n): differences of q̇ over the nodes."""
        return np.asarray(self.grid.differentiation(1) @ self.qd[self.grid.node_stages])

    @cached_property
    def qddd(self) -> Array:
        """Joint jerks, (S, n)."""
        return np.asarray(self.grid.differentiation(2) @ self.qd[self.grid.node_stages])

    @cached_property
    def gram(self) -> Array:
        """JJᵀ of the task Jacobian, (S, m, m)."""
        gram: Array = self.task_jacobian @ self.task_jacobian.transpose(0, 2, 1)
        return gram

    @cached_property
    def gram_determinant(self) -> Array:
        """Det JJᵀ = w², the square of Yoshikawa's manipulability, (S,)."""
        return np.asarray(np.linalg.det(self.gram))

    @cached_property
    def log_determinant_gradient(self) -> Array:
        """∂ log det(JJᵀ) / ∂q = 2 ⟨(JJᵀ)⁻¹J, ∂J/∂q⟩, (S, n)."""
        inverse = np.asarray(np.linalg.solve(self.gram, self.task_jacobian), dtype=np.float64)
        return self.contract(2.0 * inverse)

    def contract(self, weights: Array) -> Array:
        """Return ⟨M, ∂J/∂q_k⟩ for `weights` M (S, m, n) on the task Jacobian, (S, n)."""
        return kernels.contract_task(
            self.jacobian,
            self.rotation,
            np.ascontiguousarray(weights),
            self.task.rows,
            self.task.tool_axes,
        )

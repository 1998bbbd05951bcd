"""A motion at sample times, as costs and constraints see it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from selfmotion import kernels
from selfmotion.basics import Array
from selfmotion.follow import Follows
from selfmotion.motion import Sampling
from selfmotion.task import Task

_ARRAYS = ("q", "qd", "jacobian", "rotation", "translation", "error", "task_jacobian")


@dataclass(frozen=True, eq=False)
class Samples:
    """A joint motion at S times, with the tool's kinematics there.

    The arrays refuse to be written to.

    Attributes
    ----------
    sampling : Sampling
        When the samples are taken.
    q, qd : (S, n)
        Joint coordinates and velocities.
    jacobian : (S, 6, n)
        The tool's Jacobian [v, ω], world axes.
    rotation, translation : (S, 3, 3), (S, 3)
        The tool's pose.
    error : (S, 6)
        Pose error e, from the tool to the path [m, rad], world axes; see `Task.twist_error`.
    task : Task
        The rows the path prescribes.
    task_jacobian : (S, m, n)
        Those rows of the Jacobian.
    """

    sampling: Sampling
    q: Array
    qd: Array
    jacobian: Array
    rotation: Array
    translation: Array
    error: Array
    task: Task
    task_jacobian: Array

    def __post_init__(self) -> None:
        for name in _ARRAYS:
            # A view of its own: the owner may go on writing, whoever is shown it may not.
            view = getattr(self, name).view()
            view.setflags(write=False)
            object.__setattr__(self, name, view)

    @classmethod
    def along(cls, follows: Follows, sampling: Sampling, q: Array, qd: Array) -> "Samples":
        """Return the samples of a motion on its path, q and q̇ (S, n) each."""
        jacobian, rotation, translation = follows.only.chain.along(q)
        task = follows.task
        rows = task.select_along(jacobian, rotation)
        error = np.zeros((len(q), 6))
        return cls(sampling, q, qd, jacobian, rotation, translation, error, task, rows)

    @property
    def t(self) -> Array:
        """Times [s], (S,)."""
        return self.sampling.t

    @property
    def weights(self) -> Array:
        """Quadrature weights [s]: ∫ G dt ≈ weights · G, (S,)."""
        return self.sampling.weights

    @property
    def nodes(self) -> npt.NDArray[np.intp]:
        """Indices of the samples that are nodes, (N + 1,)."""
        return self.sampling.nodes

    @cached_property
    def qdd(self) -> Array:
        """Joint accelerations, (S, n): differences of q̇ over the nodes."""
        return np.asarray(self.sampling.differentiation(1) @ self.qd[self.nodes])

    @cached_property
    def qddd(self) -> Array:
        """Joint jerks, (S, n)."""
        return np.asarray(self.sampling.differentiation(2) @ self.qd[self.nodes])

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

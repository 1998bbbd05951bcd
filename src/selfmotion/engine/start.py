"""The start configuration: given, or free to move along its self-motion."""

from typing import Protocol

import numpy as np
import pinocchio as pin

from selfmotion import kernels
from selfmotion.basics import Array
from selfmotion.follow import Follows

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
    follows : Follows
    reference : (n,)
        q_ref, on the path's first pose; z = 0.
    """

    def __init__(self, follows: Follows, reference: Array) -> None:
        task = follows.task
        self._task, self._reference = task, reference
        self._null = follows.null_basis(reference)
        self._at = reference
        self._tool = follows.only.chain.kinematics()
        self._layout = follows.layout
        self._chart = np.ascontiguousarray(self._null), np.array(reference, dtype=np.float64)

    @property
    def size(self) -> int:
        """See `Start.size`: the redundancy r."""
        return int(self._null.shape[1])

    def configuration(self, z: Array, pose: pin.SE3) -> Array | None:
        """See `Start.configuration`."""
        q, tool = self._reference + self._null @ z, self._tool
        target = np.array(pose.rotation, order="C"), np.array(pose.translation)
        for _ in range(_STEPS):
            # In one order, for which the rest of the package is compiled, too.
            jacobian, rotation = (np.ascontiguousarray(a) for a in (tool.at(q), tool.rotation))
            place = rotation, tool.translation
            wrong = kernels.approach_start(
                q, jacobian, *place, *target, self._layout, *self._chart, z
            )
            # NaN arrives nowhere.
            if not wrong >= 0.0:
                return None
            if wrong < _ARRIVED:
                self._at = q
                return q
        return None

    def tangent(self) -> tuple[Array, Array]:
        """See `Start.tangent`: [J; N0ᵀ]⁻¹ [0; I] and [J; N0ᵀ]⁻¹ [S; 0]."""
        m, r = self._task.dimension, self.size
        jacobian = self._task.select(self._tool.at(self._at), self._tool.rotation)
        right = np.zeros((m + r, r + 6))
        right[m:, :r] = np.eye(r)
        right[:m, r:] = self._task.select(np.eye(6), self._tool.rotation)
        both = np.linalg.solve(np.vstack([jacobian, self._null.T]), right)
        return np.asarray(both[:, :r]), np.asarray(both[:, r:])

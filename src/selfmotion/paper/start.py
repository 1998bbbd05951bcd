"""The start configuration: given, or free to move along its self-motion."""

import numpy as np

from selfmotion import kernels
from selfmotion.basics import Array
from selfmotion.follow import Follows

# Newton's method onto the start of the path is quadratic: few steps, and the one after an error of
# this is exact. Far moves fail and say so.
_STEPS, _ARRIVED = 20, 1e-9


class FixedStart:
    """A given start configuration: q(0) as a function of no variables."""

    size = 0

    def __init__(self, q: Array) -> None:
        self._q = q

    def configuration(self, z: Array, target: Array) -> Array:
        """Return q(0), (n,)."""
        return self._q

    def tangent(self) -> Array:
        """Return ∂q(0)/∂z, (n, 0)."""
        return np.zeros((len(self._q), 0))


class FreeStart:
    """The start moves along the self-motion manifold of the tips' first poses.

    q(0) solves F(q) = x(0) and N0ᵀ(q - q_ref) = z, with N0 an orthonormal null-space basis at the
    reference: coordinates of the manifold, exact and smooth near it.

    Parameters
    ----------
    follows : Follows
    reference : (n,)
        q_ref, on the first poses; z = 0.
    """

    def __init__(self, follows: Follows, reference: Array) -> None:
        self._follows, self._reference = follows, reference
        self._null = follows.null_basis(reference)
        self._at = reference
        self._tips = follows.kinematics()
        self._chart = np.ascontiguousarray(self._null), np.array(reference, dtype=np.float64)

    @property
    def size(self) -> int:
        """Number of decision variables z: the redundancy r."""
        return int(self._null.shape[1])

    def configuration(self, z: Array, target: Array) -> Array | None:
        """Return q(0) (n,), or None where no configuration belongs to z and the tips' first poses.

        These are as `Follows.targets` has them, (12 F,).
        """
        q, layout = self._reference + self._null @ z, self._follows.layout
        for _ in range(_STEPS):
            wrong = kernels.approach_start(q, *self._tips.at(q), target, layout, *self._chart, z)
            # NaN arrives nowhere.
            if not wrong >= 0.0:
                return None
            if wrong < _ARRIVED:
                self._at = q
                return q
        return None

    def tangent(self) -> Array:
        """Return ∂q(0)/∂z at the last q(0), [J; N0ᵀ]⁻¹ [0; I], (n, size)."""
        items, m = self._follows.items, self._follows.dimension
        jacobians, rotations, _ = self._tips.at(self._at)
        rows = [
            item.task.select(jacobian, rotation)
            for item, jacobian, rotation in zip(items, jacobians, rotations, strict=True)
        ]
        right = np.vstack([np.zeros((m, self.size)), np.eye(self.size)])
        return np.asarray(np.linalg.solve(np.vstack([*rows, self._null.T]), right))


Start = FixedStart | FreeStart

"""The start configuration: given, or free to move along its self-motion."""

from typing import Protocol

import numpy as np

from selfmotion import kernels
from selfmotion.basics import Array
from selfmotion.follow import Follows

# Newton's method onto the start of the path is quadratic: few steps, and the one after an error of
# this is exact. Far moves fail and say so.
_STEPS, _ARRIVED = 20, 1e-9


class Start(Protocol):
    """q(0) as a function of `size` decision variables z and of the tips' first poses."""

    @property
    def size(self) -> int:
        """Number of decision variables."""

    def configuration(self, z: Array, target: Array) -> Array | None:
        """Return q(0) (n,), or None where no configuration belongs to z and the poses.

        These are as `Follows.targets` has them, (12 F,).
        """

    def tangent(self) -> tuple[Array, Array]:
        """Return ∂q(0)/∂z (n, size) and that with respect to the poses (n, 6 F), at the last q(0).

        A pose's change is [m, rotation vector].
        """


class FixedStart:
    """A given start configuration."""

    size = 0

    def __init__(self, q: Array) -> None:
        self._q = q

    def configuration(self, z: Array, target: Array) -> Array:
        """See `Start.configuration`."""
        return self._q

    def tangent(self) -> tuple[Array, Array]:
        """See `Start.tangent`."""
        return np.zeros((len(self._q), 0)), np.zeros((len(self._q), 6))


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
        """See `Start.size`: the redundancy r."""
        return int(self._null.shape[1])

    def configuration(self, z: Array, target: Array) -> Array | None:
        """See `Start.configuration`."""
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

    def tangent(self) -> tuple[Array, Array]:
        """See `Start.tangent`: [J; N0ᵀ]⁻¹ [0; I] and [J; N0ᵀ]⁻¹ [S; 0]."""
        items, r = self._follows.items, self.size
        m, count = self._follows.dimension, len(items)
        jacobians, rotations, _ = self._tips.at(self._at)
        right = np.zeros((m + r, r + 6 * count))
        right[m:, :r] = np.eye(r)
        rows, first = [], 0
        for f, item in enumerate(items):
            rows.append(item.task.select(jacobians[f], rotations[f]))
            last = first + item.task.dimension
            here = slice(r + 6 * f, r + 6 * f + 6)
            right[first:last, here] = item.task.select(np.eye(6), rotations[f])
            first = last
        both = np.linalg.solve(np.vstack([*rows, self._null.T]), right)
        return np.asarray(both[:, :r]), np.asarray(both[:, r:])

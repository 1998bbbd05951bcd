"""Where a motion starts: a given configuration, or a point of the self-motion manifold."""

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.follow import Follows, kinematics_of, null_basis
from selfmotion.model.task import SE3

# Newton steps onto the start of the path; far starts fail with an error.
_STEPS = 20
# Error at which they end: the method is quadratic, and the next error its square.
_ARRIVED = 1e-9


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
        self._null = null_basis(follows, reference)
        self._at = reference
        self._tips = kinematics_of(follows)

    @property
    def size(self) -> int:
        """Number of decision variables z: the redundancy r."""
        return int(self._null.shape[1])

    def configuration(self, z: Array, target: Array) -> Array | None:
        """Return q(0) (n,), or None where no configuration belongs to z and the tips' first poses.

        These are as `Follows.targets` has them, (12 F,).
        """
        q = self._reference + self._null @ z
        for _ in range(_STEPS):
            system, residual = self._error(q, z, target)
            wrong = float(np.abs(residual).max())
            # NaN arrives nowhere.
            if not np.isfinite(wrong):
                return None
            try:
                # B⁻¹ = Bᵀ(BBᵀ)⁻¹: errors of the product are taken out by the next step.
                q = q + system.T @ np.linalg.solve(system @ system.T, residual)
            except np.linalg.LinAlgError:
                return None
            if wrong < _ARRIVED:
                self._at = q
                return q
        return None

    def _error(self, q: Array, z: Array, target: Array) -> tuple[Array, Array]:
        """Return B = [J; N0ᵀ] (m + r, n) and b = [e; z - N0ᵀ(q - q_ref)] at q (n,)."""
        rows, errors = list[Array](), list[Array]()
        places = target.reshape(-1, 12)
        for item, place, *at in zip(self._follows.items, places, *self._tips.at(q), strict=True):
            jacobian, rotation, translation = at
            wanted = SE3(place[3:].reshape(3, 3), place[:3])
            error = item.task.twist_error(wanted, SE3(rotation, translation))
            errors.append(item.task.select(error[:, None], rotation)[:, 0])
            rows.append(item.task.select(jacobian, rotation))
        along = self._null.T
        residual = np.concatenate([*errors, z - along @ (q - self._reference)])
        return np.vstack([*rows, along]), residual

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

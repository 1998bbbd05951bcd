"""What can be asked of a finished motion: its part in the null space, and its cost by any cost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, ProblemError, shown
from selfmotion.costs import Cost, PlacedLater, Samples
from selfmotion.follow import Follows
from selfmotion.motion import Sampling, Trajectory
from selfmotion.robot import null_space

# Gauss-Legendre points on each interval: squares of a quintic's derivatives are integrated exactly.
_ROOTS, _SHARES = np.polynomial.legendre.leggauss(5)


@dataclass(frozen=True)
class NullSpaceVelocity:
    """The part of joint velocities that lies in the null space of the task's Jacobian.

    Attributes
    ----------
    joints : (n,) or (K, n)
        (I − J⁺J) q̇ [rad/s or m/s]; equal to N z.
    coordinates : (r,) or (K, r)
        z = Nᵀq̇ [rad/s or m/s].
    basis : (n, r) or (K, n, r)
        N, orthonormal, J N = 0. At each time the one nearest to that of the time before, so that z
        is continuous where times are close; the first one is arbitrary.
    """

    joints: Array
    coordinates: Array
    basis: Array


def null_space_velocity(
    follows: Follows, motion: Trajectory, t: npt.ArrayLike
) -> NullSpaceVelocity:
    """Return the part of q̇ in the null space at times within the motion; see `Plan.null_motion`."""
    if np.ndim(t) > 1:
        raise ValueError(f"t has shape {np.shape(t)}, expected a time or times (K,) [s]")
    qd = motion(t, 1)
    if qd.ndim == 1:
        basis = null_space(follows.jacobian(motion(t)))
    else:
        basis = null_space(follows.jacobians(motion(t)))
        for k in range(1, len(basis)):
            # The rotation of its columns that brings it nearest (orthogonal Procrustes problem).
            left, _, right = np.linalg.svd(basis[k].T @ basis[k - 1])
            basis[k] = basis[k] @ (left @ right)
    coordinates = np.einsum("...nr,...n->...r", basis, qd)
    return NullSpaceVelocity(np.einsum("...nr,...r->...n", basis, coordinates), coordinates, basis)


def cost_of(follows: Follows, motion: Trajectory, cost: Cost) -> float:
    """Return ∫ G dt of a cost along a motion; see `Plan.evaluate`."""
    if not isinstance(cost, Cost):
        raise ProblemError(
            f"cost is {shown(cost)}, expected a cost such as sm.costs.JointVelocity(), or "
            f"sm.costs.FunctionCost(g) for a function"
        )
    cost.check(follows)
    samples = _samples(follows, motion)
    values = np.asarray(cost.value(samples))
    if values.shape != samples.t.shape:
        raise ProblemError(
            f"cost '{cost.name}': its value has shape {values.shape}, expected {samples.t.shape}: "
            f"one number for each sample"
        )
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        raise ProblemError(
            f"cost '{cost.name}': its value is {values[bad[0]]} at t = {samples.t[bad[0]]:.6g} s, "
            f"expected finite numbers; selfmotion.testing.check_cost checks a cost"
        )
    return float(samples.weights @ values)


def _samples(follows: Follows, motion: Trajectory) -> Samples:
    """Return a motion at the Gauss points of each of its intervals."""
    steps = np.diff(motion.t)[:, None]
    t = (motion.t[:-1, None] + steps * 0.5 * (1.0 + _ROOTS)).ravel()
    sampling = Sampling(t, (steps * 0.5 * _SHARES).ravel(), np.arange(len(t)))
    q, qd, qdd, qddd = (motion(t, order) for order in range(4))
    return PlacedLater(follows, sampling, q=q, qd=qd, qdd=qdd, qddd=qddd)

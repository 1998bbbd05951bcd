"""Measures of a finished motion: use of limits, null-space motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, ProblemError, read_only, shown
from selfmotion.certificate import (
    Quantity,
    QuantityWithinLimits,
    Requirement,
    VelocityByPosition,
    deviation_from,
)
from selfmotion.model.follow import Follows
from selfmotion.model.motion import Sampling, Trajectory
from selfmotion.model.robot import null_space
from selfmotion.planning.result.pace_rows import PaceLimits
from selfmotion.problem.costs import Cost, LazySamples, Samples
from selfmotion.problem.problem import Problem, envelope_of_problem

# Share of a limit from which on it counts as fully used.
FULLY = 0.95
# Evaluations of limits per sample of the motion.
_LIMIT_OVERSAMPLING = 3
# Smallest number of these evaluations.
_MIN_EVALUATIONS = 2000
_RATES = ("speed", "acceleration", "jerk")


@dataclass(frozen=True)
class LimitsUsed:
    """Share of a motion's time in which limits of its pace are fully used, by 95 % or more.

    Attributes
    ----------
    busy : float
        Share of the time with any limit fully used; at 1 the motion is as fast as its joint path
        allows.
    shares : tuple of (str, float)
        Shares by the limit used most, "acceleration of joint 'elbow'"; the longest first.
    """

    busy: float
    shares: tuple[tuple[str, float], ...]

    def __str__(self) -> str:
        """Return both in words."""
        total = f"{self.busy:.1%} of the time"
        if not self.shares:
            return total
        return f"{total}: " + ", ".join(f"{name} {share:.1%}" for name, share in self.shares)


def quantities_of_pace(requirements: Sequence[Requirement]) -> tuple[Quantity, ...]:
    """Return the constrained quantities that a slower motion can bring within their limits."""
    kinds = QuantityWithinLimits | VelocityByPosition
    selected = (item.quantity for item in requirements if isinstance(item, kinds))
    return tuple(item for item in selected if item.of_pace and len(item.limited))


def limits_used(problem: Problem, motion: Trajectory) -> LimitsUsed:
    """Return the shares of time in which a motion fully uses limits of a problem."""
    envelope = envelope_of_problem(problem)
    quantities = quantities_of_pace(problem.requirements)
    limits = PaceLimits(envelope.speed, envelope.acceleration, envelope.jerk, quantities)
    count = max(_LIMIT_OVERSAMPLING * len(motion.t), _MIN_EVALUATIONS)
    # Midpoint rule on equal intervals.
    t = motion.t[0] + motion.duration * (np.arange(count) + 0.5) / count
    used = np.concatenate(limits.shares_at(motion, t), axis=1)
    names = [f"{rate} of joint '{name}'" for rate in _RATES for name in motion.joint_names]
    names += [column.label for item in quantities for column in item.columns]
    most = np.argmax(used, axis=1)
    full = used.max(axis=1) >= FULLY
    shares = _shares(most[full], len(names)) / count
    order = np.argsort(-shares, kind="stable")
    found = tuple((names[k], float(shares[k])) for k in order if shares[k] > 0.0)
    return LimitsUsed(float(full.mean()), found)


def _shares(which: Array, count: int) -> Array:
    return np.bincount(which, minlength=count).astype(np.float64)


# Gauss-Legendre points on each interval: squares of a quintic's derivatives are integrated exactly.
_ROOTS, _WEIGHTS = np.polynomial.legendre.leggauss(5)


@dataclass(frozen=True, eq=False)
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

    def __repr__(self) -> str:
        """Return its task and its largest value."""
        several = "" if self.joints.ndim == 1 else f"{len(self.joints)} times, "
        most = np.abs(self.joints).max(initial=0.0)
        return (
            f"NullSpaceVelocity({several}{self.joints.shape[-1]} joints, "
            f"{self.coordinates.shape[-1]} coordinates, at most {most:.4g} rad/s or m/s)"
        )


def null_space_velocity(
    follows: Follows, motion: Trajectory, t: npt.ArrayLike
) -> NullSpaceVelocity:
    """Return the part of q̇ in the null space at times within the motion; see `Plan.null_motion`."""
    _check_times(t)
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


def deviation_along(problem: Problem, motion: Trajectory, t: npt.ArrayLike) -> Array:
    """Return the deviation of the tool from its path at times; see `Plan.deviation`."""
    _check_times(t)
    q, in_tool_axes = motion(t), any(item.in_tool_axes for item in problem.relaxations)
    times = np.atleast_1d(np.asarray(t, dtype=np.float64))
    found = deviation_from(problem.follows.items[0], times, np.atleast_2d(q), in_tool_axes)
    return read_only(found if q.ndim == 2 else found[0])


def _check_times(t: npt.ArrayLike) -> None:
    if np.ndim(t) > 1:
        raise ValueError(f"t has shape {np.shape(t)}, expected a time or times (K,) [s]")


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
    sampling = Sampling(t, (steps * 0.5 * _WEIGHTS).ravel(), np.arange(len(t)))
    q, qd, qdd, qddd = (motion(t, order) for order in range(4))
    return LazySamples(follows, sampling, q=q, qd=qd, qdd=qdd, qddd=qddd)

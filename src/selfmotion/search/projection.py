"""What numba compiles of Newton's method onto self-motions: for one configuration, or many."""

import numpy as np

from selfmotion.basics import Array, Flags, called, kernel
from selfmotion.basics.layout import Layout
from selfmotion.kernels import (
    cholesky,
    errors_and_rows,
    gram,
    rows_of,
    solve_cholesky,
)
from selfmotion.robot import place_tips
from selfmotion.search.settings import LITTLE_GAIN, LITTLE_GAINS

# A Newton correction of this size [rad or m] leaves an error of its square.
CONVERGED = 1e-6
# What a solution may miss by [m, rad].
NOTHING_LEFT = 1e-12


@kernel
def correct(
    q: Array,
    jacobians: Array,
    rotations: Array,
    translations: Array,
    target: Array,
    layout: Layout,
    tangent: Array,
    longest: float,
) -> float:
    """Add J⁺e to q, no longer than `longest`, and project `tangent` onto the null space of J.

    Of all tips, (F, 6, n), (F, 3, 3) and (F, 3); `target` (12 F,) is as `Follows.targets` has it.
    Returns the norm of the correction before it was shortened; -1 where J has no full rank.
    """
    n, m = jacobians.shape[2], rows_of(layout)
    z, along = np.empty(m), np.zeros(m)
    jacobian, factor = np.empty((m, n)), np.empty((m, m))
    errors_and_rows(layout, target, jacobians, rotations, translations, z, jacobian)
    for i in range(m):
        for k in range(n):
            along[i] += jacobian[i, k] * tangent[k]
    gram(jacobian, factor)
    if not cholesky(factor):
        return -1.0
    solve_cholesky(factor, z)
    solve_cholesky(factor, along)
    length, norm = 0.0, 0.0
    step = np.zeros(n)
    for k in range(n):
        for i in range(m):
            step[k] += jacobian[i, k] * z[i]
            tangent[k] -= jacobian[i, k] * along[i]
        length += step[k] ** 2
        norm += tangent[k] ** 2
    length, norm = np.sqrt(length), np.sqrt(norm)
    scale = longest / length if length > longest else 1.0
    for k in range(n):
        q[k] += scale * step[k]
        tangent[k] /= norm
    return float(length)


@called
def stopped(q: Array, lower: Array, upper: Array, held: Flags) -> bool:
    """Put joints (n,) that are beyond a limit onto it and note that; return whether none was."""
    inside = True
    for j in range(len(q)):
        if q[j] < lower[j] or q[j] > upper[j]:
            q[j] = min(max(q[j], lower[j]), upper[j])
            held[j], inside = True, False
    return inside


@called
def clear_held(held: Flags, jacobians: Array) -> None:
    """Clear the columns of joints (n,) that are held in Jacobians (F, 6, n)."""
    for j in range(len(held)):
        if held[j]:
            for f in range(jacobians.shape[0]):
                for i in range(6):
                    jacobians[f, i, j] = 0.0


@kernel
def project_all(
    q: Array,
    targets: Array,
    chains: Array,
    layout: Layout,
    lower: Array,
    upper: Array,
    still: Flags,
    longest: float,
    steps: int,
    arrived: Flags,
) -> None:
    """Put each of q (K, n) onto its target (K, 12 F) by Newton's method, in place.

    A joint that would leave its limits (K, n) stays at the limit, and the others do the rest;
    joints that are to stand `still` (K, n) are at 0. `arrived`
    (K,) says of which that was possible within so many steps.
    """
    n, tips = q.shape[1], layout.shape[0]
    r, p = np.empty((chains.shape[1], 3, 3)), np.empty((chains.shape[1], 3))
    rotations, positions = np.empty((tips, 3, 3)), np.empty((tips, 3))
    jacobians, unused = np.zeros((tips, 6, n)), np.empty(n)
    held = np.zeros(n, dtype=np.bool_)
    for k in range(len(q)):
        arrived[k] = False
        for j in range(n):
            held[j] = still[k, j]
            if still[k, j]:
                q[k, j] = 0.0
        length = np.inf
        for _ in range(steps):
            inside = stopped(q[k], lower[k], upper[k], held)
            if inside and length < CONVERGED:
                arrived[k] = True
                break
            place_tips(q[k], chains, r, p, rotations, positions, jacobians)
            unused[:] = 1.0
            clear_held(held, jacobians)
            length = correct(
                q[k], jacobians, rotations, positions, targets[k], layout, unused, longest
            )
            # Singular, or not a number.
            if not length >= 0.0:
                break


@kernel
def approach_all(
    q: Array,
    target: Array,
    chains: Array,
    layout: Layout,
    lower: Array,
    upper: Array,
    still: Flags,
    iterations: int,
    misses: Array,
) -> None:
    """Bring each of q (K, n) as near to a target as limits let it.

    Levenberg-Marquardt with steps that are cut off at the limits, which arrives also where Newton's
    method does not, and at the nearest place where nothing arrives; joints that are to stand
    `still` (n,) are at 0. `misses` (K, m) are what is left in the rows [m, rad]; infinite where
    that is no number from the beginning.
    """
    n, tips, m = q.shape[1], layout.shape[0], rows_of(layout)
    r, p = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3))
    rotations, positions = np.empty((tips, 3, 3)), np.empty((tips, 3))
    jacobians, error, step = np.zeros((tips, 6, n)), np.empty(m), np.empty(m)
    jacobian, factor, steep = np.empty((m, n)), np.empty((m, m)), np.empty((m, n))
    trial = np.empty(n)
    for k in range(len(q)):
        damping, best, idle = 1e-3, np.inf, 0
        trial[:], error[:] = q[k], np.inf
        for _ in range(iterations):
            for j in range(n):
                trial[j] = 0.0 if still[j] else min(max(trial[j], lower[j]), upper[j])
            place_tips(trial, chains, r, p, rotations, positions, jacobians)
            clear_held(still, jacobians)
            errors_and_rows(layout, target, jacobians, rotations, positions, step, steep)
            size = 0.0
            for i in range(m):
                size += step[i] ** 2
            if size < best:
                idle = idle + 1 if size > (1.0 - LITTLE_GAIN) * best else 0
                best, damping = size, max(0.1 * damping, 1e-14)
                error[:], jacobian[:], q[k] = step, steep, trial
                hold(q[k], lower, upper, error, jacobian)
            else:
                damping *= 10.0
                # Before anything is known it is not a number: there is no way on from there.
                if damping > 1e6 or best == np.inf:
                    break
            if best < NOTHING_LEFT**2 or idle == LITTLE_GAINS:
                break
            gram(jacobian, factor)
            for i in range(m):
                factor[i, i] += damping
                step[i] = error[i]
            if not cholesky(factor):
                break
            solve_cholesky(factor, step)
            for j in range(n):
                along = 0.0
                for i in range(m):
                    along += jacobian[i, j] * step[i]
                trial[j] = q[k, j] + along
        misses[k] = error


@called
def hold(q: Array, lower: Array, upper: Array, error: Array, jacobian: Array) -> None:
    """Take the joints at limits that a step would leave out of J (m, n)."""
    for j in range(len(q)):
        slope = 0.0
        for i in range(len(error)):
            slope += jacobian[i, j] * error[i]
        if (q[j] <= lower[j] and slope < 0.0) or (q[j] >= upper[j] and slope > 0.0):
            jacobian[:, j] = 0.0

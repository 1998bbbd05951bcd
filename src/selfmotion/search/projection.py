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

# A Newton correction of this size [rad or m] leaves an error of its square.
CONVERGED = 1e-6


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


@kernel
def project_all(
    q: Array,
    targets: Array,
    chains: Array,
    layout: Layout,
    lower: Array,
    upper: Array,
    longest: float,
    steps: int,
    arrived: Flags,
) -> None:
    """Put each of q (K, n) onto its target (K, 12 F) by Newton's method, in place.

    A joint that would leave its limits stays at the limit, and the others do the rest. `arrived`
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
            held[j] = False
        length = np.inf
        for _ in range(steps):
            inside = stopped(q[k], lower, upper, held)
            if inside and length < CONVERGED:
                arrived[k] = True
                break
            place_tips(q[k], chains, r, p, rotations, positions, jacobians)
            for j in range(n):
                unused[j] = 1.0
                if held[j]:
                    for f in range(tips):
                        for i in range(6):
                            jacobians[f, i, j] = 0.0
            length = correct(
                q[k], jacobians, rotations, positions, targets[k], layout, unused, longest
            )
            # Singular, or not a number.
            if not length >= 0.0:
                break

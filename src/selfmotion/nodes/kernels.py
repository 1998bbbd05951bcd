"""What numba compiles: nodes put onto their self-motion manifolds, eq. 4 there, and both backward.

Each node's chart is around a reference on the manifold, with an orthonormal basis N0 of the null
space there: z are the coordinates N0ᵀ(q - q_ref) of q on the manifold {q : F(q) = x}, and ε = N0 ν
is the null motion of eq. 4. With B = [J; N0ᵀ],

    ∂q/∂z = T = B⁻¹ [0; I],    ∂q̇/∂ν = (I - J⁺J) N0,    ∂q̇/∂z = (∂q̇/∂q) T.
"""

from math import sqrt

import numpy as np

from selfmotion.basics import Array, Flags, inlined, kernel
from selfmotion.basics.layout import Layout
from selfmotion.kernels import (
    Every,
    Tip,
    approach,
    cholesky,
    errors_and_rows,
    finite,
    gram,
    pull_stage,
    respond,
    rows_of,
    select,
    solve_cholesky,
    space_of,
    stage_of,
    tip_of,
    view,
)
from selfmotion.robot import place_tips

# A node this near to its place [m, rad] is there; Newton's method is quadratic from nearby.
_THERE, _STEPS = 1e-12, 12
# A guess need not be nearer; the step after that makes it a square of this.
_NEAR = 1e-4


@kernel
def look(
    q: Array,
    coordinates: Array,
    bases: Array,
    references: Array,
    targets: Array,
    chains: Array,
    layout: Layout,
    table: Array,
    tangents: Array,
    held: Flags,
    centred: bool,
    carried: int,
) -> int:
    """Put nodes onto their manifolds at coordinates z (K, r), and evaluate eq. 4 there.

    For charts with `bases` (K, n, r) and `references` (K, n), and `targets` (K, 12 F). Rows of the
    `table` hold paths and null motions already; q̇ and all else is set, q (K, n), and T in
    `tangents` (K, n, r). Or, `centred`, an orthonormal basis of the null space instead of T, and of
    ε what is in it: the same motion in charts around it. Where bases are to be `carried`, along
    motions of so many nodes, the first is that of a motion's first node, and each other one becomes
    what is found at the node before; 0 for none. Joints that are `held` (K, n) at 0 move no tip;
    see `Charts`. Returns the first node for which that is impossible, or -1; of all such nodes, q̇
    is no number.
    """
    failed = -1
    (count, n), m, r = q.shape, rows_of(layout), bases.shape[2]
    tips = layout.shape[0]
    turns, places = np.empty((chains.shape[1], 3, 3)), np.empty((chains.shape[1], 3))
    rotations, positions = np.empty((tips, 3, 3)), np.empty((tips, 3))
    jacobians = np.zeros((tips, 6, n))
    system, factor, b = np.empty((n, n)), np.empty((n, n)), np.empty(n)
    for k in range(count):
        # Views: slices are counted references, which take as long as what is done with them.
        here, off = view(q[k], 0, (n,)), np.inf
        if carried > 0 and k % carried > 0:
            for j in range(n):
                for x in range(r):
                    bases[k, j, x] = tangents[k - 1, j, x]
        for j in range(n):
            here[j] = references[k, j]
            for x in range(r):
                here[j] += bases[k, j, x] * coordinates[k, x]
        for _ in range(_STEPS):
            place_tips(here, chains, turns, places, rotations, positions, jacobians)
            _hold(held[k], jacobians)
            off = approach(
                here,
                jacobians,
                rotations,
                positions,
                view(targets[k], 0, (12 * tips,)),
                layout,
                view(bases[k], 0, (n, r)),
                view(references[k], 0, (n,)),
                view(coordinates[k], 0, (r,)),
                b,
                system,
                factor,
            )
            # Singular, not a number, or there: what that step has moved is rounding.
            if not off >= _THERE:
                break
        if not 0.0 <= off < _THERE:
            failed = k if failed < 0 else failed
            nowhere = stage_of(table[k], n, m).qd
            for j in range(n):
                nowhere[j] = np.nan
                for x in range(r):
                    tangents[k, j, x] = np.nan
            continue
        for x in range(r):
            for i in range(n):
                b[i] = 1.0 if i == m + x else 0.0
            solve_cholesky(factor, b)
            for j in range(n):
                total = 0.0
                for i in range(n):
                    total += system[i, j] * b[i]
                tangents[k, j, x] = total
        row = table[k]
        at = stage_of(row, n, m)
        if centred:
            _centre(tangents[k], at.epsilon, b)
        for j in range(n):
            at.q[j] = q[k, j]
        # The rows of B, and of the factor of BBᵀ, begin with those of J and of JJᵀ.
        for i in range(m):
            for j in range(n):
                at.task_jacobian[i, j] = system[i, j]
            for j in range(i + 1):
                at.factor[i, j] = factor[i, j]
        for f in range(tips):
            tip = tip_of(row, f, n, m)
            _note(tip, rotations[f], positions[f], jacobians[f])
            select(layout, f, tip.rotation, tip.command, at.y)
        respond(at.task_jacobian, at.factor, at.y, at.epsilon, at.qd)
        if not finite(at.qd):
            failed = k if failed < 0 else failed
    return failed


@inlined
def _hold(held: Flags, jacobians: Array) -> None:
    """Clear the columns of joints that are held, (n,), in Jacobians (F, 6, n)."""
    for j in range(len(held)):
        if held[j]:
            for f in range(jacobians.shape[0]):
                for i in range(6):
                    jacobians[f, i, j] = 0.0


@inlined
def _centre(tangents: Array, epsilon: Array, rest: Array) -> None:
    """Make tangents (n, r) orthonormal by Gram-Schmidt, and ε what of it they span."""
    n, r = tangents.shape
    for j in range(n):
        rest[j] = epsilon[j]
    for x in range(r):
        for y in range(x):
            share = 0.0
            for j in range(n):
                share += tangents[j, y] * tangents[j, x]
            for j in range(n):
                tangents[j, x] -= share * tangents[j, y]
        square, share = 0.0, 0.0
        for j in range(n):
            square += tangents[j, x] * tangents[j, x]
            share += tangents[j, x] * rest[j]
        length = sqrt(square)
        for j in range(n):
            rest[j] -= share / square * tangents[j, x]
            tangents[j, x] /= length
    for j in range(n):
        epsilon[j] -= rest[j]


@inlined
def _note(tip: Tip, turn: Array, place: Array, six: Array) -> None:
    """Set where a tip is, its Jacobian, and that its command is its path's twist."""
    for i in range(3):
        tip.translation[i] = place[i]
        for j in range(3):
            tip.rotation[i, j] = turn[i, j]
    for i in range(6):
        tip.command[i] = tip.target_twist[i]
        for j in range(six.shape[1]):
            tip.jacobian[i, j] = six[i, j]


@kernel
def pull(
    by_q: Array,
    by_qd: Array,
    table: Array,
    layout: Layout,
    work: Array,
    no_error: Array,
    bases: Array,
    tangents: Array,
    every: Every | None,
    out: Array,
) -> None:
    """Set `out` (K, 2 r) to the derivatives by (z, ν) of what has these by q and q̇ (K, n) each."""
    (count, n), m, r = by_q.shape, rows_of(layout), bases.shape[2]
    space = space_of(work, n, m)
    for k in range(count):
        for j in range(n):
            space.w[j], space.by_q[j] = by_qd[k, j], by_q[k, j]
        pull_stage(table[k], n, layout, 0.0, None, every, k, space, no_error, space.by_epsilon)
        for x in range(r):
            along, free = 0.0, 0.0
            for j in range(n):
                along += tangents[k, j, x] * space.by_q[j]
                free += bases[k, j, x] * space.by_epsilon[j]
            out[k, x], out[k, r + x] = along, free


@kernel
def follow(
    start: Array,
    wanted: Array,
    share: Array,
    targets: Array,
    chains: Array,
    layout: Layout,
    held: Flags,
    q: Array,
) -> int:
    """Set q (K, n) to configurations on targets (K, 12 F), each near the one before it.

    From one to the next, the self-motion goes a `share` (K,) of the way to `wanted` (n,); joints
    that are `held` (K, n) are at 0. Returns the first one that is not to be had, or -1.
    """
    (count, n), m, tips = q.shape, rows_of(layout), layout.shape[0]
    turns, places = np.empty((chains.shape[1], 3, 3)), np.empty((chains.shape[1], 3))
    rotations, positions = np.empty((tips, 3, 3)), np.empty((tips, 3))
    jacobians = np.zeros((tips, 6, n))
    rows, factor, b = np.empty((m, n)), np.empty((m, m)), np.empty(m)
    way, here = np.empty(n), start.copy()
    for k in range(count):
        off = np.inf
        for j in range(n):
            if held[k, j]:
                here[j] = 0.0
        for i in range(_STEPS):
            place_tips(here, chains, turns, places, rotations, positions, jacobians)
            _hold(held[k], jacobians)
            errors_and_rows(layout, targets[k], jacobians, rotations, positions, b, rows)
            off = 0.0
            for x in range(m):
                if not abs(b[x]) <= off:
                    off = abs(b[x])
            # First Jᵀ(JJᵀ)⁻¹(e - J p) + p: towards what is wanted by p, then what is left of e.
            for j in range(n):
                way[j] = share[k] * (wanted[j] - here[j]) if i == 0 and not held[k, j] else 0.0
            for x in range(m):
                for j in range(n):
                    b[x] -= rows[x, j] * way[j]
            gram(rows, factor)
            if not off < np.inf or not cholesky(factor):
                return k
            solve_cholesky(factor, b)
            for j in range(n):
                here[j] += way[j]
                for x in range(m):
                    here[j] += rows[x, j] * b[x]
            if i > 0 and off < _NEAR:
                break
        if not off < _NEAR:
            return k
        for j in range(n):
            q[k, j] = here[j]
    return -1

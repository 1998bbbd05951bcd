"""Compiled: retraction of nodes onto their self-motion manifolds; eq. 4 and its rate there.

Each node's chart is around a reference on the manifold, with an orthonormal basis N0 of the null
space there: z are the coordinates N0ᵀ(q - q_ref) of q on the manifold {q : F(q) = x}, and ε = N0 ν
is the null motion of eq. 4. With B = [J; N0ᵀ],

    ∂q/∂z = T = B⁻¹ [0; I],    ∂q̇/∂ν = (I - J⁺J) N0.

The rate of eq. 4 along the motion is q̈ = J⁺(ẍ - J̇q̇) + (I - J⁺J) a, with a = N0 α of the node.
"""

from math import sqrt

import numpy as np

from selfmotion.basics import Array, Flags, Ints, called, inlined, kernel
from selfmotion.basics.layout import COUNT, FIRST, KIND, ORDER, POINTING, ROWS, Layout
from selfmotion.model.kernels import (
    Every,
    Stage,
    Tip,
    Vector,
    add_angular,
    angular,
    angular_part,
    cholesky,
    clear_held,
    cross,
    dot,
    errors_and_rows,
    evaluate_motion,
    gram,
    linear,
    plus,
    rows_of,
    select,
    solve_cholesky,
    stage_of,
    start_step,
    tip_of,
    view,
)
from selfmotion.model.robot import place_tips

# Residual [m, rad] at which a node counts as on its manifold; Newton's method is quadratic nearby.
_THERE = 1e-12
# Newton iterations of a node.
_STEPS = 12
# Residual of a guess that is near enough: the next iteration squares it.
_NEAR = 1e-4


@kernel
def retract(
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
    `tangents` (K, n, r). If `centred`, an orthonormal basis of the null space instead of T, and the
    projection of ε onto it: the same motion in charts around it. `carried` is the number of nodes
    of a motion whose bases are carried along: the first node's is given, each other one is that of
    the node before; 0 for given bases. Joints that are `held` (K, n) at 0 move no tip; see
    `Charts`. Returns the first node that cannot be put onto its manifold, or -1; q̇ of all such
    nodes is NaN.
    """
    failed = -1
    (count, n), m, r = q.shape, rows_of(layout), bases.shape[2]
    tips = layout.shape[0]
    turns, places = np.empty((chains.shape[1], 3, 3)), np.empty((chains.shape[1], 3))
    rotations, positions = np.empty((tips, 3, 3)), np.empty((tips, 3))
    jacobians = np.zeros((tips, 6, n))
    system, factor, b = np.empty((n, n)), np.empty((n, n)), np.empty(n)
    for k in range(count):
        # Views: slices are reference-counted, which takes as long as the computation.
        here, off = view(q[k], 0, (n,)), np.inf
        basis, reference = view(bases[k], 0, (n, r)), view(references[k], 0, (n,))
        z = view(coordinates[k], 0, (r,))
        _begin(here, reference, basis, z, tangents[k - 1], carried > 0 and k % carried > 0)
        for _ in range(_STEPS):
            place_tips(here, chains, turns, places, rotations, positions, jacobians)
            clear_held(held[k], jacobians)
            off = start_step(
                here,
                jacobians,
                rotations,
                positions,
                view(targets[k], 0, (12 * tips,)),
                layout,
                basis,
                reference,
                z,
                b,
                system,
                factor,
            )
            # Singular, NaN, or converged: after that step the rest is rounding.
            if not off >= _THERE:
                break
        if not 0.0 <= off < _THERE:
            failed = k if failed < 0 else failed
            stage_of(table[k], n, m).qd[:] = np.nan
            tangents[k][:] = np.nan
            continue
        _set_tangents(tangents[k], system, factor, b)
        if centred:
            _centre(tangents[k], stage_of(table[k], n, m).epsilon, b)
        at = stage_of(table[k], n, m)
        _set_rows(at, system, factor)
        if not evaluate_motion(here, table[k], layout, rotations, positions, jacobians):
            failed = k if failed < 0 else failed
    return failed


@inlined
def _set_rows(at: Stage, system: Array, factor: Array) -> None:
    """Set J and the factor of JJᵀ: the first rows of B, and of the factor of BBᵀ."""
    m, n = at.task_jacobian.shape
    for i in range(m):
        for j in range(n):
            at.task_jacobian[i, j] = system[i, j]
        for j in range(i + 1):
            at.factor[i, j] = factor[i, j]


@inlined
def _begin(
    q: Array, reference: Array, basis: Array, coordinates: Array, before: Array, carries: bool
) -> None:
    """Set q (n,) to the reference displaced along a basis (n, r): `before` it, if it carries."""
    n, r = basis.shape
    for j in range(n):
        q[j] = reference[j]
        for x in range(r):
            if carries:
                basis[j, x] = before[j, x]
            q[j] += basis[j, x] * coordinates[x]


@inlined
def _set_tangents(tangents: Array, system: Array, factor: Array, b: Array) -> None:
    """Set T (n, r) = B⁻¹ [0; I], for B (n, n) = `system` and the factor of BBᵀ."""
    n, r = tangents.shape
    for x in range(r):
        for i in range(n):
            b[i] = 1.0 if i == n - r + x else 0.0
        solve_cholesky(factor, b)
        for j in range(n):
            total = 0.0
            for i in range(n):
                total += system[i, j] * b[i]
            tangents[j, x] = total


@inlined
def _centre(tangents: Array, epsilon: Array, rest: Array) -> None:
    """Orthonormalise tangents (n, r) by Gram-Schmidt, and project ε onto them."""
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


@kernel
def accelerate(
    table: Array,
    layout: Layout,
    every: Every | None,
    accelerations: Array,
    alpha: Array,
    qdd: Array,
) -> None:
    """Set q̈ (K, n) of nodes whose motion `retract` has evaluated: q̈ = a + J⁺(b - J a).

    With a (K, n) = `alpha` the null acceleration, b = S(ẍ - J̇q̇) + Ṡ(ẋ - Jq̇), and
    ẍ = `accelerations` (K, 6 F).
    """
    (count, n), m = qdd.shape, rows_of(layout)
    right, six = np.empty(m), np.empty(6)
    for k in range(count):
        at = stage_of(table[k], n, m)
        required_acceleration(table[k], layout, every, k, accelerations[k], at.qd, six, right)
        project(at.task_jacobian, at.factor, right, alpha[k], qdd[k])


@called
def required_acceleration(
    row: Array,
    layout: Layout,
    every: Every | None,
    s: int,
    accelerations: Array,
    rates: Array,
    six: Array,
    out: Array,
) -> None:
    """Set `out` (m,) to the right side b of q̈ at q̇ = `rates`; `six` is work space.

    Rows in tool axes turn with the tool: there, Ṡ(ẋ - Jq̇) = -S(ω × ω_d).
    """
    n, m = len(rates), rows_of(layout)
    for f in range(layout.shape[0]):
        tip = tip_of(row, f, n, m)
        spin = turned(layout, f, tip.jacobian, every, s, rates, six)
        for i in range(6):
            six[i] = accelerations[6 * f + i] - six[i]
        if layout[f, KIND] == POINTING:
            add_angular(six, -1.0, cross(spin, angular_part(tip.target_twist)))
        select(layout, f, tip.rotation, six, out)


@called
def acceleration_slopes(
    row: Array,
    layout: Layout,
    every: Every | None,
    s: int,
    rates: Array,
    with_path: bool,
    six: Array,
    out: Array,
) -> None:
    """Set `out` (m, n) to ∂b/∂q̇ at q̇ = `rates`; `six` is work space.

    Without the paths' own motion, unless `with_path`: b is then -S J̇q̇, and this is linear in q̇. Of
    joint k of a chain, with v_k and ω_k its columns and sums over the joints before and behind it,

        ∂(J̇q̇)/∂q̇_k = [2 (Σ_{i≤k} q̇_i ω_i × v_k + ω_k × Σ_{i>k} q̇_i v_i);
                       Σ_{i<k} q̇_i ω_i × ω_k + ω_k × Σ_{i>k} q̇_i ω_i].
    """
    n, m = len(rates), rows_of(layout)
    for i in range(m):
        for j in range(n):
            out[i, j] = 0.0
    for f in range(layout.shape[0]):
        tip, none = tip_of(row, f, n, m), (0.0, 0.0, 0.0)
        turns = with_path and layout[f, KIND] == POINTING
        target = angular_part(tip.target_twist) if turns else none
        if every is None:
            _add_slopes(
                layout, f, tip, tip.jacobian, layout[f], ORDER, None, rates, target, six, out
            )
        else:
            members = every[1]
            own, coordinates = every[0][s, f], members[members.shape[0] - 1]
            _add_slopes(layout, f, tip, own, members[f], 0, coordinates, rates, target, six, out)


@inlined
def _add_slopes(
    layout: Layout,
    f: int,
    tip: Tip,
    columns: Array,
    order: Ints,
    first: int,
    coordinates: Ints | None,
    rates: Array,
    target: Vector,
    six: Array,
    out: Array,
) -> None:
    """Add tip f's part of ∂b/∂q̇, of columns (6, W) that come in an order from `first` on.

    Each is of a coordinate (W,), or of that of its number.
    """
    before, behind, moves = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for i in range(columns.shape[1]):
        k = order[first + i]
        rate = rates[k] if coordinates is None else rates[coordinates[k]]
        moves = plus(moves, rate, linear(columns, k))
        behind = plus(behind, rate, angular(columns, k))
    for i in range(columns.shape[1]):
        k = order[first + i]
        j = k if coordinates is None else coordinates[k]
        v, w = linear(columns, k), angular(columns, k)
        moves, behind = plus(moves, -rates[j], v), plus(behind, -rates[j], w)
        upto = plus(before, rates[j], w)
        place = plus(cross(upto, v), 1.0, cross(w, moves))
        turn = plus(cross(before, w), 1.0, cross(w, plus(behind, 1.0, target)))
        for x in range(3):
            six[x], six[3 + x] = -2.0 * place[x], -turn[x]
        _add_selected(layout, f, tip.rotation, six, j, out)
        before = upto


@inlined
def _add_selected(
    layout: Layout, f: int, rotation: Array, twist: Array, column: int, out: Array
) -> None:
    """Add tip f's rows S·twist (6,) to a column of `out` (m, n)."""
    first = layout[f, FIRST]
    for i in range(layout[f, COUNT]):
        row = layout[f, ROWS + i]
        if layout[f, KIND] == POINTING and row >= 3:
            out[first + i, column] += dot(linear(rotation, row - 3), angular_part(twist))
        else:
            out[first + i, column] += twist[row]


@inlined
def turned(
    layout: Layout,
    f: int,
    jacobian: Array,
    every: Every | None,
    s: int,
    rates: Array,
    out: Array,
) -> Vector:
    """Set `out` (6,) to J̇6 q̇ of tip f, and return the tip's angular velocity.

    Where joints share coordinates, from the columns of all joints at sample s of `every`.
    """
    if every is None:
        return _turned(layout, f, jacobian, rates, out)
    return _turned_every(every[1], f, every[0][s, f], rates, out)


@inlined
def _turned(layout: Layout, f: int, jacobian: Array, rates: Array, out: Array) -> Vector:
    """Set `out` (6,) to J̇6 q̇ of tip f, and return the tip's angular velocity.

    By two running sums along the chain, see `selfmotion.model.kernels.tool`: with s_i, w_i the
    shares of joint i in the tip's velocities and W_<i the sum of w before it,

        J̇6 q̇ = Σ_i [(2 W_<i + w_i) × s_i; W_<i × w_i].
    """
    spin, v, w = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for i in range(len(rates)):
        k = layout[f, ORDER + i]
        v, w, spin = _added(linear(jacobian, k), angular(jacobian, k), rates[k], spin, v, w)
    for i in range(3):
        out[i], out[3 + i] = v[i], w[i]
    return spin


@inlined
def _turned_every(members: Ints, f: int, own: Array, rates: Array, out: Array) -> Vector:
    """Do the same for the columns `own` (6, W) of all joints, of which some share a coordinate."""
    spin, v, w, last = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), members.shape[0] - 1
    for i in range(own.shape[1]):
        j = members[f, i]
        rate = rates[members[last, j]]
        v, w, spin = _added(linear(own, j), angular(own, j), rate, spin, v, w)
    for i in range(3):
        out[i], out[3 + i] = v[i], w[i]
    return spin


@inlined
def _added(
    place: Vector, axis: Vector, rate: float, spin: Vector, v: Vector, w: Vector
) -> tuple[Vector, Vector, Vector]:
    """Return the sums v, w and W with the next joint added."""
    own = (rate * axis[0], rate * axis[1], rate * axis[2])
    twice = plus(own, 2.0, spin)
    return plus(v, rate, cross(twice, place)), plus(w, 1.0, cross(spin, own)), plus(own, 1.0, spin)


@inlined
def project(jacobian: Array, factor: Array, right: Array, direction: Array, out: Array) -> None:
    """Set `out` (n,) to p + J⁺(b - J p) for p = `direction`; b = `right` (m,) is overwritten."""
    m, n = jacobian.shape
    for i in range(m):
        for j in range(n):
            right[i] -= jacobian[i, j] * direction[j]
    solve_cholesky(factor, right)
    for j in range(n):
        out[j] = direction[j]
        for i in range(m):
            out[j] += jacobian[i, j] * right[i]


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

    From one to the next, the self-motion covers a `share` (K,) of the difference to `wanted` (n,);
    joints that are `held` (K, n) are at 0. Returns the first node that fails, or -1.
    """
    (count, n), m, tips = q.shape, rows_of(layout), layout.shape[0]
    turns, places = np.empty((chains.shape[1], 3, 3)), np.empty((chains.shape[1], 3))
    rotations, positions = np.empty((tips, 3, 3)), np.empty((tips, 3))
    jacobians = np.zeros((tips, 6, n))
    rows, factor, b = np.empty((m, n)), np.empty((m, m)), np.empty(m)
    direction, here = np.empty(n), start.copy()
    for k in range(count):
        off = np.inf
        for j in range(n):
            if held[k, j]:
                here[j] = 0.0
        for i in range(_STEPS):
            place_tips(here, chains, turns, places, rotations, positions, jacobians)
            clear_held(held[k], jacobians)
            errors_and_rows(layout, targets[k], jacobians, rotations, positions, b, rows)
            off = 0.0
            for x in range(m):
                if not abs(b[x]) <= off:
                    off = abs(b[x])
            # First Jᵀ(JJᵀ)⁻¹(e - J p) + p with p towards `wanted`, then corrections of e alone.
            for j in range(n):
                goes = i == 0 and not held[k, j]
                direction[j] = share[k] * (wanted[j] - here[j]) if goes else 0.0
            for x in range(m):
                for j in range(n):
                    b[x] -= rows[x, j] * direction[j]
            gram(rows, factor)
            if not off < np.inf or not cholesky(factor):
                return k
            solve_cholesky(factor, b)
            for j in range(n):
                here[j] += direction[j]
                for x in range(m):
                    here[j] += rows[x, j] * b[x]
            if i > 0 and off < _NEAR:
                break
        if not off < _NEAR:
            return k
        for j in range(n):
            q[k, j] = here[j]
    return -1

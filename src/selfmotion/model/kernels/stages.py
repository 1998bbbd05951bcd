"""The stages of eq. 4, compiled: forward, and backward as the exact derivative."""

from math import isfinite
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, called, inlined, kernel
from selfmotion.basics.layout import KIND, POINTING, Layout
from selfmotion.model.kernels.algebra import (
    add_angular,
    add_scaled,
    angular,
    angular_part,
    cholesky,
    cross,
    finite,
    gram,
    linear,
    plus,
    respond,
    smallest_eigenvector,
)
from selfmotion.model.kernels.table import Stage, Tip, q_of, qd_of, stage_of, tip_of, view
from selfmotion.model.kernels.tool import (
    Every,
    contract,
    contract_every,
    pose_error,
    pull_error,
    rows_of,
    select,
    task_rows,
    unselect,
)

# The threshold σ0 and the strength λ0 [m, rad].
Law = tuple[float, float]


@inlined
def damp(gram: Array, law: Law, out: Array) -> float:
    """Add λ²I to JJᵀ (its lower triangle `gram`) near singular poses; return 1 - f.

    λ² = λ0² f with f = (1 - σ²/σ0²)² where the smallest singular value σ of J is below the
    threshold σ0, exactly 0 elsewhere. `out` (3 + m,) becomes λ0², f, df/dσ² and the unit vector v
    of σ² = vᵀJJᵀv, all 0 without damping.
    """
    m = gram.shape[0]
    square = law[0] * law[0]
    for i in range(3 + m):
        out[i] = 0.0
    full, spare, trace = np.empty((m, m)), np.empty((m, m)), 0.0
    for i in range(m):
        trace += gram[i, i]
        for j in range(i + 1):
            full[i, j] = full[j, i] = spare[i, j] = gram[i, j]
        spare[i, i] -= square
    # Mostly σ > σ0, which a Cholesky factor decides faster than eigenvalues. NaN is left to the
    # factor of `gram`.
    if cholesky(spare) or not isfinite(trace):
        return 1.0
    v = view(out, 3, (m,))
    rest = 1.0 - max(smallest_eigenvector(full, spare, v), 0.0) / square
    if rest <= 0.0:
        for i in range(m):
            v[i] = 0.0
        return 1.0
    out[0], out[1], out[2] = law[1] * law[1], rest * rest, -2.0 * rest / square
    for i in range(m):
        gram[i, i] += out[0] * out[1]
    return 1.0 - rest * rest


@inlined
def damping_slope(row: Array, n: int, layout: Layout, gain: float, z: Array) -> float:
    """Return 2 df/dσ² (λ0² zᵀy + K zᵀS e): the factor of ⟨v (Jᵀv)ᵀ, ∂J⟩."""
    m = rows_of(layout)
    at, full = stage_of(row, n, m), np.empty(6)
    slope = 0.0
    for i in range(m):
        slope += at.damping[0] * z[i] * at.y[i]
    for f in range(layout.shape[0]):
        tip = tip_of(row, f, n, m)
        unselect(layout, f, tip.rotation, z, full)
        for i in range(6):
            slope += gain * full[i] * tip.error[i]
    return float(2.0 * at.damping[2] * slope)


@inlined
def pull_damping(
    at: Stage,
    tip: Tip,
    layout: Layout,
    f: int,
    factor: float,
    weights: Array,
    twist: Array,
) -> None:
    """Add `factor` ⟨v (Jᵀv)ᵀ, ∂J⟩: on J6 to `weights` (6, n), on S to `twist` (6,).

    For tip f; see `damping_slope`.
    """
    m, n = at.task_jacobian.shape
    v = view(at.damping, 3, (m,))
    left, turn = np.empty(6), (0.0, 0.0, 0.0)
    unselect(layout, f, tip.rotation, v, left)
    for k in range(n):
        right = 0.0
        for i in range(m):
            right += at.task_jacobian[i, k] * v[i]
        turn = plus(turn, right, angular(tip.jacobian, k))
        for i in range(6):
            weights[i, k] += factor * left[i] * right
    if layout[f, KIND] == POINTING:
        add_angular(twist, factor, cross(angular_part(left), turn))


@kernel
def advance(
    s: int,
    f: int,
    base_jacobian: Array,
    rotation: Array,
    translation: Array,
    table: Array,
    layout: Layout,
    gain: float,
    law: Law | None,
) -> bool:
    """Note where tip f is at stage s; after the last one evaluate eq. 4, and set the next q.

    `base_jacobian` (6, n) is that of the point at the base's origin, `rotation` and `translation`
    the tip's pose. False where the motion breaks down, see `evaluate`.
    """
    n, m, row = base_jacobian.shape[1], rows_of(layout), table[s]
    observe(base_jacobian, rotation, translation, tip_of(row, f, n, m))
    if f + 1 < layout.shape[0]:
        return True
    if not evaluate(row, n, layout, gain, law):
        return False
    step(table, s, n, stage_of(row, n, m).step[0])
    return True


@called
def evaluate(row: Array, n: int, layout: Layout, gain: float, law: Law | None) -> bool:
    """Evaluate eq. 4: q̇ = J⁺u + (I - J⁺J) ε, with u = S(ẋ_d + K e) of all tips.

    With a `law`, A = JJᵀ + λ²I is damped near singular poses, see `damp`, and the pose feedback K
    fades out as damping fades in: speeds would otherwise grow with an error that the arm cannot
    take out. False where A is not positive definite (a singular pose), or q̇ is not finite.
    """
    m = rows_of(layout)
    at = stage_of(row, n, m)
    for f in range(layout.shape[0]):
        tip = tip_of(row, f, n, m)
        task_rows(layout, f, tip.rotation, tip.jacobian, at.task_jacobian)  # J = S J6
    gram(at.task_jacobian, at.factor)  # A = JJᵀ
    if law is not None:
        gain *= damp(at.factor, law, at.damping)  # A = JJᵀ + λ²I
    for f in range(layout.shape[0]):
        tip = tip_of(row, f, n, m)
        aim(layout[f, KIND], gain, tip)  # ẋ_d + K e
        select(layout, f, tip.rotation, tip.command, at.y)  # y = u
    if not cholesky(at.factor):
        return False
    respond(at.task_jacobian, at.factor, at.y, at.epsilon, at.qd)  # y = A⁻¹(u - Jε), q̇ = Jᵀy + ε
    return finite(at.qd)


@inlined
def aim(kind: int, gain: float, tip: Tip) -> None:
    """Set a tip's pose error e, and its command ẋ_d + K e."""
    pose_error(
        kind, tip.target_translation, tip.target_rotation, tip.translation, tip.rotation, tip.error
    )
    add_scaled(tip.target_twist, gain, tip.error, tip.command)


@inlined
def observe(base_jacobian: Array, rotation: Array, translation: Array, tip: Tip) -> None:
    """Set a tip's pose and its Jacobian J6."""
    _set_pose(tip, rotation, translation)
    at_tip(base_jacobian, translation, tip.jacobian)


@inlined
def _set_pose(tip: Tip, rotation: Array, translation: Array) -> None:
    for i in range(3):
        tip.translation[i] = translation[i]
        for j in range(3):
            tip.rotation[i, j] = rotation[i, j]


@inlined
def at_tip(base_jacobian: Array, translation: Array, out: Array) -> None:
    """Set `out` (6, n) to the Jacobian of the tip's origin x: v = v_0 + ω × x."""
    x = (translation[0], translation[1], translation[2])
    for k in range(out.shape[1]):
        turning = angular(base_jacobian, k)
        v = plus(linear(base_jacobian, k), 1.0, cross(turning, x))
        out[0, k], out[1, k], out[2, k] = v
        out[3, k], out[4, k], out[5, k] = turning


@inlined
def step(table: Array, s: int, n: int, h: float) -> None:
    """Set q of stage s + 1 from the slopes so far (classical fourth-order Runge-Kutta).

    Stages come four to a step, then one for the end.
    """
    if s + 1 == table.shape[0]:
        return
    i = s % 4
    start, slope, q = q_of(table, s - i, n), qd_of(table, s, n), q_of(table, s + 1, n)
    if i < 3:
        add_scaled(start, h if i == 2 else 0.5 * h, slope, q)
    else:
        first, second = qd_of(table, s - 3, n), qd_of(table, s - 2, n)
        third = qd_of(table, s - 1, n)
        for k in range(n):
            q[k] = start[k] + h / 6.0 * (first[k] + 2.0 * (second[k] + third[k]) + slope[k])


class Space(NamedTuple):
    """Work space of the kernels here, as views of one array.

    Attributes
    ----------
    w : (n,)
        The cotangent of q̇.
    z : (m,)
        -A⁻¹Jw.
    full_y, full_z : (6,)
        Sᵀy and Sᵀz of a tip.
    by_error, twist : (6,)
        Cotangents of its pose error and of its twist.
    weights : (6, n)
        M, of which ⟨M, ∂J6⟩ is taken.
    by_epsilon, by_q : (n,), (n,)
        Results of a stage's pullback.
    by_slope : (4, n)
        The last four of `by_q`.
    """

    w: Array
    z: Array
    full_y: Array
    full_z: Array
    by_error: Array
    twist: Array
    weights: Array
    by_epsilon: Array
    by_q: Array
    by_slope: Array


@inlined
def space_of(space: Array, n: int, m: int) -> Space:
    """Return the parts of the array to work in, for n joints and m rows."""
    return Space(
        w=view(space, 0, (n,)),
        z=view(space, n, (m,)),
        full_y=view(space, n + m, (6,)),
        full_z=view(space, n + m + 6, (6,)),
        by_error=view(space, n + m + 12, (6,)),
        twist=view(space, n + m + 18, (6,)),
        weights=view(space, n + m + 24, (6, n)),
        by_epsilon=view(space, 7 * n + m + 24, (n,)),
        by_q=view(space, 8 * n + m + 24, (n,)),
        by_slope=view(space, 9 * n + m + 24, (4, n)),
    )


def space_size(n: int, m: int) -> int:
    """Return the length of the work space."""
    return 13 * n + m + 24


@called
def pull_stage(
    row: Array,
    n: int,
    layout: Layout,
    gain: float,
    law: Law | None,
    every: Every | None,
    s: int,
    space: Space,
    error_bar: Array,
    epsilon_bar: Array,
) -> None:
    """Pull the cotangents `space.w` on q̇ and ē (F, 6) on the pose errors back.

    To ε (set) and q (added to `space.by_q`). z = -A⁻¹Jw and ε̄ = w + Jᵀz are eq. 4 itself, for
    ε = w and u = 0; q̄ = ⟨y ε̄ᵀ + z q̇ᵀ, ∂J/∂q⟩ + (ēᵀ - zᵀS K) ∂e/∂q, and where the angular rows are
    in tool axes, -zᵀ ∂S u. Damping adds (λ0² zᵀy + K zᵀS e) ∂f, see `pull_damping`; K is (1 - f)
    times the `gain`. Stage s of `every` has the columns of all joints where some mimic others.
    """
    m = rows_of(layout)
    at = stage_of(row, n, m)
    for i in range(m):
        space.z[i] = 0.0
    respond(at.task_jacobian, at.factor, space.z, space.w, epsilon_bar)
    fade = 0.0 if law is None else at.damping[1]
    slope = 0.0
    if law is not None and fade > 0.0:
        slope = damping_slope(row, n, layout, gain, space.z)
    for f in range(layout.shape[0]):
        tip = tip_of(row, f, n, m)
        unselect(layout, f, tip.rotation, at.y, space.full_y)
        unselect(layout, f, tip.rotation, space.z, space.full_z)
        for i in range(6):
            for k in range(n):
                space.weights[i, k] = space.full_y[i] * epsilon_bar[k] + space.full_z[i] * at.qd[k]
            space.by_error[i] = error_bar[f, i] - (1.0 - fade) * gain * space.full_z[i]
        # Everything but ∂J6 acts through the tip's own twist J6 ∂q.
        pull_error(
            layout[f, KIND],
            tip.error,
            tip.rotation,
            tip.target_rotation,
            space.by_error,
            space.twist,
        )
        if layout[f, KIND] == POINTING:
            pull_axes(at, tip, epsilon_bar, space)
        if law is not None and fade > 0.0:
            pull_damping(at, tip, layout, f, slope, space.weights, space.twist)
        if every is None:
            contract(layout, f, tip.jacobian, space.weights, space.twist, space.by_q)
        else:
            own = every[0][s, f]
            contract_every(every[1], f, own, space.weights, space.twist, space.by_q)


@inlined
def pull_axes(at: Stage, tip: Tip, epsilon_bar: Array, space: Space) -> None:
    """Add what turning the tip's axes, ∂S, does to J and u, to the twist's cotangent."""
    by_y, by_z = (0.0, 0.0, 0.0), angular_part(tip.command)
    by_z = -by_z[0], -by_z[1], -by_z[2]
    for k in range(epsilon_bar.shape[0]):
        turning = angular(tip.jacobian, k)
        by_y = plus(by_y, epsilon_bar[k], turning)
        by_z = plus(by_z, at.qd[k], turning)
    add_angular(space.twist, 1.0, cross(angular_part(space.full_y), by_y))
    add_angular(space.twist, 1.0, cross(angular_part(space.full_z), by_z))


@kernel
def pullback(
    q_cotangent: Array,
    qd_cotangent: Array,
    error_cotangent: Array,
    table: Array,
    layout: Layout,
    gain: float,
    law: Law | None,
    every: Every | None,
    work: Array,
    epsilon_bar: Array,
    start_bar: Array,
) -> None:
    """Reverse the Runge-Kutta recursion: cotangents on all stages → start (n,).

    Sets those of ε (S, n) and of the start (n,), see `pull_stage`.

    A stage's slope acts on the later stages of its step and on the step's end.
    """
    (count, n), m = q_cotangent.shape, rows_of(layout)
    space = space_of(work, n, m)
    by_slope = space.by_slope
    for s in range(count - 1, -1, -1):
        at = stage_of(table[s], n, m)
        i, h, last = s % 4, at.step[0], s == count - 1
        for k in range(n):
            w = qd_cotangent[s, k]
            if not last:
                w += start_bar[k] * h / (6.0 if i in (0, 3) else 3.0)
                if i < 3:
                    w += by_slope[i + 1, k] * (h if i == 2 else 0.5 * h)
            space.w[k] = w
            space.by_q[k] = q_cotangent[s, k]
        cotangents = error_cotangent[s], epsilon_bar[s]
        pull_stage(table[s], n, layout, gain, law, every, s, space, *cotangents)
        for k in range(n):
            by_slope[i, k] = space.by_q[k]
            if last:
                start_bar[k] = space.by_q[k]
            elif i == 0:
                start_bar[k] += by_slope[0, k] + by_slope[1, k] + by_slope[2, k] + by_slope[3, k]


@kernel
def sensitivities(
    table: Array,
    layout: Layout,
    gain: float,
    law: Law | None,
    every: Every | None,
    work: Array,
    no_error: Array,
    epsilon_matrix: Array,
    start_matrix: Array,
    q_matrix: Array,
    qd_matrix: Array,
) -> None:
    """Set ∂q/∂x and ∂q̇/∂x at all stages, (S, n, d).

    For ∂ε/∂x = `epsilon_matrix` (S, n, d) and ∂q(0)/∂x = `start_matrix` (n, d).

    The tangent of the Runge-Kutta recursion: ∂q̇ = (I - J⁺J) ∂ε + (∂q̇/∂q) ∂q at every stage. The
    rows of the matrices are pullbacks of the unit vectors.
    """
    count, n, d = epsilon_matrix.shape
    m = rows_of(layout)
    space = space_of(work, n, m)
    for j in range(n):
        for x in range(d):
            q_matrix[0, j, x] = start_matrix[j, x]
    for s in range(count):
        at = stage_of(table[s], n, m)
        for j in range(n):
            for k in range(n):
                space.w[k], space.by_q[k] = (1.0 if k == j else 0.0), 0.0
            cotangents = no_error, space.by_epsilon
            pull_stage(table[s], n, layout, gain, law, every, s, space, *cotangents)
            # Along x inside: neighbours in memory, several at once.
            slope = qd_matrix[s, j]
            slope[:] = 0.0
            for k in range(n):
                for x in range(d):
                    slope[x] += space.by_epsilon[k] * epsilon_matrix[s, k, x]
                for x in range(d):
                    slope[x] += space.by_q[k] * q_matrix[s, k, x]
        if s + 1 < count:
            step_matrix(q_matrix, qd_matrix, s, at.step[0])


@inlined
def step_matrix(q_matrix: Array, qd_matrix: Array, s: int, h: float) -> None:
    """Set ∂q/∂x of stage s + 1 from the slopes so far, as `step` does with q."""
    i = s % 4
    share = h / 6.0 if i == 3 else (h if i == 2 else 0.5 * h)
    for j in range(q_matrix.shape[1]):
        for x in range(q_matrix.shape[2]):
            slope = qd_matrix[s, j, x]
            if i == 3:
                slope += qd_matrix[s - 3, j, x]
                slope += 2.0 * (qd_matrix[s - 2, j, x] + qd_matrix[s - 1, j, x])
            q_matrix[s + 1, j, x] = q_matrix[s - i, j, x] + share * slope


@inlined
def evaluate_motion(
    q: Array, row: Array, layout: Layout, rotations: Array, positions: Array, jacobians: Array
) -> bool:
    """Set q, all tips and q̇ of a row whose J, factor of JJᵀ and ε are set; whether q̇ is finite."""
    n, m = len(q), rows_of(layout)
    at = stage_of(row, n, m)
    for j in range(n):
        at.q[j] = q[j]
    for f in range(layout.shape[0]):
        tip = tip_of(row, f, n, m)
        _write_tip(tip, rotations[f], positions[f], jacobians[f])
        select(layout, f, tip.rotation, tip.command, at.y)
    respond(at.task_jacobian, at.factor, at.y, at.epsilon, at.qd)
    return finite(at.qd)


@inlined
def _write_tip(tip: Tip, turn: Array, place: Array, six: Array) -> None:
    """Write a tip's pose and Jacobian into the table; its command is its path's twist."""
    _set_pose(tip, turn, place)
    for i in range(6):
        tip.command[i] = tip.target_twist[i]
        for j in range(six.shape[1]):
            tip.jacobian[i, j] = six[i, j]

"""All stages of eq. 4 backward: the exact derivative of the discrete scheme."""

from typing import NamedTuple

from selfmotion.basics import Array, called, inlined, kernel
from selfmotion.basics.layout import KIND, POINTING, Layout
from selfmotion.kernels.algebra import add_angular, angular, angular_part, cross, plus, respond
from selfmotion.kernels.contraction import Every, contract, contract_every
from selfmotion.kernels.damping import Law, damping_slope, pull_damping
from selfmotion.kernels.table import Stage, Tip, stage_of, tip_of, view
from selfmotion.kernels.tool import pull_error, rows_of, unselect


class Space(NamedTuple):
    """What the kernels here work in, as views of one array.

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
        What a stage's pullback gives.
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
    """Return how long the array to work in is."""
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

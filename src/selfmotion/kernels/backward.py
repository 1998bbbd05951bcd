"""All stages of eq. 4 backward: the exact derivative of the discrete scheme."""

from typing import NamedTuple

import numpy as np

from selfmotion.arrays import Array
from selfmotion.jit import inlined, kernel
from selfmotion.kernels.algebra import add_angular, angular, angular_part, cross, plus, respond
from selfmotion.kernels.contraction import contract
from selfmotion.kernels.damping import Law, pull_damping
from selfmotion.kernels.table import Stage, stage
from selfmotion.kernels.tool import NO_ANGLE, POINTING, Rows, pull_error, unselect


class Space(NamedTuple):
    """What `pull_stage` works in, kept from stage to stage: vectors by their own length.

    z (m,); Sᵀy and Sᵀz (6,); cotangents of the pose error and of the tool's twist (6,); M (6, n).
    """

    z: Array
    full_y: Array
    full_z: Array
    by_error: Array
    twist: Array
    weights: Array


@inlined
def workspace(n: int, m: int) -> Space:
    """Return the workspace for n joints and m rows."""
    return Space(
        np.empty(m), np.empty(6), np.empty(6), np.empty(6), np.empty(6), np.empty((6, n))
    )


@inlined
def pull_stage(
    w: Array,
    at: Stage,
    rows: Rows,
    angle_kind: int,
    gain: float,
    law: Law | None,
    error_bar: Array,
    epsilon_bar: Array,
    q_bar: Array,
    target_bar: Array,
    space: Space,
) -> None:
    """Pull the cotangents w (n,) on q̇ and ē (6,) on the pose error back.

    To ε (set), q (added) and the path (set): z = -A⁻¹Jw, ε̄ = w + Jᵀz (eq. 4 itself, for ε = w and
    u = 0), q̄ = ⟨y ε̄ᵀ + z q̇ᵀ, ∂J/∂q⟩ + (ēᵀ - zᵀS K) ∂e/∂q, and where the angular rows are in tool
    axes, -zᵀ ∂S u. Damping adds (λ0² zᵀy + K zᵀS e) ∂f, see `pull_damping`; K is (1 - f) times the
    `gain`. The path's cotangent (12,) is that of its pose [m, rad], then -Sᵀz of its twist.
    """
    n, m = w.shape[0], rows.shape[0]
    pointing = angle_kind == POINTING
    for i in range(m):
        space.z[i] = 0.0
    respond(at.task_jacobian, at.factor, space.z, w, epsilon_bar)
    unselect(rows, pointing, at.rotation, at.y, space.full_y)
    unselect(rows, pointing, at.rotation, space.z, space.full_z)
    for i in range(6):
        for k in range(n):
            space.weights[i, k] = (
                space.full_y[i] * epsilon_bar[k] + space.full_z[i] * at.qd[k]
            )
    fade = 0.0 if law is None else at.damping[1]
    for i in range(6):
        space.by_error[i] = error_bar[i] - (1.0 - fade) * gain * space.full_z[i]
    # Everything but ∂J6 acts through the tool's own twist J6 ∂q.
    pull_error(
        angle_kind, at.error, at.rotation, at.target_rotation, space.by_error, space.twist
    )
    # Moved together, target and tool turn the error with them: ∂e = ω × e.
    for i in range(6):
        target_bar[i], target_bar[6 + i] = -space.twist[i], -space.full_z[i]
    if angle_kind != NO_ANGLE:
        turned = cross(angular_part(at.error), angular_part(space.by_error))
        add_angular(target_bar, 1.0, turned)
    if pointing:
        pull_axes(at, epsilon_bar, space)
    if law is not None and fade > 0.0:
        pull_damping(
            at, rows, pointing, gain, space.z, space.full_z, space.weights, space.twist
        )
    contract(at.jacobian, space.weights, space.twist, q_bar)


@inlined
def pull_axes(at: Stage, epsilon_bar: Array, space: Space) -> None:
    """Add what turning the tool's axes, ∂S, does to J and u, to the twist's cotangent."""
    by_y, by_z = (0.0, 0.0, 0.0), angular_part(at.command)
    by_z = -by_z[0], -by_z[1], -by_z[2]
    for k in range(epsilon_bar.shape[0]):
        turning = angular(at.jacobian, k)
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
    rows: Rows,
    angle_kind: int,
    gain: float,
    law: Law | None,
    epsilon_bar: Array,
    target_bar: Array,
) -> Array:
    """Reverse the Runge-Kutta recursion: cotangents on all stages → start (n,).

    Sets those of ε (S, n) and of the path (S, 12), see `pull_stage`.

    A stage's slope acts on the later stages of its step and on the step's end.
    """
    count, n = q_cotangent.shape
    m = rows.shape[0]
    space = workspace(n, m)
    state, q_bar, slope, chi = np.zeros(n), np.zeros(n), np.empty(n), np.zeros((4, n))
    for s in range(count - 1, -1, -1):
        at = stage(table[s], n, m)
        i, h, last = s % 4, at.step[0], s == count - 1
        for k in range(n):
            slope[k] = qd_cotangent[s, k]
            if not last:
                slope[k] += state[k] * h / (6.0 if i in (0, 3) else 3.0)
                if i < 3:
                    slope[k] += chi[i + 1, k] * (h if i == 2 else 0.5 * h)
            q_bar[k] = q_cotangent[s, k]
        pull_stage(
            slope,
            at,
            rows,
            angle_kind,
            gain,
            law,
            error_cotangent[s],
            epsilon_bar[s],
            q_bar,
            target_bar[s],
            space,
        )
        for k in range(n):
            chi[i, k] = q_bar[k]
            if last:
                state[k] = q_bar[k]
            elif i == 0:
                state[k] += chi[0, k] + chi[1, k] + chi[2, k] + chi[3, k]
    return state


@kernel
def sensitivities(
    table: Array,
    rows: Rows,
    angle_kind: int,
    gain: float,
    law: Law | None,
    epsilon_matrix: Array,
    start_matrix: Array,
    target_matrix: Array | None,
    q_matrix: Array,
    qd_matrix: Array,
) -> None:
    """Set ∂q/∂x and ∂q̇/∂x at all stages, (S, n, d).

    For ∂ε/∂x = `epsilon_matrix` (S, n, d), ∂q(0)/∂x = `start_matrix` (n, d) and that of the path's
    poses and twists, `target_matrix` (S, 12, d), or None where the path is fixed.

    The tangent of the Runge-Kutta recursion: ∂q̇ = (I - J⁺J) ∂ε + (∂q̇/∂q) ∂q + (∂q̇/∂path) ∂path
    at every stage. The rows of the matrices are pullbacks of the unit vectors.
    """
    count, n, d = epsilon_matrix.shape
    m = rows.shape[0]
    space, no_error, unit = workspace(n, m), np.zeros(6), np.zeros(n)
    by_epsilon, by_q, by_target = np.empty(n), np.empty(n), np.empty(12)
    for j in range(n):
        for x in range(d):
            q_matrix[0, j, x] = start_matrix[j, x]
    for s in range(count):
        at = stage(table[s], n, m)
        now, slope = q_matrix[s], qd_matrix[s]
        for j in range(n):
            for k in range(n):
                unit[k], by_q[k] = 1.0 if k == j else 0.0, 0.0
            pull_stage(
                unit,
                at,
                rows,
                angle_kind,
                gain,
                law,
                no_error,
                by_epsilon,
                by_q,
                by_target,
                space,
            )
            for x in range(d):
                slope[j, x] = 0.0
            for k in range(n):
                for x in range(d):
                    slope[j, x] += by_epsilon[k] * epsilon_matrix[s, k, x] + by_q[k] * now[k, x]
            if target_matrix is not None:
                for k in range(12):
                    for x in range(d):
                        slope[j, x] += by_target[k] * target_matrix[s, k, x]
        if s + 1 < count:
            i, h = s % 4, at.step[0]
            for j in range(n):
                for x in range(d):
                    total = slope[j, x]
                    if i == 3:
                        total += qd_matrix[s - 3, j, x]
                        total += 2.0 * (qd_matrix[s - 2, j, x] + qd_matrix[s - 1, j, x])
                    share = h / 6.0 if i == 3 else (h if i == 2 else 0.5 * h)
                    q_matrix[s + 1, j, x] = q_matrix[s - i, j, x] + share * total

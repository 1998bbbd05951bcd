"""All stages of eq. 4 backward: the exact derivative of the discrete scheme."""

import numpy as np

from selfmotion.basics import Array, kernel
from selfmotion.kernels.algebra import (
    NO_ANGLE,
    POINTING,
    Rows,
    add_cross,
    contract,
    pull_error,
    solve_cholesky,
    unselect,
)
from selfmotion.kernels.table import layout


@kernel
def pull_stage(
    w: Array,
    row: Array,
    rows: Rows,
    angle_kind: int,
    gain: float,
    error_bar: Array,
    epsilon_bar: Array,
    q_bar: Array,
    target_bar: Array,
) -> None:
    """Pull the cotangents w (n,) on q̇ and ē (6,) on the pose error back.

    To ε (set), q (added) and the path (set): z = A⁻¹Jw,  ε̄ = w - Jᵀz,
    q̄ = ⟨y ε̄ᵀ - z q̇ᵀ, ∂J/∂q⟩ + (zᵀS K + ēᵀ) ∂e/∂q, and where the angular rows are in tool axes,
    zᵀ ∂S u. Damping adds -(λ0² zᵀy + K zᵀS e) ∂f, see `damp`, with ∂f = df/dσ² 2 ⟨v (Jᵀv)ᵀ, ∂J⟩;
    K is (1 - f) times the `gain`. The path's cotangent (12,) is that of its pose [m, rad], then
    Sᵀz of its twist.
    """
    n, m = w.shape[0], rows.shape[0]
    at = layout(n, m)
    qd = row[at.qd : at.qd + n]
    target_rotation = row[at.target_rotation : at.target_rotation + 9].reshape(3, 3)
    target_twist = row[at.target_twist : at.target_twist + 6]
    rotation = row[at.rotation : at.rotation + 9].reshape(3, 3)
    error = row[at.error : at.error + 6]
    jacobian = row[at.jacobian : at.jacobian + 6 * n].reshape(6, n)
    task_jacobian = row[at.task_jacobian : at.task_jacobian + m * n].reshape(m, n)
    factor = row[at.factor : at.factor + m * m].reshape(m, m)
    y = row[at.y : at.y + m]
    pointing = angle_kind == POINTING

    z = np.zeros(m)
    for i in range(m):
        for k in range(n):
            z[i] += task_jacobian[i, k] * w[k]
    solve_cholesky(factor, z)
    for k in range(n):
        total = w[k]
        for i in range(m):
            total -= task_jacobian[i, k] * z[i]
        epsilon_bar[k] = total

    full_y, full_z = np.empty(6), np.empty(6)
    unselect(rows, pointing, rotation, y, full_y)
    unselect(rows, pointing, rotation, z, full_z)
    weights = np.empty((6, n))
    for i in range(6):
        for k in range(n):
            weights[i, k] = full_y[i] * epsilon_bar[k] - full_z[i] * qd[k]
    # Everything but ∂J6 acts through the tool's own twist J6 ∂q.
    twist_bar = np.zeros(6)
    fade = row[at.damping + 1]
    if fade > 0.0:
        _pull_damping(row, rows, pointing, gain, z, full_z, weights, twist_bar)
        gain *= 1.0 - fade
    contract(jacobian, weights, q_bar)
    by_error, by_twist = gain * full_z + error_bar, np.zeros(6)
    pull_error(angle_kind, error, rotation, target_rotation, by_error, by_twist)
    # Moved together, target and tool turn the error with them: ∂e = ω × e.
    for i in range(6):
        twist_bar[i] += by_twist[i]
        target_bar[i] = -by_twist[i]
        target_bar[6 + i] = full_z[i]
    if angle_kind != NO_ANGLE:
        add_cross(error[3], error[4], error[5], by_error[3:], target_bar[3:6])
    if pointing:
        first, second = np.zeros(3), np.zeros(3)
        for i in range(3):
            second[i] = -(target_twist[3 + i] + gain * error[3 + i])
            for k in range(n):
                first[i] += jacobian[3 + i, k] * epsilon_bar[k]
                second[i] += jacobian[3 + i, k] * qd[k]
        add_cross(full_y[3], full_y[4], full_y[5], first, twist_bar[3:])
        add_cross(-full_z[3], -full_z[4], -full_z[5], second, twist_bar[3:])
    for k in range(n):
        for i in range(6):
            q_bar[k] += jacobian[i, k] * twist_bar[i]


@kernel
def _pull_damping(
    row: Array,
    rows: Rows,
    pointing: bool,
    gain: float,
    z: Array,
    full_z: Array,
    weights: Array,
    twist_bar: Array,
) -> None:
    """Add what -(λ0² zᵀy + K zᵀS e) ∂f leaves: on J6 to `weights` (6, n), on S to `twist_bar`."""
    n, m = weights.shape[1], rows.shape[0]
    at = layout(n, m)
    rotation = row[at.rotation : at.rotation + 9].reshape(3, 3)
    error = row[at.error : at.error + 6]
    jacobian = row[at.jacobian : at.jacobian + 6 * n].reshape(6, n)
    task_jacobian = row[at.task_jacobian : at.task_jacobian + m * n].reshape(m, n)
    y = row[at.y : at.y + m]
    strength, by_square = row[at.damping], row[at.damping + 2]
    v = row[at.damping + 3 : at.columns]
    slope = 0.0
    for i in range(m):
        slope += strength * z[i] * y[i]
    for i in range(6):
        slope += gain * full_z[i] * error[i]
    factor = -2.0 * by_square * slope
    left, right, turn = np.empty(6), np.zeros(n), np.zeros(3)
    unselect(rows, pointing, rotation, v, left)
    for k in range(n):
        for i in range(m):
            right[k] += task_jacobian[i, k] * v[i]
        for i in range(3):
            turn[i] += jacobian[3 + i, k] * right[k]
        for i in range(6):
            weights[i, k] += factor * left[i] * right[k]
    if pointing:
        add_cross(factor * left[3], factor * left[4], factor * left[5], turn, twist_bar[3:])


@kernel
def pullback(
    q_cotangent: Array,
    qd_cotangent: Array,
    error_cotangent: Array,
    table: Array,
    rows: Rows,
    angle_kind: int,
    gain: float,
    epsilon_bar: Array,
    target_bar: Array,
) -> Array:
    """Reverse the Runge-Kutta recursion: cotangents on all stages → start (n,).

    Sets those of ε (S, n) and of the path (S, 12), see `pull_stage`.

    A stage's slope acts on the later stages of its step and on the step's end.
    """
    stages, n = q_cotangent.shape
    step = layout(n, rows.shape[0]).step
    state, q_bar = np.zeros(n), np.zeros(n)
    chi, slope = np.zeros((4, n)), np.empty(n)
    for s in range(stages - 1, -1, -1):
        i, h = s % 4, table[s, step]
        last = s == stages - 1
        for k in range(n):
            slope[k] = qd_cotangent[s, k]
            if not last:
                slope[k] += state[k] * h / (6.0 if i in (0, 3) else 3.0)
                if i < 3:
                    slope[k] += chi[i + 1, k] * (h if i == 2 else 0.5 * h)
            q_bar[k] = q_cotangent[s, k]
        pull_stage(
            slope,
            table[s],
            rows,
            angle_kind,
            gain,
            error_cotangent[s],
            epsilon_bar[s],
            q_bar,
            target_bar[s],
        )
        chi[i] = q_bar
        if last:
            state[:] = q_bar
        elif i == 0:
            for k in range(n):
                state[k] += chi[0, k] + chi[1, k] + chi[2, k] + chi[3, k]
    return state


@kernel
def sensitivities(
    table: Array,
    rows: Rows,
    angle_kind: int,
    gain: float,
    epsilon_matrix: Array,
    start_matrix: Array,
    target_matrix: Array,
    q_matrix: Array,
    qd_matrix: Array,
) -> None:
    """Set ∂q/∂x and ∂q̇/∂x at all stages, (S, n, d).

    For ∂ε/∂x = `epsilon_matrix` (S, n, d), ∂q(0)/∂x = `start_matrix` (n, d) and that of the path's
    poses and twists, `target_matrix` (S, 12, d), or (0, 12, d) where the path is fixed.

    The tangent of the Runge-Kutta recursion: ∂q̇ = (I - J⁺J) ∂ε + (∂q̇/∂q) ∂q + (∂q̇/∂path) ∂path
    at every stage. The rows of the matrices are pullbacks of the unit vectors.
    """
    stages, n = epsilon_matrix.shape[:2]
    step = layout(n, rows.shape[0]).step
    projector, slope_by_q, unit = np.empty((n, n)), np.empty((n, n)), np.zeros(n)
    slope_by_target = np.empty((n, 12))
    no_error = np.zeros(6)
    state, now = start_matrix.copy(), start_matrix.copy()
    for s in range(stages):
        for k in range(n):
            unit[k] = 1.0
            slope_by_q[k] = 0.0
            pull_stage(
                unit,
                table[s],
                rows,
                angle_kind,
                gain,
                no_error,
                projector[k],
                slope_by_q[k],
                slope_by_target[k],
            )
            unit[k] = 0.0
        slope = projector @ epsilon_matrix[s] + slope_by_q @ now
        if len(target_matrix) > 0:
            slope += slope_by_target @ target_matrix[s]
        q_matrix[s], qd_matrix[s] = now, slope
        i, h = s % 4, table[s, step]
        if i == 3:
            before = qd_matrix[s - 3] + 2.0 * (qd_matrix[s - 2] + qd_matrix[s - 1])
            state += h / 6.0 * (before + slope)
            now[:] = state
        else:
            now[:] = state + (h if i == 2 else 0.5 * h) * slope

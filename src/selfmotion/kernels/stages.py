"""One stage of eq. 4 forward, and all stages backward, on one table with a row per stage.

A call from Python costs as much per array argument as a good part of the arithmetic, hence one
table in place of a dozen. `layout` says which columns hold what; `Rollout` makes views of them.
"""

import numpy as np
import numpy.typing as npt

from selfmotion.arrays import Array
from selfmotion.jit import kernel
from selfmotion.kernels.algebra import (
    LOGARITHM,
    NO_ANGLE,
    POINTING,
    add_cross,
    cholesky,
    contract,
    damp,
    pointing_error,
    pull_error,
    rotation_error,
    select,
    solve_cholesky,
    unselect,
)

Rows = npt.NDArray[np.intp]
Layout = tuple[int, int, int, int, int, int, int, int, int, int, int, int, int, int, int, int]


@kernel
def layout(n: int, m: int) -> Layout:
    """Return the first column of each part of a stage's row, and the number of columns.

    q, q̇, ε (n each); the path's translation (3), rotation (9) and twist (6); the step length (1);
    the tool's translation (3) and rotation (9); its pose error (6); J6 (6n); J (mn); L (mm); y (m);
    the damping: λ0², f, df/dσ² and v (3 + m), see `damp`.
    """
    q = 0
    qd = q + n
    epsilon = qd + n
    target_translation = epsilon + n
    target_rotation = target_translation + 3
    target_twist = target_rotation + 9
    step = target_twist + 6
    translation = step + 1
    rotation = translation + 3
    error = rotation + 9
    jacobian = error + 6
    task_jacobian = jacobian + 6 * n
    factor = task_jacobian + m * n
    y = factor + m * m
    damping = y + m
    return (
        q,
        qd,
        epsilon,
        target_translation,
        target_rotation,
        target_twist,
        step,
        translation,
        rotation,
        error,
        jacobian,
        task_jacobian,
        factor,
        y,
        damping,
        damping + 3 + m,
    )


@kernel
def evaluate(
    s: int,
    frame_jacobian: Array,
    frame_rotation: Array,
    frame_translation: Array,
    table: Array,
    rows: Rows,
    angle_kind: int,
    gain: float,
    threshold: float,
    strength: float,
) -> bool:
    """Evaluate eq. 4 at stage s: q̇ = J⁺u + (I - J⁺J) ε.

    With a `threshold` σ0 > 0, A = JJᵀ + λ²I is damped near singular poses, see `damp`, and the pose
    feedback K fades out as damping fades in: speeds would otherwise grow with an error that the arm
    cannot take out there. False where A is not positive definite (a singular pose, or NaN).
    """
    n, m = frame_jacobian.shape[1], rows.shape[0]
    at = layout(n, m)
    row = table[s]
    epsilon = row[at[2] : at[2] + n]
    target_rotation = row[at[4] : at[4] + 9].reshape(3, 3)
    translation = row[at[7] : at[7] + 3]
    rotation = row[at[8] : at[8] + 9].reshape(3, 3)
    error = row[at[9] : at[9] + 6]
    jacobian = row[at[10] : at[10] + 6 * n].reshape(6, n)
    task_jacobian = row[at[11] : at[11] + m * n].reshape(m, n)
    factor = row[at[12] : at[12] + m * m].reshape(m, m)
    y = row[at[13] : at[13] + m]
    pointing = angle_kind == POINTING

    jacobian[:] = frame_jacobian
    rotation[:] = frame_rotation
    translation[:] = frame_translation
    for i in range(3):
        error[i] = row[at[3] + i] - translation[i]
    if angle_kind == LOGARITHM:
        rotation_error(target_rotation, rotation, error[3:])
    elif pointing:
        pointing_error(target_rotation, rotation, error[3:])

    for k in range(n):
        select(rows, pointing, rotation, jacobian[:, k], task_jacobian[:, k])
    for i in range(m):
        for j in range(i + 1):
            total = 0.0
            for k in range(n):
                total += task_jacobian[i, k] * task_jacobian[j, k]
            factor[i, j] = total
    if threshold > 0.0:
        damp(factor, threshold, strength, row[at[14] : at[15]])
        gain *= 1.0 - row[at[14] + 1]
    # u = S(ẋ_d + K e), then y = A⁻¹(u - Jε)
    command = np.empty(6)
    for i in range(6):
        command[i] = row[at[5] + i] + gain * error[i]
    select(rows, pointing, rotation, command, y)
    for i in range(m):
        for k in range(n):
            y[i] -= task_jacobian[i, k] * epsilon[k]
    if not cholesky(factor):
        return False
    solve_cholesky(factor, y)
    for k in range(n):
        total = epsilon[k]
        for i in range(m):
            total += task_jacobian[i, k] * y[i]
        row[at[1] + k] = total
    return True


@kernel
def advance(
    s: int,
    frame_jacobian: Array,
    frame_rotation: Array,
    frame_translation: Array,
    table: Array,
    rows: Rows,
    angle_kind: int,
    gain: float,
    threshold: float,
    strength: float,
) -> bool:
    """Evaluate eq. 4 at stage s and set the next stage's q; see `evaluate`.

    Stages come four to a step, then one for the end.
    """
    n, m = frame_jacobian.shape[1], rows.shape[0]
    sound = evaluate(
        s,
        frame_jacobian,
        frame_rotation,
        frame_translation,
        table,
        rows,
        angle_kind,
        gain,
        threshold,
        strength,
    )
    if sound and s + 1 < table.shape[0]:
        _step(table, s, n, table[s, layout(n, m)[6]])
    return sound


@kernel
def newton_step(row: Array, n: int, rows: Rows, angle_kind: int) -> Array:
    """Return J⁺S e, the smallest correction of q that takes out the pose error e to first order."""
    m = rows.shape[0]
    at = layout(n, m)
    rotation = row[at[8] : at[8] + 9].reshape(3, 3)
    task_jacobian = row[at[11] : at[11] + m * n].reshape(m, n)
    factor = row[at[12] : at[12] + m * m].reshape(m, m)
    z = np.empty(m)
    select(rows, angle_kind == POINTING, rotation, row[at[9] : at[9] + 6], z)
    solve_cholesky(factor, z)
    correction = np.zeros(n)
    for i in range(m):
        for k in range(n):
            correction[k] += task_jacobian[i, k] * z[i]
    return correction


@kernel
def _step(table: Array, s: int, n: int, h: float) -> None:
    """Set q of stage s + 1 from the slopes so far (classical fourth-order Runge-Kutta)."""
    first, i = s - s % 4, s % 4
    for k in range(n):
        q, slope = table[first, k], table[s, n + k]
        if i == 3:
            slope += table[first, n + k] + 2.0 * (table[first + 1, n + k] + table[s - 1, n + k])
            table[s + 1, k] = q + h / 6.0 * slope
        else:
            table[s + 1, k] = q + (h if i == 2 else 0.5 * h) * slope


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
    qd = row[at[1] : at[1] + n]
    target_rotation = row[at[4] : at[4] + 9].reshape(3, 3)
    rotation = row[at[8] : at[8] + 9].reshape(3, 3)
    error = row[at[9] : at[9] + 6]
    jacobian = row[at[10] : at[10] + 6 * n].reshape(6, n)
    task_jacobian = row[at[11] : at[11] + m * n].reshape(m, n)
    factor = row[at[12] : at[12] + m * m].reshape(m, m)
    y = row[at[13] : at[13] + m]
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
    fade = row[at[14] + 1]
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
            second[i] = -(row[at[5] + 3 + i] + gain * error[3 + i])
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
    rotation = row[at[8] : at[8] + 9].reshape(3, 3)
    jacobian = row[at[10] : at[10] + 6 * n].reshape(6, n)
    task_jacobian = row[at[11] : at[11] + m * n].reshape(m, n)
    y, v = row[at[13] : at[13] + m], row[at[14] + 3 : at[15]]
    slope = 0.0
    for i in range(m):
        slope += row[at[14]] * z[i] * y[i]
    for i in range(6):
        slope += gain * full_z[i] * row[at[9] + i]
    factor = -2.0 * row[at[14] + 2] * slope
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
    step = layout(n, rows.shape[0])[6]
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
    step = layout(n, rows.shape[0])[6]
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

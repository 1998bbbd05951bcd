"""One stage of eq. 4 forward."""

import numpy as np

from selfmotion.basics import Array, kernel
from selfmotion.kernels.algebra import (
    LOGARITHM,
    POINTING,
    Rows,
    cholesky,
    damp,
    pointing_error,
    rotation_error,
    select,
    solve_cholesky,
)
from selfmotion.kernels.table import layout


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
    cannot take out t False where A is not positive definite (a singular pose, or NaN).
    """
    n, m = frame_jacobian.shape[1], rows.shape[0]
    row = table[s]
    at = layout(n, m)
    epsilon = row[at.epsilon : at.epsilon + n]
    target_rotation = row[at.target_rotation : at.target_rotation + 9].reshape(3, 3)
    translation = row[at.translation : at.translation + 3]
    rotation = row[at.rotation : at.rotation + 9].reshape(3, 3)
    error = row[at.error : at.error + 6]
    jacobian = row[at.jacobian : at.jacobian + 6 * n].reshape(6, n)
    task_jacobian = row[at.task_jacobian : at.task_jacobian + m * n].reshape(m, n)
    factor = row[at.factor : at.factor + m * m].reshape(m, m)
    y = row[at.y : at.y + m]
    damping = row[at.damping : at.columns]
    pointing = angle_kind == POINTING

    jacobian[:] = frame_jacobian
    rotation[:] = frame_rotation
    translation[:] = frame_translation
    for i in range(3):
        error[i] = row[at.target_translation + i] - translation[i]
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
        damp(factor, threshold, strength, damping)
        gain *= 1.0 - damping[1]
    # u = S(ẋ_d + K e), then y = A⁻¹(u - Jε)
    command = np.empty(6)
    for i in range(6):
        command[i] = row[at.target_twist + i] + gain * error[i]
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
        row[at.qd + k] = total
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
        _step(table, s, n, table[s, layout(n, m).step])
    return sound


@kernel
def newton_step(row: Array, n: int, rows: Rows, angle_kind: int) -> Array:
    """Return J⁺S e, the smallest correction of q that takes out the pose error e to first order."""
    m = rows.shape[0]
    at = layout(n, m)
    rotation = row[at.rotation : at.rotation + 9].reshape(3, 3)
    error = row[at.error : at.error + 6]
    task_jacobian = row[at.task_jacobian : at.task_jacobian + m * n].reshape(m, n)
    factor = row[at.factor : at.factor + m * m].reshape(m, m)
    z = np.empty(m)
    select(rows, angle_kind == POINTING, rotation, error, z)
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

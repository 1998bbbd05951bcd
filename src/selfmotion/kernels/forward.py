"""One stage of eq. 4 forward."""

from math import isfinite

from selfmotion.basics import Array, inlined, kernel
from selfmotion.kernels.algebra import (
    add_scaled,
    angular,
    cholesky,
    cross,
    gram,
    linear,
    plus,
    respond,
)
from selfmotion.kernels.damping import Law, damp
from selfmotion.kernels.table import Stage, parts, q_of, qd_of
from selfmotion.kernels.tool import POINTING, Rows, pose_error, select, task_rows


@kernel
def advance(
    s: int,
    world_jacobian: Array,
    rotation: Array,
    translation: Array,
    table: Array,
    rows: Rows,
    angle_kind: int,
    gain: float,
    law: Law | None,
) -> bool:
    """Evaluate eq. 4 at stage s, q̇ = J⁺u + (I - J⁺J) ε, and set the next stage's q.

    `world_jacobian` (6, n) is that of the point at the world's origin, `rotation` and `translation`
    the tool's pose. False where the motion breaks down, see `evaluate`.
    """
    at = parts(table[s], world_jacobian.shape[1], rows.shape[0])
    observe(world_jacobian, rotation, translation, at)
    if not evaluate(at, rows, angle_kind, gain, law):
        return False
    step(table, s, at.q.shape[0], at.step[0])
    return True


@inlined
def evaluate(at: Stage, rows: Rows, angle_kind: int, gain: float, law: Law | None) -> bool:
    """Evaluate eq. 4: q̇ = J⁺u + (I - J⁺J) ε, with u = S(ẋ_d + K e).

    With a `law`, A = JJᵀ + λ²I is damped near singular poses, see `damp`, and the pose feedback K
    fades out as damping fades in: speeds would otherwise grow with an error that the arm cannot
    take out. False where A is not positive definite (a singular pose), or q̇ is not finite.
    """
    pointing = angle_kind == POINTING
    pose_error(
        angle_kind, at.target_translation, at.target_rotation, at.translation, at.rotation, at.error
    )
    task_rows(rows, pointing, at.rotation, at.jacobian, at.task_jacobian)  # J = S J6
    gram(at.task_jacobian, at.factor)  # A = JJᵀ
    if law is not None:
        gain *= damp(at.factor, law, at.damping)  # A = JJᵀ + λ²I
    add_scaled(at.target_twist, gain, at.error, at.command)  # ẋ_d + K e
    select(rows, pointing, at.rotation, at.command, at.y)  # y = u
    if not cholesky(at.factor):
        return False
    respond(at.task_jacobian, at.factor, at.y, at.epsilon, at.qd)  # y = A⁻¹(u - Jε), q̇ = Jᵀy + ε
    return finite(at.qd)


@inlined
def observe(world_jacobian: Array, rotation: Array, translation: Array, at: Stage) -> None:
    """Set the tool's pose and its Jacobian J6 at a stage."""
    for i in range(3):
        at.translation[i] = translation[i]
        for j in range(3):
            at.rotation[i, j] = rotation[i, j]
    for i in range(6):
        for k in range(at.q.shape[0]):
            at.jacobian[i, k] = world_jacobian[i, k]
    # The velocity of the tool's origin is v = v_0 + ω × x.
    x = (translation[0], translation[1], translation[2])
    for k in range(at.q.shape[0]):
        v = plus(linear(at.jacobian, k), 1.0, cross(angular(at.jacobian, k), x))
        at.jacobian[0, k], at.jacobian[1, k], at.jacobian[2, k] = v


@inlined
def finite(a: Array) -> bool:
    """Whether all numbers are."""
    total = 0.0
    for k in range(a.shape[0]):
        total += a[k]
    return isfinite(total)


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

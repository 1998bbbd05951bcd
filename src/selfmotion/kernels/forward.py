"""One stage of eq. 4 forward."""

from selfmotion.basics import Array, called, inlined, kernel
from selfmotion.basics.layout import KIND, Layout
from selfmotion.kernels.algebra import (
    add_scaled,
    angular,
    cholesky,
    cross,
    finite,
    gram,
    linear,
    plus,
    respond,
)
from selfmotion.kernels.damping import Law, damp
from selfmotion.kernels.table import Tip, q_of, qd_of, stage_of, tip_of
from selfmotion.kernels.tool import pose_error, rows_of, select, task_rows


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
    for i in range(3):
        tip.translation[i] = translation[i]
        for j in range(3):
            tip.rotation[i, j] = rotation[i, j]
    at_tip(base_jacobian, translation, tip.jacobian)


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

"""The table that a rollout works on: one row per stage, and what its columns hold.

A call from Python costs as much per array argument as a good part of the arithmetic, hence one
table in place of a dozen arrays.
"""

from typing import NamedTuple

from selfmotion.basics import kernel


class Layout(NamedTuple):
    """First column of each part of a stage's row, and the number of columns.

    q, q̇, ε (n each); the path's translation (3), rotation (9) and twist (6); the step length (1);
    the tool's translation (3) and rotation (9); its pose error (6); J6 (6n); J (mn); L (mm); y (m);
    the damping: λ0², f, df/dσ² and v (3 + m), see `damp`.
    """

    q: int
    qd: int
    epsilon: int
    target_translation: int
    target_rotation: int
    target_twist: int
    step: int
    translation: int
    rotation: int
    error: int
    jacobian: int
    task_jacobian: int
    factor: int
    y: int
    damping: int
    columns: int


@kernel
def layout(n: int, m: int) -> Layout:
    """Return where the parts of a row are, for n joints and m rows of the task."""
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
    columns = damping + 3 + m
    return Layout(
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
        columns,
    )

"""Nodes of a rollout put exactly onto their path, compiled."""

import numpy as np

from selfmotion.basics import Array, kernel
from selfmotion.basics.layout import Layout
from selfmotion.model.kernels import (
    cholesky,
    errors_and_rows,
    evaluate_motion,
    gram,
    rows_of,
    solve_cholesky,
    stage_of,
    view,
)
from selfmotion.model.robot import place_tips


@kernel
def polish(
    table: Array,
    targets: Array,
    chains: Array,
    layout: Layout,
    steps: int,
    tolerance: float,
    q: Array,
    qd: Array,
) -> None:
    """Put nodes onto their targets (K, 12 F) by Newton's method q ← q + J⁺e, with q̇ by eq. 4.

    Rows of the `table` hold their paths and null motions. q and q̇ (K, n) are those before, and
    stay so where a node is singular; Newton's method makes a number of `steps` at most.
    """
    (count, n), m, tips = q.shape, rows_of(layout), layout.shape[0]
    turns, places = np.empty((chains.shape[1], 3, 3)), np.empty((chains.shape[1], 3))
    rotations, positions = np.empty((tips, 3, 3)), np.empty((tips, 3))
    jacobians, error, here = np.zeros((tips, 6, n)), np.empty(m), np.empty(n)
    for k in range(count):
        at, target = stage_of(table[k], n, m), view(targets[k], 0, (12 * tips,))
        for j in range(n):
            here[j] = q[k, j]
        for _ in range(steps + 1):
            place_tips(here, chains, turns, places, rotations, positions, jacobians)
            errors_and_rows(
                layout, target, jacobians, rotations, positions, error, at.task_jacobian
            )
            gram(at.task_jacobian, at.factor)
            if not cholesky(at.factor):
                break
            if not evaluate_motion(here, table[k], layout, rotations, positions, jacobians):
                break
            off = 0.0
            for i in range(m):
                off = max(off, abs(error[i]))
            for j in range(n):
                q[k, j], qd[k, j] = here[j], at.qd[j]
            if off < tolerance:
                break
            solve_cholesky(at.factor, error)
            for j in range(n):
                for i in range(m):
                    here[j] += at.task_jacobian[i, j] * error[i]

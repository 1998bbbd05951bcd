"""Damping near singular poses, compiled: forward and backward."""

from math import isfinite

import numpy as np

from selfmotion.basics import Array, inlined
from selfmotion.basics.layout import KIND, POINTING, Layout
from selfmotion.kernels.algebra import (
    add_angular,
    angular,
    angular_part,
    cholesky,
    cross,
    plus,
    smallest_eigenvector,
)
from selfmotion.kernels.table import Stage, Tip, stage_of, tip_of, view
from selfmotion.kernels.tool import rows_of, unselect

# The threshold σ0 and the strength λ0 [m, rad].
Law = tuple[float, float]


@inlined
def damp(gram: Array, law: Law, out: Array) -> float:
    """Add λ²I to JJᵀ (its lower triangle `gram`) near singular poses; return 1 - f.

    λ² = λ0² f with f = (1 - σ²/σ0²)² where the smallest singular value σ of J is below the
    threshold σ0, exactly 0 elsewhere. `out` (3 + m,) becomes λ0², f, df/dσ² and the unit vector v
    of σ² = vᵀJJᵀv, all 0 where there is no damping.
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
    # Mostly σ > σ0, which a Cholesky factor tells at a fraction of the price of eigenvalues. NaN is
    # left to the factor of `gram` itself.
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
    """Return 2 df/dσ² (λ0² zᵀy + K zᵀS e): what ⟨v (Jᵀv)ᵀ, ∂J⟩ has to be multiplied by."""
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
    """Add what `factor` ⟨v (Jᵀv)ᵀ, ∂J⟩ leaves: on J6 to `weights` (6, n), on S to `twist` (6,).

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

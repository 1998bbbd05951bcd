"""One step of Newton's method towards a start on the self-motion of the first pose."""

import numpy as np

from selfmotion.basics import Array, inlined
from selfmotion.basics.layout import Layout
from selfmotion.model.kernels.algebra import cholesky, gram, solve_cholesky
from selfmotion.model.kernels.tool import errors_and_rows, rows_of


@inlined
def approach(
    q: Array,
    jacobians: Array,
    rotations: Array,
    translations: Array,
    target: Array,
    layout: Layout,
    null: Array,
    reference: Array,
    z: Array,
    b: Array,
    system: Array,
    factor: Array,
) -> float:
    """Add B⁻¹b to q (n,), with B = [J; N0ᵀ] and b = [e; z - N0ᵀ(q - q_ref)]; return max |b|.

    Of all tips, (F, 6, n), (F, 3, 3) and (F, 3), and their targets' translations and rotations,
    (12 F,). B⁻¹ = Bᵀ(BBᵀ)⁻¹: errors of the product are taken out by the next step. -1 where B is
    singular, NaN where q is not finite. Sets `system` (m + r, n) to B and `factor`, square, to the
    Cholesky factor of BBᵀ; `b` (m + r,) is to work in.
    """
    m, r, n = rows_of(layout), null.shape[1], q.shape[0]
    errors_and_rows(layout, target, jacobians, rotations, translations, b, system)
    for i in range(r):
        total = z[i]
        for k in range(n):
            system[m + i, k] = null[k, i]
            total -= null[k, i] * (q[k] - reference[k])
        b[m + i] = total
    largest = 0.0
    for i in range(m + r):
        # Written so that NaN stays.
        if not abs(b[i]) <= largest:
            largest = abs(b[i])
    gram(system, factor)
    if not cholesky(factor):
        return -1.0 if largest < np.inf else np.nan
    solve_cholesky(factor, b)
    for k in range(n):
        total = q[k]
        for i in range(m + r):
            total += system[i, k] * b[i]
        q[k] = total
    return largest

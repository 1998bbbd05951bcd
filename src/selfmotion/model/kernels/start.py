"""One step of Newton's method towards a start: the pose and coordinates on its self-motion."""

import numpy as np

from selfmotion.basics import Array, inlined
from selfmotion.basics.layout import Layout
from selfmotion.model.kernels.algebra import cholesky, gram, solve_cholesky
from selfmotion.model.kernels.tool import errors_and_rows, rows_of


@inlined
def start_step(
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

    The start q has the pose of the target, e = 0, and the coordinates z on its self-motion. The
    step is computed as Bᵀ(BBᵀ)⁻¹b: errors of the product are taken out by the next one.

    Parameters
    ----------
    q : (n,)
        Configuration; becomes the next iterate.
    jacobians, rotations, translations : (F, 6, n), (F, 3, 3), (F, 3)
        Of all tips, at q.
    target : (12 F,)
        Where the tips have to be; as in `Follows.targets`.
    layout : Layout
        Prescribed rows of all tips, m in all.
    null : (n, r)
        N0, a basis of the self-motion at the reference.
    reference : (n,)
        q_ref, from which z is measured.
    z : (r,)
        Coordinates on the self-motion.
    b : (m + r,)
        Set to (BBᵀ)⁻¹b.
    system : (m + r, n)
        Set to B.
    factor : (m + r, m + r)
        Set to the Cholesky factor of BBᵀ.

    Returns
    -------
    float
        max |b| before the step; -1 where B is singular, NaN where q is not finite: then q stays.
    """
    m, r, n = rows_of(layout), null.shape[1], q.shape[0]
    errors_and_rows(layout, target, jacobians, rotations, translations, b, system)
    for i in range(r):
        coordinate_error = z[i]
        for k in range(n):
            system[m + i, k] = null[k, i]
            coordinate_error -= null[k, i] * (q[k] - reference[k])
        b[m + i] = coordinate_error
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
        q_next = q[k]
        for i in range(m + r):
            q_next += system[i, k] * b[i]
        q[k] = q_next
    return largest

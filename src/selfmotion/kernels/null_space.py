"""Bases of null spaces, carried along a motion without turning inside the null space."""

import numpy as np

from selfmotion.basics import Array, inlined, kernel
from selfmotion.kernels.algebra import cholesky, gram, solve_cholesky

# Steps of the iteration: it converges quadratically once a basis is nearly orthonormal.
_POLAR = 40
# Jacobians with a pivot of JJᵀ [m², rad²] below this are taken for singular.
_SINGULAR = 1e-12


def carried(first: Array, jacobians: Array) -> Array:
    """Return a basis `first` (n, r) of the null space carried along a motion, (N, n, r).

    A discrete parallel transport, see `transport`: continuous whatever the signs and order of the
    singular vectors of its Jacobians (N, m, n) do.
    """
    bases = np.empty((len(jacobians), *first.shape))
    transport(first, np.ascontiguousarray(jacobians), _SINGULAR, bases)
    return bases


@inlined
def factor_damped(jacobian: Array, pivot: float, factor: Array) -> None:
    """Set `factor` to the Cholesky factor of JJᵀ + λ²I, λ = 0 unless a pivot is below `pivot`."""
    gram(jacobian, factor)
    least = np.inf
    if cholesky(factor):
        for i in range(factor.shape[0]):
            least = min(least, 1.0 / (factor[i, i] * factor[i, i]))
    else:
        least = 0.0
    if least < pivot:
        gram(jacobian, factor)
        for i in range(factor.shape[0]):
            factor[i, i] += pivot - least
        cholesky(factor)


@kernel
def transport(first: Array, jacobians: Array, pivot: float, bases: Array) -> None:
    """Carry a basis (n, r) of the null space along task Jacobians (N, m, n): `bases` (N, n, r).

    Each is the orthonormal basis nearest to its predecessor's projection onto the null space: the
    polar factor, by the Newton-Schulz iteration. The projection is damped below a `pivot` of JJᵀ.
    """
    count, m, n = jacobians.shape
    r = first.shape[1]
    factor, y, inner = np.empty((m, m)), np.empty(m), np.empty((r, r))
    basis, better = first.copy(), np.empty((n, r))
    for s in range(count):
        jacobian = jacobians[s]
        factor_damped(jacobian, pivot, factor)
        for x in range(r):
            for i in range(m):
                total = 0.0
                for k in range(n):
                    total += jacobian[i, k] * basis[k, x]
                y[i] = total
            solve_cholesky(factor, y)
            for k in range(n):
                total = basis[k, x]
                for i in range(m):
                    total -= jacobian[i, k] * y[i]
                basis[k, x] = total
        for _ in range(_POLAR):
            off = 0.0
            for a in range(r):
                for b in range(r):
                    total = 0.0
                    for k in range(n):
                        total += basis[k, a] * basis[k, b]
                    inner[a, b] = total
                    off = max(off, abs(total - (1.0 if a == b else 0.0)))
            if not off > 1e-12:
                break
            for k in range(n):
                for a in range(r):
                    better[k, a] = 1.5 * basis[k, a]
                    for b in range(r):
                        better[k, a] -= 0.5 * basis[k, b] * inner[b, a]
            for k in range(n):
                for a in range(r):
                    basis[k, a] = better[k, a]
        for k in range(n):
            for a in range(r):
                bases[s, k, a] = basis[k, a]

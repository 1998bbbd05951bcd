"""Small dense algebra, compiled: vectors, Cholesky, eigenvectors, null spaces."""

from math import isfinite, sqrt

import numpy as np

from selfmotion.basics import Array, Flags, called, inlined, kernel

Vector = tuple[float, float, float]

# Pivot, relative to its diagonal, that counts as rounding: the matrix is singular.
_SINGULAR = 1e-13
# Largest number of sweeps of Jacobi's method, which converges quadratically.
_SWEEPS = 30
# Squared size of the remaining off-diagonal, relative, that counts as rounding.
_ROTATED = 1e-32


@inlined
def clear_held(held: Flags, jacobians: Array) -> None:
    """Clear the columns of joints that are held, (n,), in Jacobians (F, 6, n)."""
    for j in range(len(held)):
        if held[j]:
            for f in range(jacobians.shape[0]):
                for i in range(6):
                    jacobians[f, i, j] = 0.0


@inlined
def linear(a: Array, k: int) -> Vector:
    """Return the first three entries of column k."""
    return a[0, k], a[1, k], a[2, k]


@inlined
def angular(a: Array, k: int) -> Vector:
    """Return the last three of the six entries of column k."""
    return a[3, k], a[4, k], a[5, k]


@inlined
def angular_part(twist: Array) -> Vector:
    """Return the last three entries of a (6,)."""
    return twist[3], twist[4], twist[5]


@inlined
def add_angular(twist: Array, s: float, a: Vector) -> None:
    """Add s a to the last three entries of a (6,)."""
    for i in range(3):
        twist[3 + i] += s * a[i]


@inlined
def cross(a: Vector, b: Vector) -> Vector:
    """Return a × b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@inlined
def dot(a: Vector, b: Vector) -> float:
    """Return a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def plus(a: Vector, s: float, b: Vector) -> Vector:
    """Return a + s b."""
    return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]


@inlined
def add_scaled(a: Array, s: float, b: Array, out: Array) -> None:
    """Set `out` to a + s b."""
    for i in range(a.shape[0]):
        out[i] = a[i] + s * b[i]


@inlined
def gram(jacobian: Array, out: Array) -> None:
    """Set the lower triangle of `out` to JJᵀ."""
    m, n = jacobian.shape
    for i in range(m):
        for j in range(i + 1):
            total = 0.0
            for k in range(n):
                total += jacobian[i, k] * jacobian[j, k]
            out[i, j] = total


@called
def cholesky(a: Array) -> bool:
    """Replace the lower triangle of `a` by its Cholesky factor L; False where it is not positive.

    The diagonal becomes 1/L_ii: that is what `solve_cholesky` multiplies by.
    """
    for i in range(a.shape[0]):
        for j in range(i):
            total = a[i, j]
            for k in range(j):
                total -= a[i, k] * a[j, k]
            a[i, j] = total * a[j, j]
        total = a[i, i]
        for k in range(i):
            total -= a[i, k] * a[i, k]
        # NaN fails this comparison, too.
        if not total > _SINGULAR * a[i, i]:
            return False
        a[i, i] = 1.0 / sqrt(total)
    return True


@called
def solve_cholesky(factor: Array, b: Array) -> None:
    """Replace `b` by A⁻¹b, for the factor of `cholesky`."""
    m = b.shape[0]
    for i in range(m):
        total = b[i]
        for k in range(i):
            total -= factor[i, k] * b[k]
        b[i] = total * factor[i, i]
    for i in range(m - 1, -1, -1):
        total = b[i]
        for k in range(i + 1, m):
            total -= factor[k, i] * b[k]
        b[i] = total * factor[i, i]


@kernel
def gram_determinants(jacobians: Array) -> Array:
    """Return det JJᵀ of matrices J (S, m, n), (S,); 0 where it is singular to rounding, or NaN."""
    count, m, _ = jacobians.shape
    found, factor = np.zeros(count), np.empty((m, m))
    for s in range(count):
        gram(jacobians[s], factor)
        trace = 0.0
        for i in range(m):
            trace += factor[i, i]
        if not isfinite(trace):
            found[s] = np.nan
        elif cholesky(factor):
            root = 1.0
            for i in range(m):
                root *= factor[i, i]
            found[s] = 1.0 / (root * root)
    return found


@kernel
def log_determinant_slopes(jacobians: Array) -> Array:
    """Return ∂ log det(JJᵀ)/∂J = 2 (JJᵀ)⁻¹J of matrices J (S, m, n); NaN where it is singular."""
    count, m, n = jacobians.shape
    found, factor, column = np.empty((count, m, n)), np.empty((m, m)), np.empty(m)
    for s in range(count):
        gram(jacobians[s], factor)
        regular = cholesky(factor)
        for k in range(n):
            for i in range(m):
                column[i] = 2.0 * jacobians[s, i, k]
            solve_cholesky(factor, column)
            for i in range(m):
                found[s, i, k] = column[i] if regular else np.nan
    return found


@inlined
def finite(a: Array) -> bool:
    """Whether all numbers are."""
    total = 0.0
    for k in range(a.shape[0]):
        total += a[k]
    return isfinite(total)


@inlined
def respond(jacobian: Array, factor: Array, y: Array, epsilon: Array, qd: Array) -> None:
    """Solve eq. 4: replace y = u by A⁻¹(u - Jε), and set q̇ = Jᵀy + ε."""
    m, n = jacobian.shape
    for i in range(m):
        total = y[i]
        for k in range(n):
            total -= jacobian[i, k] * epsilon[k]
        y[i] = total
    solve_cholesky(factor, y)
    for k in range(n):
        total = epsilon[k]
        for i in range(m):
            total += jacobian[i, k] * y[i]
        qd[k] = total


@called
def smallest_eigenvector(a: Array, vectors: Array, out: Array) -> float:
    """Return the smallest eigenvalue of the symmetric a (m, m); set `out` (m,) to its unit vector.

    Jacobi's method, which leaves the eigenvalues on the diagonal of a and their vectors in the
    columns of `vectors` (m, m) (G. Golub, C. Van Loan, "Matrix Computations", section 8.5).
    """
    m = a.shape[0]
    for i in range(m):
        for j in range(m):
            vectors[i, j] = 1.0 if i == j else 0.0
    for _ in range(_SWEEPS):
        off, size = 0.0, 0.0
        for i in range(m):
            size += a[i, i] * a[i, i]
            for j in range(i):
                off += a[i, j] * a[i, j]
        if not off > _ROTATED * size:
            break
        for i in range(m):
            for j in range(i):
                _rotate(a, vectors, i, j)
    least = 0
    for i in range(1, m):
        if a[i, i] < a[least, least]:
            least = i
    for i in range(m):
        out[i] = vectors[i, least]
    return float(a[least, least])


@inlined
def _rotate(a: Array, vectors: Array, i: int, j: int) -> None:
    """Make the entries (i, j) and (j, i) of a 0 by a plane rotation, and turn `vectors` by it."""
    if a[i, j] == 0.0:
        return
    ratio = 0.5 * (a[j, j] - a[i, i]) / a[i, j]
    root = sqrt(1.0 + ratio * ratio)
    tangent = 1.0 / (ratio + root) if ratio >= 0.0 else 1.0 / (ratio - root)
    cosine = 1.0 / sqrt(1.0 + tangent * tangent)
    sine = tangent * cosine
    for k in range(a.shape[0]):
        first, second = a[k, i], a[k, j]
        a[k, i], a[k, j] = cosine * first - sine * second, sine * first + cosine * second
    for k in range(a.shape[0]):
        first, second = a[i, k], a[j, k]
        a[i, k], a[j, k] = cosine * first - sine * second, sine * first + cosine * second
    a[i, j] = a[j, i] = 0.0
    for k in range(a.shape[0]):
        first, second = vectors[k, i], vectors[k, j]
        vectors[k, i], vectors[k, j] = (
            cosine * first - sine * second,
            sine * first + cosine * second,
        )


# Largest number of iterations: quadratic convergence once a basis is nearly orthonormal.
_POLAR = 40
# Pivot of JJᵀ [m², rad²] below which Jacobians count as singular.
_NO_BASIS = 1e-12


def carried(first: Array, jacobians: Array) -> Array:
    """Return a basis `first` (n, r) of the null space carried along a motion, (N, n, r).

    A discrete parallel transport, see `transport`: continuous, whatever the signs and order of the
    singular vectors of its Jacobians (N, m, n).
    """
    bases = np.empty((len(jacobians), *first.shape))
    transport(first, np.ascontiguousarray(jacobians), _NO_BASIS, bases)
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

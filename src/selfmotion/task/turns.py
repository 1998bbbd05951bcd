"""Rotation vectors that vary: exp([δ]×), the left Jacobian of SO(3) and its derivative."""

import numpy as np

from selfmotion.basics import Array

# Below this angle the closed forms lose digits and their series serve.
SMALL_TURN = 5e-2


def exponentials(vectors: Array) -> Array:
    """Return exp([δ]×) for rotation vectors (S, 3), (S, 3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(vectors).as_matrix())


def _left_weights(vectors: Array) -> tuple[Array, Array, Array, Array]:
    """Return a = (1 - cos θ)/θ², b = (θ - sin θ)/θ³, a'/θ and b'/θ at θ = |δ|."""
    angle = np.linalg.norm(vectors, axis=1)
    small = angle < SMALL_TURN
    safe = np.where(small, 1.0, angle)
    sine, cosine = np.sin(safe), np.cos(safe)
    a = np.where(small, 0.5 - angle**2 / 24.0 + angle**4 / 720.0, (1.0 - cosine) / safe**2)
    b = np.where(small, 1.0 / 6.0 - angle**2 / 120.0 + angle**4 / 5040.0, (safe - sine) / safe**3)
    by_a = np.where(
        small,
        -1.0 / 12.0 + angle**2 / 180.0 - angle**4 / 6720.0,
        (safe * sine - 2.0 * (1.0 - cosine)) / safe**4,
    )
    by_b = np.where(
        small,
        -1.0 / 60.0 + angle**2 / 1260.0 - angle**4 / 60480.0,
        (3.0 * sine - 2.0 * safe - safe * cosine) / safe**5,
    )
    return a, b, by_a, by_b


def left_matrices(vectors: Array) -> Array:
    """Return Jl(δ) = I + a [δ]× + b [δ]×², (S, 3, 3)."""
    a, b, _, _ = _left_weights(vectors)
    cross = skews(vectors)
    return np.asarray(np.eye(3) + a[:, None, None] * cross + b[:, None, None] * cross @ cross)


def left(vectors: Array, rates: Array) -> Array:
    """Return Jl(δ) δ̇: the angular velocity of exp([δ]×), (S, 3)."""
    return turn(left_matrices(vectors), rates)


def left_derivative(vectors: Array, rates: Array) -> Array:
    """Return ∂(Jl(δ) v)/∂δ at v = δ̇, (S, 3, 3)."""
    a, b, by_a, by_b = _left_weights(vectors)
    delta, v = skews(vectors), skews(rates)
    once = turn(delta, rates)
    twice = turn(delta, once)
    gradient = by_a[:, None] * once + by_b[:, None] * twice
    # ∂(δ×v) = -[v]× ∂δ and ∂(δ×(δ×v)) = -([δ×v]× + [δ]×[v]×) ∂δ.
    direct = -a[:, None, None] * v - b[:, None, None] * (skews(once) + delta @ v)
    return np.asarray(direct + gradient[:, :, None] * vectors[:, None, :])


def skews(vectors: Array) -> Array:
    """Return [v]× for vectors (S, 3), (S, 3, 3)."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)


def turn(matrices: Array, vectors: Array) -> Array:
    """Return the products of matrices (S, 3, 3) and vectors (S, 3) or columns (S, 3, k)."""
    if vectors.ndim == 2:
        return np.asarray(np.einsum("sij,sj->si", matrices, vectors))
    return np.asarray(matrices @ vectors)

"""Rotation vectors that vary: exp([δ]×), the left Jacobian of SO(3) and its derivative."""

import numpy as np
from pinocchio import (
    SE3 as SE3,
    Jexp3 as Jexp3,
    Quaternion as Quaternion,
    exp3 as exp3,
    log3 as log3,
    rpy as rpy,
    skew as skew,
)

from selfmotion.basics import Array

# Angle below which closed forms lose digits, and series are used.
SMALL_TURN = 5e-2
# Cosine below which a turn is so near half a turn that its sine has lost digits.
_NEAR_HALF_TURN = -0.99


def rotation_vectors(rotations: Array) -> Array:
    """Return φ = log R of rotations (S, 3, 3), (S, 3) [rad]: θ / sin θ by half of R - Rᵀ."""
    normals = np.empty((len(rotations), 3))
    for column, (i, j) in enumerate(((2, 1), (0, 2), (1, 0))):
        normals[:, column] = 0.5 * (rotations[:, i, j] - rotations[:, j, i])
    cosines = 0.5 * (np.einsum("sii->s", rotations) - 1.0)
    sines = _angles(normals)
    angles = np.arctan2(sines, cosines)
    vectors: Array = normals * (angles / np.where(sines > 0.0, sines, 1.0))[:, None]
    for k in np.flatnonzero(cosines < _NEAR_HALF_TURN):
        vectors[k] = log3(rotations[k])
    return vectors


def turning(vectors: Array, rates: Array) -> tuple[Array, Array]:
    """Return exp([δ]×), (S, 3, 3), and its angular velocity Jl(δ) δ̇, (S, 3)."""
    angle = _angles(vectors)
    a, b = _left_weights(angle)
    delta, outer = skews(vectors), vectors[:, :, None] * vectors[:, None, :]
    # sin θ / θ [δ]× + a [δ]×² + I, with [δ]×² = δδᵀ - θ² I.
    sine, cosine = 1.0 - b * angle**2, 1.0 - a * angle**2
    turned = sine[:, None, None] * delta + a[:, None, None] * outer
    turned.reshape(-1, 9)[:, ::4] += cosine[:, None]
    once = turn(delta, rates)
    return turned, rates + a[:, None] * once + b[:, None] * turn(delta, once)


def _angles(vectors: Array) -> Array:
    return np.asarray(np.sqrt(np.einsum("si,si->s", vectors, vectors)))


def _left_weights(angle: Array) -> tuple[Array, Array]:
    """Return a = (1 - cos θ)/θ² and b = (θ - sin θ)/θ³."""
    small, square = angle < SMALL_TURN, angle**2
    safe = np.where(small, 1.0, angle)
    a = (1.0 - np.cos(safe)) / safe**2
    b = (safe - np.sin(safe)) / safe**3
    return (
        np.where(small, 0.5 - square / 24.0 + square**2 / 720.0, a),
        np.where(small, 1.0 / 6.0 - square / 120.0 + square**2 / 5040.0, b),
    )


def _left_slopes(angle: Array) -> tuple[Array, Array]:
    """Return a'/θ and b'/θ."""
    small, square = angle < SMALL_TURN, angle**2
    safe = np.where(small, 1.0, angle)
    sine, cosine = np.sin(safe), np.cos(safe)
    by_a = (safe * sine - 2.0 * (1.0 - cosine)) / safe**4
    by_b = (3.0 * sine - 2.0 * safe - safe * cosine) / safe**5
    return (
        np.where(small, -1.0 / 12.0 + square / 180.0 - square**2 / 6720.0, by_a),
        np.where(small, -1.0 / 60.0 + square / 1260.0 - square**2 / 60480.0, by_b),
    )


def left_matrices(vectors: Array) -> Array:
    """Return Jl(δ) = I + a [δ]× + b [δ]×², (S, 3, 3)."""
    a, b = _left_weights(_angles(vectors))
    cross = skews(vectors)
    return np.asarray(np.eye(3) + a[:, None, None] * cross + b[:, None, None] * cross @ cross)


def left_derivative(vectors: Array, rates: Array) -> Array:
    """Return ∂(Jl(δ) v)/∂δ at v = δ̇, (S, 3, 3)."""
    angle = _angles(vectors)
    (a, b), (by_a, by_b) = _left_weights(angle), _left_slopes(angle)
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

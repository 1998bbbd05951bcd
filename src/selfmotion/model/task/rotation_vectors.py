"""Rotation vectors of many rotations."""

from math import cos, sin, sqrt

import numpy as np
from pinocchio import log3

from selfmotion.basics import Array, called

# Angle below which Taylor series replace the closed forms [rad]: the first omitted terms are below
# 1e-12.
_SMALL_ANGLE = 5e-2
# Cosine below which sin θ has lost digits, and Pinocchio's logarithm is used.
_NEAR_HALF_TURN = -0.99


def rotation_vectors(rotations: Array) -> Array:
    """Return φ = log R of rotations (S, 3, 3), (S, 3) [rad].

    φ = θ / sin θ · vee((R - Rᵀ) / 2); near half a turn Pinocchio's logarithm.
    """
    normals = np.empty((len(rotations), 3))
    for column, (i, j) in enumerate(((2, 1), (0, 2), (1, 0))):
        normals[:, column] = 0.5 * (rotations[:, i, j] - rotations[:, j, i])
    cosines = 0.5 * (np.einsum("sii->s", rotations) - 1.0)
    sines = _norms(normals)
    angles = np.arctan2(sines, cosines)
    vectors: Array = normals * (angles / np.where(sines > 0.0, sines, 1.0))[:, None]
    for k in np.flatnonzero(cosines < _NEAR_HALF_TURN):
        vectors[k] = log3(rotations[k])
    return vectors


def exponentials(vectors: Array, rates: Array) -> tuple[Array, Array]:
    """Return R = exp([δ]×) (S, 3, 3), and its angular velocity Jl(δ) δ̇ (S, 3), world axes.

    Jl(δ) = I + a [δ]× + b [δ]×² is the left Jacobian of SO(3).
    """
    square = np.einsum("si,si->s", vectors, vectors)
    a, b = np.reshape([exponential_coefficients(x) for x in square.tolist()], (-1, 2)).T
    delta, outer = skews(vectors), vectors[:, :, None] * vectors[:, None, :]
    # sin θ / θ [δ]× + a [δ]×² + I, with [δ]×² = δδᵀ - θ² I.
    sine, cosine = 1.0 - b * square, 1.0 - a * square
    rotations = sine[:, None, None] * delta + a[:, None, None] * outer
    rotations.reshape(-1, 9)[:, ::4] += cosine[:, None]
    cross = products(delta, rates)
    return rotations, rates + a[:, None] * cross + b[:, None] * products(delta, cross)


@called
def exponential_coefficients(square: float) -> tuple[float, float]:
    """Return a = (1 - cos θ)/θ² and b = (θ - sin θ)/θ³, for θ²."""
    if square < _SMALL_ANGLE**2:
        return (
            0.5 - square / 24.0 + square**2 / 720.0,
            1.0 / 6.0 - square / 120.0 + square**2 / 5040.0,
        )
    angle = sqrt(square)
    return (1.0 - cos(angle)) / square, (angle - sin(angle)) / (square * angle)


def products(matrices: Array, vectors: Array) -> Array:
    """Return the products of matrices (S, 3, 3) and vectors (S, 3), (S, 3)."""
    return np.asarray(np.einsum("sij,sj->si", matrices, vectors))


def skews(vectors: Array) -> Array:
    """Return [v]× for vectors (S, 3), (S, 3, 3)."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)


def _norms(vectors: Array) -> Array:
    """Return the Euclidean norms of vectors (S, 3), (S,)."""
    return np.asarray(np.sqrt(np.einsum("si,si->s", vectors, vectors)))

"""Rotation vectors of many rotations."""

import numpy as np
from scipy.spatial.transform import Rotation

from selfmotion.model.task import exp3, rotation_vectors

# Rounding of an entry of a rotation, by what a rotation vector multiplies it with near half a turn.
ROUNDED = 1e-12


def test_rotation_vectors_are_scipys() -> None:
    rotations = Rotation.random(200, rng=np.random.default_rng(0))
    found = rotation_vectors(rotations.as_matrix())
    np.testing.assert_allclose(found, rotations.as_rotvec(), rtol=0.0, atol=ROUNDED)


def test_small_turns_keep_their_digits_and_half_turns_their_angle() -> None:
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    for angle in (0.0, 1e-12, 1e-6, 0.1, 3.0, np.pi - 1e-3, np.pi - 1e-7):
        found = rotation_vectors(exp3(angle * axis)[None])[0]
        np.testing.assert_allclose(found, angle * axis, rtol=0.0, atol=1e-8 * angle)
    half = rotation_vectors(exp3(np.pi * axis)[None])[0]
    np.testing.assert_allclose(np.linalg.norm(half), np.pi)

"""Rotations of SciPy are taken as they are: nobody has to know the order of their numbers."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import selfmotion as sm

TURNS = Rotation.from_euler("xyz", [[0.1, 0.2, 0.3], [0.4, -0.2, 0.1], [0.3, 0.0, -0.5]])
POINTS = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.2, 0.0]]


@pytest.mark.parametrize(
    "made",
    [
        lambda turns: sm.paths.Waypoints([0.0, 1.0, 2.0], POINTS, turns),
        lambda turns: sm.paths.Polyline(POINTS, turns),
    ],
)
def test_rotations_are_the_same_as_quaternions_with_w_first(made) -> None:
    path, other = made(TURNS), made(TURNS.as_quat(scalar_first=True))
    assert path.oriented
    for t in np.linspace(0.0, path.duration, 9):
        np.testing.assert_array_equal(path.pose(t).homogeneous, other.pose(t).homogeneous)
    # They are the rotations that were given, not what another order would make of them.
    np.testing.assert_allclose(path.pose(0.0).rotation, TURNS[0].as_matrix(), atol=1e-12)
    wrong = made(TURNS.as_quat())
    assert np.abs(wrong.pose(0.0).rotation - TURNS[0].as_matrix()).max() > 0.1

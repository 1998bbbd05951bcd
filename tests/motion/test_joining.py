"""Motions are joined and reversed exactly."""

import numpy as np

import selfmotion as sm
import selfmotion.shell.testing
from selfmotion.model.motion import joined_motions, reversed_motion


def test_motions_are_joined_and_reversed_exactly() -> None:
    rng = np.random.default_rng(0)
    q = rng.normal(size=(3, 2))
    still = np.zeros((2, 2))
    one, other = (
        sm.Trajectory([0.0, 1.5], q[k : k + 2], still, ("a", "b"), still) for k in range(2)
    )
    whole = joined_motions([one, other])
    t = np.linspace(0.0, 1.5, 30)
    for order in range(3):
        np.testing.assert_allclose(whole(t + 1.5, order), other(t, order), atol=1e-12)
        back = reversed_motion(other)(1.5 - t, order)
        np.testing.assert_allclose((-1.0) ** order * back, other(t, order), atol=1e-12)


def test_cubics_stay_what_they_are() -> None:
    rng = np.random.default_rng(1)
    t = np.linspace(0.0, 1.5, 4)
    q, qd = rng.normal(size=(7, 2)), rng.normal(size=(7, 2))
    one, other = (sm.Trajectory(t, q[k : k + 4], qd[k : k + 4], ("a", "b")) for k in (0, 3))
    whole, times = joined_motions([one, other]), np.linspace(0.0, 1.5, 50)
    for order in range(2):
        np.testing.assert_allclose(whole(times, order), one(times, order), atol=1e-12)
        np.testing.assert_allclose(whole(times + 1.5, order), other(times, order), atol=1e-12)
        back = reversed_motion(other)(1.5 - times, order)
        np.testing.assert_allclose((-1.0) ** order * back, other(times, order), atol=1e-12)

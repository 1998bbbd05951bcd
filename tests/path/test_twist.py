"""A path given by its velocity."""

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from support.paths import pose


def test_twist_path_integrates_the_papers_velocity() -> None:
    problem = sm.sample_problem()
    t = np.linspace(0, 1, 50)
    expected = np.stack([3 * np.cos(np.pi * t), 2 * np.cos(np.pi * t), 0 * t], axis=1)
    np.testing.assert_allclose(problem.path.samples(t).translation, expected, atol=1e-12)


def test_twist_path_turns_like_the_exponential() -> None:
    omega = np.array([0.3, -0.5, 0.9])
    path = sm.paths.TwistPath(pose(1), lambda t: [0, 0, 0, *omega], 2.0)
    np.testing.assert_allclose(
        path.pose(1.3).rotation, pin.exp3(1.3 * omega) @ pose(1).rotation, atol=1e-11
    )


def test_twist_path_refuses_a_jump() -> None:
    with pytest.raises(sm.errors.PathError, match=r"not smooth near t = 0\.[67]"):
        sm.paths.TwistPath(pose(1), lambda t: [float(t > 0.7), 0, 0], 1.0)
    with pytest.raises(sm.errors.PathError, match="expected"):
        sm.paths.TwistPath(pose(1), lambda t: [1.0, 2.0], 1.0)


def test_a_function_may_fill_one_array_again_and_again() -> None:
    kept = np.zeros(6)

    def velocity(t: float) -> Array:
        kept[0], kept[5] = np.sin(t), t
        return kept

    def anew(t: float) -> Array:
        return np.array([np.sin(t), 0.0, 0.0, 0.0, 0.0, t])

    one, other = (sm.paths.TwistPath(pose(1), each, 2.0) for each in (velocity, anew))
    for t in np.linspace(0.0, 2.0, 7):
        np.testing.assert_array_equal(one.pose(t).translation, other.pose(t).translation)

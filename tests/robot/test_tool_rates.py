"""The tool's rates are derivatives of its pose."""

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.robot import ToolRates
from support.circles import small_circle


@pytest.fixture
def free(panda: sm.RobotModel) -> sm.Plan:
    return sm.plan(small_circle(panda, task="position"))


def test_rates_are_derivatives_of_the_pose(panda: sm.RobotModel, free: sm.Plan) -> None:
    motion, h = free.trajectory, 1e-5
    t = np.linspace(0.1, 2.9, 23)
    velocity, acceleration = ToolRates(panda.chain)(motion(t), motion(t, 1), motion(t, 2))

    def world_twist(at: float) -> np.ndarray:
        step = 1e-5
        early, late = (panda.pose(motion(at + d)) for d in (-step, step))
        linear = (late.translation - early.translation) / (2 * step)
        angular = pin.log3(late.rotation @ early.rotation.T) / (2 * step)
        return np.concatenate([linear, angular])

    for k, at in enumerate(t):
        turn = panda.pose(motion(at)).rotation.T
        twist, change = world_twist(at), (world_twist(at + h) - world_twist(at - h)) / (2 * h)
        for part in (slice(0, 3), slice(3, 6)):
            np.testing.assert_allclose(velocity[k, part], turn @ twist[part], atol=1e-8)
            np.testing.assert_allclose(acceleration[k, part], turn @ change[part], atol=1e-4)

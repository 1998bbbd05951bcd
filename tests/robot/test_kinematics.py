"""Inverse kinematics reaches, or names the miss."""

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.model.robot import NAMED_ARMS


@pytest.mark.parametrize("name", NAMED_ARMS)
def test_inverse_kinematics_reaches(name: str) -> None:
    robot = sm.load_robot(name)
    task = sm.Task.POSE if robot.can_follow("pose") else sm.Task.PLANAR
    target = robot.pose(robot.dexterous_configuration(task))
    q = robot.inverse_kinematics(target, task, rng=3)
    assert max(task.miss(target, robot.pose(q))) < 1e-10
    assert np.all((q >= robot.lower) & (q <= robot.upper))
    np.testing.assert_array_equal(q, robot.inverse_kinematics(target, task, rng=3))


def test_inverse_kinematics_names_the_miss(planar: sm.RobotModel) -> None:
    with pytest.raises(sm.errors.InverseKinematicsError, match=r"misses by 1 m") as caught:
        planar.inverse_kinematics(pin.SE3(np.eye(3), np.array([6.0, 0, 0])), "planar", attempts=5)
    assert caught.value.position_miss == pytest.approx(1.0)

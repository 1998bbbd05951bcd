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


def test_a_tool_that_points_the_other_way_round_is_turned(planar: sm.RobotModel) -> None:
    """The error of half a turn has no direction: from there, Newton's steps would stay."""
    seed = np.array([0.3, 2.0, 0.5])
    target = planar.pose(seed) * pin.SE3(pin.utils.rotate("z", np.pi), np.zeros(3))
    q = planar.inverse_kinematics(target, "planar_pose", seed=seed, attempts=1)
    assert max(sm.Task.PLANAR_POSE.miss(target, planar.pose(q))) < 1e-10

"""Bands of coordinates are judged from their middle."""

import pytest

import selfmotion as sm
from selfmotion.certificate.band import CoordinateBand
from support.arms import robot_named
from support.motions import motion_of


def test_a_band_is_half_its_width_from_its_middle() -> None:
    robot = robot_named("planar_3r")
    name = robot.joint_names[1]
    motion = motion_of([[0.0, 0.2, 0.0], [0.0, 0.5, 0.0]], [[0.0, 0.3, 0.0]] * 2)
    for center, half, share in ((0.1, 0.5, 0.8), (0.1, 0.3, 4.0 / 3.0), (0.7, 1.0, 0.5)):
        found = CoordinateBand(robot, sm.JointCoordinate(name), center, half).judge(motion)
        assert found.amount == pytest.approx(share, rel=1e-3)
        assert found.kept is (share <= 1.0)
        assert f"expected {center - half:.4g} to {center + half:.4g}" in found.text

"""Joints that mimic others, in files: left out and told, and read where they follow."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import selfmotion as sm
from selfmotion.shell.cli import app
from selfmotion.shop.controllers import mimic_joints, without_mimic_joints
from support.files_of_people import finger


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> sm.RobotModel:
    file = tmp_path_factory.mktemp("finger") / "finger.urdf"
    file.write_text(finger())
    return sm.load_robot(file, tool="tip")


def test_a_motion_with_the_joints_that_mimic_others_is_that_of_the_arm(arm: sm.RobotModel) -> None:
    assert mimic_joints(arm) == {"j4": "j3"}
    t = np.linspace(0.0, 1.0, 5)
    q = np.outer(t, [0.1, 0.2, 0.3, 0.4])
    plain = sm.Trajectory(t, q, np.tile(q[-1], (5, 1)), arm.joint_names)
    assert without_mimic_joints(plain, arm) is plain
    whole = arm.all_joints(q)
    names = tuple(reversed(whole))
    places = np.column_stack([whole[name] for name in names])
    motion = sm.Trajectory(t, places, np.tile(places[-1], (5, 1)), names)
    found = without_mimic_joints(motion, arm).of_joints(arm.joint_names)
    np.testing.assert_array_equal(found.q, q)
    places[3, names.index("j4")] += 0.01
    with pytest.raises(
        sm.errors.FileFormatError, match=r"'j4' is 0\.01 off where joint 'j3', which it"
    ):
        without_mimic_joints(sm.Trajectory(t, places, motion.qd, names), arm)


def test_exports_name_what_they_leave_out(arm: sm.RobotModel, tmp_path: Path) -> None:
    move = sm.move(arm, np.zeros(4), np.full(4, 0.2), constraints=[], clearance=None)
    move.save(tmp_path / "move.npz")
    run = ["export", str(tmp_path / "move.npz"), "--force", "--out", str(tmp_path / "a.yaml")]
    said = "joints that mimic others are left out ('j4' 'j3')"
    found = CliRunner().invoke(app, run)
    assert said in found.stderr, found.output

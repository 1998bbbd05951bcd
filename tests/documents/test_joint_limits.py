"""Limits that makers, users and MoveIt's files state: all of them count."""

from pathlib import Path

import numpy as np
import pytest
import yaml

import selfmotion as sm
from support.shell import complaint, invoke, on_line

PANDA = {
    "default_velocity_scaling_factor": 0.5,
    "default_acceleration_scaling_factor": 0.25,
    "joint_limits": {
        "panda_joint1": {
            "has_velocity_limits": True,
            "max_velocity": 2.0,
            "has_acceleration_limits": True,
            "max_acceleration": 4.0,
            "has_jerk_limits": False,
            "max_jerk": 1.0,
        },
        "panda_joint2": {
            "has_position_limits": True,
            "min_position": -0.5,
            "max_position": 0.75,
            "has_jerk_limits": True,
            "max_jerk": 100.0,
        },
        "panda_finger_joint1": {"has_velocity_limits": True, "max_velocity": 0.1},
    },
}


def written(folder: Path, document: object) -> Path:
    file = folder / "joint_limits.yaml"
    file.write_text(yaml.safe_dump(document))
    return file


def test_the_limits_of_a_file_are_scaled_and_join_the_arms(
    panda: sm.RobotModel, tmp_path: Path
) -> None:
    position, speed, acceleration, jerk = sm.files.read_joint_limits(
        written(tmp_path, PANDA), panda
    )
    lower, upper = position.limits(panda)
    assert (lower[1], upper[1]) == (-0.5, 0.75)
    np.testing.assert_array_equal(np.delete(lower, 1), np.delete(panda.lower, 1))
    assert speed.of(panda)[0] == 1.0
    np.testing.assert_array_equal(speed.of(panda)[1:], panda.velocity_limit[1:])
    assert acceleration.of(panda)[0] == 1.0
    np.testing.assert_array_equal(acceleration.of(panda)[1:], panda.acceleration_limit[1:])
    assert jerk.of(panda)[1] == 100.0
    assert jerk.of(panda)[0] == panda.jerk_limit[0]
    whole = sm.files.read_joint_limits(written(tmp_path, PANDA), panda, scaled=False)
    assert whole[1].of(panda)[0] == 2.0
    # As a parameter file of a node.
    nested = {"/**": {"ros__parameters": {"robot_description_planning": PANDA}}}
    assert sm.files.read_joint_limits(written(tmp_path, nested), panda)[1].of(panda)[0] == 1.0


def test_a_joint_brakes_by_no_more_than_its_deceleration(
    panda: sm.RobotModel, tmp_path: Path
) -> None:
    """Of whichever sign: Pilz's planner writes it as a negative acceleration."""
    for sign in (1.0, -1.0):
        limits = {"has_deceleration_limits": True, "max_deceleration": sign * 0.5}
        limits |= {"has_acceleration_limits": True, "max_acceleration": 2.0}
        document = {"joint_limits": {"panda_joint1": limits}}
        (found,) = sm.files.read_joint_limits(written(tmp_path, document), panda)
        assert found.of(panda)[0] == 0.5


def test_a_makers_limits_stay_unless_they_are_replaced(panda: sm.RobotModel) -> None:
    for kind, published in (
        (sm.constraints.JointAccelerationLimits, panda.acceleration_limit),
        (sm.constraints.JointJerkLimits, panda.jerk_limit),
    ):
        np.testing.assert_array_equal(kind(1e6).of(panda), published)
        np.testing.assert_array_equal(kind(1e6, replace=True).of(panda), np.full(7, 1e6))
        np.testing.assert_array_equal(kind(0.1).of(panda), np.full(7, 0.1))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.pop("joint_limits"), "has no table 'joint_limits'"),
        (lambda d: d.update(joint_limit={}), "joint_limit: unknown key; nearest: 'joint_limits'"),
        (lambda d: d.update(default_velocity_scaling_factor=1.5), "is 1.5, expected a number ab"),
        (lambda d: d["joint_limits"].pop("panda_joint1"), ""),
        (lambda d: d.update(joint_limits={"joint_1": {}}), "has none of the joints of panda"),
        (lambda d: _joint(d).pop("max_velocity"), "has_velocity_limits is true, but max_velocity"),
        (
            lambda d: _joint(d).update(max_velocity=-1.0),
            "panda_joint1.max_velocity is -1, expected",
        ),
        (lambda d: _joint(d).update(max_velocity="fast"), "max_velocity is 'fast', expected a fin"),
        (lambda d: _joint(d).update(max_velocity=float("nan")), "max_velocity is nan, expected"),
        (lambda d: _joint(d).update(has_velocity_limits="yes"), "is 'yes', expected true or false"),
        (lambda d: _joint(d).pop("has_velocity_limits"), "no effect without has_velocity_limits"),
        (lambda d: _joint(d).update(max_velocty=1.0), "unknown key; nearest: 'max_velocity'"),
        (
            lambda d: d["joint_limits"]["panda_joint2"].update(max_position=-0.6),
            "min_position -0.5 is not below max_position -0.6",
        ),
        (lambda d: d["joint_limits"].update(panda_joint1=[1]), "is [1], expected a table"),
    ],
)
def test_what_is_wrong_is_named_by_joint_and_key(
    panda: sm.RobotModel, tmp_path: Path, change, message: str
) -> None:
    document = yaml.safe_load(yaml.safe_dump(PANDA))
    change(document)
    file = written(tmp_path, document)
    if not message:
        assert len(sm.files.read_joint_limits(file, panda)) == 2
        return
    with pytest.raises(sm.errors.FileFormatError) as refused:
        sm.files.read_joint_limits(file, panda)
    assert message in str(refused.value)
    assert str(file) in str(refused.value)
    line = complaint("plan", "panda", *on_line("0.1,0,0"), "--set", f"joint_limits={file}")
    assert message in line


def _joint(document: dict) -> dict:
    return document["joint_limits"]["panda_joint1"]


def test_plans_keep_the_limits_of_a_file(tmp_path: Path) -> None:
    slow = {"joint_limits": {f"panda_joint{k}": {} for k in range(1, 8)}}
    for limits in slow["joint_limits"].values():
        limits.update(has_velocity_limits=True, max_velocity=0.12)
    file = written(tmp_path, slow)
    out = tmp_path / "plan.npz"
    seam = ("plan", "panda", *on_line("0.1,0,0"), "--set", "path.duration=3")
    code, _ = invoke(*seam, "--out", out)
    assert code == 0
    free = np.abs(sm.load_plan(out).trajectory.extremes(1)[1]).max()
    assert free > 0.12
    code, text = invoke(*seam, "--set", f"joint_limits={file}", "--out", out)
    kept = np.abs(sm.load_plan(out).trajectory.extremes(1)[1]).max()
    assert (code == 0) == (kept <= 0.12), text


JOB = """
task = "pointing"
joint_limits = "joint_limits.yaml"
robot = { name = "panda" }

[job]
start = "home"

[[constraints]]
kind = "JointPositionLimits"

[[seams]]
name = "slow"
constraints = [{ kind = "ToolLimits", speed = 0.03 }, { kind = "Clearance", distance = 0.004 }]
path = { kind = "circle", radius = 0.05, duration = 8, start = { position = [0.5, 0, 0.5] } }

[[seams]]
name = "other"
path = { kind = "circle", radius = 0.05, duration = 8, start = { position = [0.5, 0, 0.5] } }
"""


def test_a_seam_keeps_its_own_constraints_beside_limits_of_a_file(tmp_path: Path) -> None:
    """Its problem has those of the job first, then its own, then those of the file."""
    written(tmp_path, PANDA)
    file = tmp_path / "job.toml"
    file.write_text(JOB)
    job = sm.files.read_seam_job(file)
    slow, other = job.seams
    tool, clearance = slow.constraints
    assert (tool.kind, tool.speed) == ("ToolLimits", 0.03)
    assert (clearance.kind, clearance.distance) == ("Clearance", 0.004)
    assert other.constraints == ()
    shared = [one.kind for one in job.settings["constraints"]]
    assert shared.count("ToolLimits") == 0
    assert "JointJerkLimits" in shared

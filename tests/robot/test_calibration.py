"""Calibrated arms: forward kinematics is the maker's own product of transforms."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

import selfmotion as sm
from selfmotion.shell.documents import read_problem, write_problem
from support.arms import robot_named
from support.shell import invoke

FRAMES = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
COORDINATES = ("x", "y", "z", "roll", "pitch", "yaw")
# What Universal Robots publishes of a UR5 (ros-industrial/universal_robot, ur_description,
# config/ur5/default_kinematics.yaml), and what the calibration with the hash 15200003067234149431
# says of one that was measured.
NOMINAL = [
    [0, 0, 0.089159, 0, 0, 0],
    [0, 0, 0, 1.570796327, 0, 0],
    [-0.425, 0, 0, 0, 0, 0],
    [-0.39225, 0, 0.10915, 0, 0, 0],
    [0, -0.09465, -1.941303950897609e-11, 1.570796327, 0, 0],
    [0, 0.0823, -1.688001216681175e-11, 1.570796326589793, 3.141592653589793, 3.141592653589793],
]
MEASURED = [
    [0, 0, 0.08920113858084797, 0, 0, 1.5413963267648517e-05],
    [8.28481932000539e-05, 0, 0, 1.5702793305568989, 0, 9.424823964845411e-05],
    [-0.4251460319702735, 0, 0, 2.7727163297603633e-4, 7.4181659174685764e-4, 8.206177758992794e-5],
    [-0.39231335412023205, 7.0367842866065884e-4, 0.11004902881674888, 3.1351985141209435,
     -3.1400954402443415, 3.1415185610293745],
    [3.6501405590628345e-05, -0.09472118612480705, 1.791428279527357e-4, 1.5689050644312028, 0,
     -1.320607040336194e-05],
    [1.5399008043081661e-4, 0.08242132708937032, 1.2632686207930083e-4, 1.5723290218826846,
     3.141592653589793, -3.14158677108863],
]  # fmt: skip
# Corrections of Denavit-Hartenberg parameters as a controller writes them: those of the second to
# fourth joint along their axes, all but parallel, are metres and cancel out.
DELTAS = {
    "delta_theta": [9.1e-08, 0.178461, 0.4, -0.578117, 6.1e-06, -5.0e-07],
    "delta_a": [-0.00024379, 0.00381165, 0.034503, 0.00010769, -0.00019874, 0.0],
    "delta_d": [9.2e-05, 12.0620003, 17.6719026, -29.733996, -2.8e-05, 0.00021742],
    "delta_alpha": [0.00115616, 0.00358519, 0.00392132, 0.00040667, -0.00201170, 0.0],
}
# The maker's lengths a and d, and α (universal-robots.com, "DH parameters for calculations of
# kinematics and dynamics").
LENGTHS = [[0, -0.425, -0.39225, 0, 0, 0], [0.089159, 0, 0, 0.10915, 0.09465, 0.0823]]
ALPHA = [np.pi / 2, 0, 0, np.pi / 2, -np.pi / 2, 0]
# The URDF's own angles have eleven digits.
SAME = 1e-9


def placed(position: Any, rotation: Rotation) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation.as_matrix(), position
    return pose


def about(axis: str, angle: float) -> np.ndarray:
    return placed([0, 0, 0], Rotation.from_euler(axis, angle))


def maker_pose(frames: list[list[float]], q: np.ndarray) -> np.ndarray:
    """The product of the maker's transforms: of each frame, and about its z axis."""
    pose = about("z", np.pi)
    for (x, y, z, *rpy), angle in zip(frames, q, strict=True):
        pose = pose @ placed([x, y, z], Rotation.from_euler("xyz", rpy)) @ about("z", angle)
    return pose


def corrected_pose(q: np.ndarray) -> np.ndarray:
    """The product of Denavit-Hartenberg transforms with corrected parameters."""
    theta, a, d, alpha = (np.array(DELTAS[key]) for key in DELTAS)
    a, d, alpha = a + LENGTHS[0], d + LENGTHS[1], alpha + ALPHA
    pose = about("z", np.pi)
    for k in range(6):
        pose = pose @ about("z", q[k] + theta[k])
        pose = pose @ placed([a[k], 0, d[k]], Rotation.identity()) @ about("x", alpha[k])
    return pose


def written(frames: list[list[float]], folder: Path) -> Path:
    tables: dict[str, Any] = {
        name: {key: float(value) for key, value in zip(COORDINATES, values, strict=True)}
        for name, values in zip(FRAMES, frames, strict=True)
    }
    file = folder / "kinematics.yaml"
    file.write_text(yaml.safe_dump({"kinematics": {**tables, "hash": "calib_1"}}))
    return file


def configurations() -> np.ndarray:
    return np.random.default_rng(5).uniform(-3.0, 3.0, (20, 6))


@pytest.mark.parametrize("frames", [NOMINAL, MEASURED], ids=["nominal", "measured"])
def test_a_makers_file_is_the_makers_chain(frames: list[list[float]], tmp_path: Path) -> None:
    robot = sm.load_robot("ur5", calibration=written(frames, tmp_path))
    for q in configurations():
        np.testing.assert_allclose(
            robot.pose(q).homogeneous, maker_pose(frames, q), rtol=0.0, atol=SAME
        )


def test_a_measured_arm_is_not_the_drawn_one(tmp_path: Path) -> None:
    robot, drawn = sm.load_robot("ur5", calibration=written(MEASURED, tmp_path)), robot_named("ur5")
    apart = [
        np.linalg.norm(robot.pose(q).translation - drawn.pose(q).translation)
        for q in configurations()
    ]
    assert 5e-4 < np.mean(apart) < 5e-3
    same = sm.load_robot("ur5", calibration=written(NOMINAL, tmp_path))
    for q in configurations():
        # The maker gives nine digits of a right angle.
        np.testing.assert_allclose(
            same.pose(q).homogeneous, drawn.pose(q).homogeneous, rtol=0.0, atol=2e-9
        )


def test_corrected_parameters_are_their_own_product(tmp_path: Path) -> None:
    file = tmp_path / "calibration.conf"
    lines = [f"{key} = [ {', '.join(map(repr, values))}]" for key, values in DELTAS.items()]
    file.write_text("[mounting]\n" + "\n".join(lines) + "\njoint_checksum = [ 0xb3241580 ]\n")
    robot = sm.load_robot("ur5", calibration=file)
    for q in configurations():
        np.testing.assert_allclose(
            robot.pose(q).homogeneous, corrected_pose(q), rtol=0.0, atol=SAME
        )


def test_links_stay_on_their_axes_near_where_they_were_drawn(tmp_path: Path) -> None:
    """Corrections of metres along axes that are all but parallel move no link by as much."""
    small = {**DELTAS, "delta_theta": [0.0] * 6, "delta_a": [0.0] * 6, "delta_alpha": [0.0] * 6}
    small["delta_d"] = [0.0, 12.0, 17.0, -29.0, 0.0, 0.0]
    file = tmp_path / "calibration.conf"
    file.write_text("\n".join(f"{key} = {values}" for key, values in small.items()))
    q = configurations()
    there = sm.load_robot("ur5", calibration=file).joint_poses(q)[..., :3]
    drawn = robot_named("ur5").joint_poses(q)[..., :3]
    assert np.abs(there - drawn).max() < 1e-9


@pytest.mark.parametrize("suffix", [".yaml", ".toml"])
def test_joints_and_offsets_are_where_and_what_they_say(suffix: str, tmp_path: Path) -> None:
    panda, file = robot_named("panda"), tmp_path / f"panda{suffix}"
    texts = {
        ".yaml": "joints:\n  panda_joint1: {position: [0.001, 0, 0.334], rpy: [0, 0.002, 0]}\n"
        "offsets:\n  panda_joint2: 0.01\n  panda_joint7: -0.02\n",
        ".toml": "[joints]\npanda_joint1 = { position = [0.001, 0, 0.334], rpy = [0, 0.002, 0] }\n"
        "[offsets]\npanda_joint2 = 0.01\npanda_joint7 = -0.02\n",
    }
    file.write_text(texts[suffix])
    robot = sm.load_robot("panda", calibration=file)
    moved = placed([0.001, 0, 0.334], Rotation.from_euler("xyz", [0, 0.002, 0]))
    drawn = placed([0, 0, 0.333], Rotation.identity())
    for q in np.random.default_rng(1).uniform(panda.lower, panda.upper, (10, 7)):
        shifted = q + np.array([0, 0.01, 0, 0, 0, 0, -0.02])
        expected = moved @ np.linalg.inv(drawn) @ panda.pose(shifted).homogeneous
        np.testing.assert_allclose(robot.pose(q).homogeneous, expected, rtol=0.0, atol=1e-12)


def test_a_part_of_a_cell_is_calibrated(tmp_path: Path) -> None:
    file = written(MEASURED, tmp_path)
    cell = sm.load_robot(
        {"arm": "ur5", "table": "positioner"}, calibration={"arm": file}, tool="arm/tool0"
    )
    alone = sm.load_robot("ur5", calibration=file)
    q = configurations()[0]
    apart = cell.pose(q).translation - alone.pose(q).translation
    np.testing.assert_allclose(apart, 0.0, atol=1e-12)


def line_of(robot: sm.RobotModel) -> sm.Problem:
    start = np.array([0.3, -1.3, 1.6, -1.9, -1.5, 0.2])
    pose = robot.pose(start)
    end = pose.copy()
    end.translation = pose.translation + np.array([0.05, 0.1, 0.0])
    limits = [sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()]
    return sm.Problem(robot, sm.paths.Line(pose, end, 2.0), "pointing", start, constraints=limits)


def test_a_plan_for_the_drawn_arm_misses_on_the_measured_one(tmp_path: Path) -> None:
    """By as much as both arms are apart; planned again, it is verified."""
    file = written(MEASURED, tmp_path)
    plan = sm.plan(line_of(robot_named("ur5"))).require()
    problem = sm.calibrated(plan.problem, file)
    judged = dataclasses.replace(problem, start="free").certify(plan.trajectory)
    position, _ = sm.off_nominal(problem.robot, plan.trajectory)
    assert judged.position_error.value == pytest.approx(position.value, rel=0.02)
    assert not judged.verified
    assert position.value > 1e-4
    again = sm.plan(problem, warm_start=plan).require()
    assert sm.off_nominal(plan.robot, plan.trajectory)[0].value == 0.0

    saved = tmp_path / "plan.npz"
    again.save(saved)
    read = sm.load_plan(saved)
    assert read.certificate.verified
    # The arm as it was drawn is in the file, too: nothing has changed.
    assert not read.certificate.notes
    described = tmp_path / "problem.toml"
    write_problem(read.problem, described)
    named = read_problem(described).robot
    q = configurations()[0]
    np.testing.assert_array_equal(named.pose(q).homogeneous, read.robot.pose(q).homogeneous)
    file.write_text(file.read_text().replace("0.0892", "0.0893"))
    with pytest.raises(sm.errors.ProblemError, match="calibration file says now"):
        write_problem(read.problem, described)


def test_calibrations_from_the_shell(tmp_path: Path) -> None:
    file, plan, out = (tmp_path / name for name in ("k.yaml", "plan.npz", "again.npz"))
    file.write_text(written(MEASURED, tmp_path).read_text())
    sm.plan(line_of(robot_named("ur5"))).save(plan)
    code, told = invoke("check", plan, "--calibration", file)
    assert code == 1
    assert "off the path" in told
    code, told = invoke("calibrate", plan, file, "--out", out)
    assert code == 0
    assert sm.load_plan(out).robot.urdf.is_calibrated


BAD: Mapping[str, tuple[str, str]] = {
    "nothing.yaml": ("{}", "has nothing"),
    "list.yaml": ("[1, 2]", "expected a table"),
    "torn.yaml": ("a: [", "is not YAML"),
    "other.toml": ("[limits]\na = 1\n", "'limits'"),
    "frame.yaml": ("kinematics: {shoulder: {x: 0}}", "shoulder: y is None"),
    "fewer.yaml": ("kinematics: {}", "no frame 'shoulder'"),
    "joint.yaml": ("offsets: {shoulder_pan_jiont: 0.1}", "names joint 'shoulder_pan_jiont'"),
    "text.yaml": ("offsets: {shoulder_pan_joint: much}", "expected a number"),
    "half.yaml": ("joints: {shoulder_pan_joint: {position: [0, 0, 1]}}", "position and rpy"),
    "two.yaml": (
        "joints: {shoulder_pan_joint: {position: [0, 0], rpy: [0, 0, 0]}}",
        "three numbers",
    ),
    "none.conf": ("delta_theta = [0, 0, 0, 0, 0, 0]", "no 'delta_a'"),
    "python.conf": ("delta_theta = [0, 0, 1_0, 0, 0, 0]\n", "delta_theta is .* six numbers"),
    "five.conf": ("delta_theta = [0, 0, 0, 0, 0]\n", "expected|no 'delta"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_calibration_is_refused(name: str, tmp_path: Path) -> None:
    text, said = BAD[name]
    file = tmp_path / name
    file.write_text(text)
    with pytest.raises(sm.errors.RobotError, match=said):
        sm.load_robot("ur5", calibration=file)


def test_calibrations_of_another_arm_are_refused(tmp_path: Path) -> None:
    file = written(MEASURED, tmp_path)
    with pytest.raises(sm.errors.RobotError, match="0 joints 'shoulder_pan_joint'"):
        sm.load_robot("panda", calibration=file)
    with pytest.raises(sm.errors.RobotError, match="calibrated already"):
        sm.calibrated(line_of(sm.load_robot("ur5", calibration=file)), file)
    with pytest.raises(sm.errors.RobotError, match="by part"):
        sm.load_robot({"arm": "ur5"}, calibration=file)
    with pytest.raises(sm.errors.RobotError, match="cannot be read"):
        sm.load_robot("ur5", calibration=tmp_path / "nowhere.yaml")


def test_a_joint_is_not_given_twice(tmp_path: Path) -> None:
    file = tmp_path / "twice.yaml"
    file.write_text("offsets:\n  panda_joint2: 0.002\n  panda_joint2: 0.003\n")
    with pytest.raises(sm.errors.RobotError, match="key 'panda_joint2' is given twice"):
        sm.load_robot("panda", calibration=file)

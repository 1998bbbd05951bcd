"""URDFs that Pinocchio stumbles over, arms all the same; missing meshes; what urdfdom says."""

import importlib.metadata
import os
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from bad_urdfs import SOUND
from conftest import robot_named
from selfmotion.replay.content import page_content
from selfmotion.replay.payload import Payload
from selfmotion.robot import full_model as gate
from selfmotion.robot.urdf import parse_urdf

Q = [0.3, -0.4]
_BOX = '<geometry><box size="0.1 0.1 0.4"/></geometry></{}>'


def load(folder: Path, text: str, **options) -> sm.RobotModel:
    file = folder / "arm.urdf"
    file.write_text(text)
    return sm.load_robot(file, **options)


def with_mesh(tag: str, file: str) -> str:
    assert _BOX.format(tag) in SOUND
    mesh = f'<geometry><mesh filename="{file}"/></geometry></{tag}>'
    return SOUND.replace(_BOX.format(tag), mesh)


def plan_of(robot: sm.RobotModel) -> sm.Plan:
    stay = sm.Dwell(robot.pose(Q), 1.0)
    relaxed = [sm.Relaxation("x", 0.01)]
    return sm.plan(sm.Problem(robot, stay, "planar", Q, relaxations=relaxed))


@pytest.mark.parametrize("name", ["shoulder", "elbow", "flange", "universe"])
def test_links_may_have_the_name_of_a_joint_or_of_pinocchios_world(
    name: str, tmp_path: Path
) -> None:
    text = SOUND.replace('link name="upper"', f'link name="{name}"')
    text = text.replace('link="upper"', f'link="{name}"')
    expected, robot = load(tmp_path, SOUND), load(tmp_path, text)
    assert name in robot.urdf.links
    assert robot.joint_names == expected.joint_names
    np.testing.assert_array_equal(robot.pose(Q).homogeneous, expected.pose(Q).homogeneous)
    bodies = robot.geometry(pin.GeometryType.COLLISION).geometryObjects
    assert [robot.model.frames[body.parentFrame].name for body in bodies] == [name]
    load(tmp_path, text, tool=name, base=np.eye(4), tool_offset=np.eye(4))


def test_so100_whose_gripper_is_link_and_joint_plans_and_saves(tmp_path: Path) -> None:
    files = importlib.metadata.files("example-robot-data") or []
    (file,) = (item.locate() for item in files if item.name == "so100.urdf")
    robot = sm.load_robot(Path(str(file)), tool="gripper")
    assert (robot.dof, robot.tool) == (5, "gripper")
    start = robot.dexterous_configuration("position")
    path = sm.Line(robot.pose(start), robot.pose(start), 1.0)
    plan = sm.plan(sm.Problem(robot, path, "position", start))
    assert plan.certificate.verified, plan.certificate.verdict
    assert "self-collision" in plan.certificate.verdict
    plan.save(tmp_path / "plan.npz")
    assert sm.load_plan(tmp_path / "plan.npz").certificate.verified


@pytest.mark.parametrize(
    ("file", "reason"),
    [
        ("none.stl", "no such mesh file"),
        ("package://nowhere/a.stl", "no such mesh file"),
        ("https://host/a.stl", "not on this machine, download it"),
        ("broken.stl", "cannot be read"),
    ],
)
def test_kinematics_load_without_meshes_and_messages_name_them(
    file: str, reason: str, tmp_path: Path
) -> None:
    (tmp_path / "broken.stl").write_text("solid nothing")
    expected = load(tmp_path, SOUND).pose(Q)
    blind = load(tmp_path, with_mesh("collision", file))
    np.testing.assert_array_equal(blind.pose(Q).homogeneous, expected.homogeneous)
    with pytest.raises(sm.RobotError, match=rf"link 'upper': .*{reason}.*{Path(file).name}"):
        sm.CollisionModel(blind)
    undrawn = load(tmp_path, with_mesh("visual", file))
    geometry, missing = undrawn.visuals()
    assert len(geometry.geometryObjects) == 0
    assert len(missing) == 1
    assert reason in missing[0]


@pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")
def test_a_replay_says_what_is_not_drawn(tmp_path: Path) -> None:
    plan = plan_of(load(tmp_path, with_mesh("visual", "none.stl")))
    content = page_content([plan, plan], ["a", "b"], Payload(), triads=3)
    row = content["table"][0]
    assert row["label"] == "not drawn"
    assert "link 'upper': no such mesh file" in row["cells"][0][0]
    assert len(row["cells"]) == 2
    whole = page_content([plan_of(load(tmp_path, SOUND))], ["a"], Payload(), triads=3)
    assert whole["table"][0]["label"] == "verdict"


def test_what_urdfdom_says_is_an_error_and_the_rest_is_passed_on(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """`<dynamics>` without numbers passes the checks of elements, but not urdfdom."""
    broken = SOUND.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1"/><dynamics/>')
    with pytest.raises(sm.RobotError, match=r"not read by Pinocchio: .*\[shoulder\]"):
        load(tmp_path, broken)
    assert capfd.readouterr().err == ""

    build = pin.buildModelFromXML

    def talkative(text: str) -> pin.Model:
        os.write(2, b"something else\n")
        return build(text)

    monkeypatch.setattr(pin, "buildModelFromXML", talkative)
    urdf = parse_urdf(SOUND, source="arm", package_dirs=())
    assert gate.full_model(urdf).nq == 2
    assert capfd.readouterr().err == "something else\n"


def test_one_number_is_a_tolerance_for_both() -> None:
    sample = sm.sample_problem()
    plan = sm.plan(sample, tolerance=1e-5)
    assert plan.tolerance == sm.Tolerance(1e-5, 1e-5)
    found = sm.certify(sample.robot, sample.path, sample.task, plan.trajectory, 1e-5)
    assert found.tolerance == plan.tolerance


def test_matrices_are_poses_wherever_one_is_taken() -> None:
    pose = pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), np.array([0.4, 0.1, 0.3]))
    matrix = pose.homogeneous
    panda = robot_named("panda")
    placed = sm.load_robot("panda", base=matrix, tool_offset=matrix)
    expected = pose * panda.pose(np.zeros(7)) * pose
    np.testing.assert_allclose(
        placed.pose(np.zeros(7)).homogeneous, expected.homogeneous, atol=1e-9
    )
    for given in (
        sm.Box("box", matrix, [1, 1, 1]).pose,
        sm.Dwell(matrix, 1.0).pose(0.0),
        sm.Placed(sm.Dwell(np.eye(4), 1.0), matrix).pose(0.0),
        sm.Waypoints.from_poses([0, 1], [matrix, matrix]).pose(0.0),
        panda.pose(panda.inverse_kinematics(matrix)),
    ):
        np.testing.assert_allclose(given.homogeneous, matrix, atol=1e-9)


def test_a_start_in_collision_is_called_that() -> None:
    panda = robot_named("panda")
    home = np.array(sm.NAMED_ARMS["panda"].home)
    stay = sm.Dwell(panda.pose(home), 1.0)
    motion = sm.Trajectory([0.0, 1.0], [home] * 2, [0.0 * home] * 2, panda.joint_names)

    def verdict(at: np.ndarray) -> str:
        kept = sm.Clearance([sm.Sphere("ball", at, 0.05)], distance=0.02)
        asked = [kept.requirement(panda)]
        return sm.certify(panda, stay, "position", motion, requirements=asked).verdict

    place = panda.pose(home).translation
    assert "the start is in collision: " in verdict(place)
    assert "'ball'" in verdict(place) or "ball overlap by" in verdict(place)
    assert "the start is too near already: " in verdict(place - np.array([0.0, 0.0, 0.06]))
    assert "the start" not in verdict(place + np.array([0.0, 2.0, 0.0]))

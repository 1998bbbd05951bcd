"""URDFs that Pinocchio stumbles over, arms all the same; missing meshes; what urdfdom says."""

import importlib.metadata
import os
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.model.robot import full_model as gate
from selfmotion.model.robot.urdf import parse_urdf
from selfmotion.shell.replay.content import page_content
from selfmotion.shell.replay.meshes import Payload
from selfmotion.shell.replay.replayed import PlanReplay
from support.arms import robot_named
from support.bad_urdfs import SOUND
from support.files_of_people import finger

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
    stay = sm.paths.Dwell(robot.pose(Q), 1.0)
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
    path = sm.paths.Line(robot.pose(start), robot.pose(start), 1.0)
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
        (
            "file:///nowhere/a_description/a.stl",
            "no such mesh file here; name the folder",
        ),
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
    said = rf"link 'upper': .*{reason}.*{Path(file).name}; or .*--set clearance=false"
    with pytest.raises(sm.errors.RobotError, match=said):
        sm.obstacles.CollisionModel(blind)
    undrawn = load(tmp_path, with_mesh("visual", file))
    geometry, missing = undrawn.visuals()
    # Its collision body stands for it.
    assert len(geometry.geometryObjects) == 1
    assert reason in missing[0]
    assert "its collision bodies are drawn instead" in missing[1]


@pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")
def test_a_replay_says_what_is_not_drawn(tmp_path: Path) -> None:
    plan = plan_of(load(tmp_path, with_mesh("visual", "none.stl")))
    content = page_content([PlanReplay(plan), PlanReplay(plan)], ["a", "b"], Payload(), triads=3)
    row = content["table"][0]
    assert row["label"] == "not drawn"
    assert "link 'upper': no such mesh file" in row["cells"][0][0]
    assert len(row["cells"]) == 2
    whole = page_content([PlanReplay(plan_of(load(tmp_path, SOUND)))], ["a"], Payload(), triads=3)
    assert whole["table"][0]["label"] == "verdict"


def test_what_urdfdom_says_is_an_error_and_the_rest_is_passed_on(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """`<dynamics>` without numbers passes the checks of elements, but not urdfdom."""
    broken = SOUND.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1"/><dynamics/>')
    with pytest.raises(sm.errors.RobotError, match=r"not read by Pinocchio: .*\[shoulder\]"):
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
        sm.obstacles.Box("box", matrix, [1, 1, 1]).pose,
        sm.paths.Dwell(matrix, 1.0).pose(0.0),
        sm.paths.Placed(sm.paths.Dwell(np.eye(4), 1.0), matrix).pose(0.0),
        sm.paths.Waypoints.from_poses([0, 1], [matrix, matrix]).pose(0.0),
        panda.pose(panda.inverse_kinematics(matrix)),
    ):
        np.testing.assert_allclose(given.homogeneous, matrix, atol=1e-9)


FINGERS = "".join(
    f'<link name="f_{name}"><collision><geometry><box size="0.02 0.02 0.05"/></geometry>'
    f'</collision></link><joint name="g_{name}" type="prismatic"><parent link="l2"/>'
    f'<child link="f_{name}"/><origin xyz="0 {0.03 * side} 0.1"/><axis xyz="0 {side} 0"/>'
    f'<limit lower="0" upper="0.3" velocity="1" effort="1"/>{mimic}</joint>'
    for name, side, mimic in (("left", 1, ""), ("right", -1, '<mimic joint="g_left"/>'))
)


def test_a_locked_joint_moves_the_one_that_mimics_it(tmp_path: Path) -> None:
    joints = "".join(
        f'<link name="l{k}"/><joint name="j{k}" type="revolute"><parent link="l{k - 1}"/>'
        f'<child link="l{k}"/><origin xyz="0 0 0.3"/><axis xyz="0 0 1"/>'
        f'<limit lower="-2" upper="2" velocity="1" effort="1"/></joint>'
        for k in (1, 2)
    )
    file = tmp_path / "gripper.urdf"
    file.write_text(f'<robot name="g"><link name="l0"/>{joints}{FINGERS}</robot>')
    robot = sm.load_robot(file, "l2", {"g_left": 0.3})
    assert robot.locked == {"g_left": 0.3, "g_right": 0.3}
    model = sm.obstacles.CollisionModel(
        robot, [sm.obstacles.Sphere("ball", [0.0, -0.33, 0.7], 0.03)]
    )
    assert model.distance([0.0, 0.0]).value < 0.0
    with pytest.raises(sm.errors.RobotError, match=r"it mimics 'g_left' and is at 0\.3"):
        sm.load_robot(file, "l2", {"g_left": 0.3, "g_right": 0.0})


def test_a_loop_of_links_beside_the_tree_is_refused(tmp_path: Path) -> None:
    loop = "".join(
        f'<joint name="k{one}" type="fixed"><parent link="z{one}"/><child link="z{two}"/></joint>'
        for one, two in ((1, 2), (2, 1))
    )
    file = tmp_path / "island.urdf"
    file.write_text(
        '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="continuous">'
        '<parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint><link name="z1"/>'
        f'<link name="z2"/>{loop}</robot>'
    )
    with pytest.raises(sm.errors.RobotError, match="its joints form a loop"):
        sm.load_robot(file, tool="z1")


ONE_JOINT = (
    '<robot name="r"><link name="a"/><link name="{link}"/><joint name="j" type="revolute">'
    '<parent link="a"/><child link="{link}"/><axis xyz="0 0 1"/>{limit}</joint></robot>'
)


LIMIT = '<limit lower="-1" upper="1" velocity="1" effort="1"/>'


@pytest.mark.parametrize(
    ("link", "limit", "message"),
    [
        (
            "b",
            LIMIT.replace('"-1"', '"-inf"'),
            "joint 'j': <limit>: lower is \"-inf\", expected a number",
        ),
    ],
)
def test_urdfs_that_pinocchio_stumbles_over_are_refused_by_name(
    tmp_path: Path, link: str, limit: str, message: str
) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text(ONE_JOINT.format(link=link, limit=limit))
    with pytest.raises(sm.errors.RobotError, match=message):
        sm.load_robot(file)


@pytest.mark.parametrize(
    ("head", "encoding"),
    [
        ('<?xml version="1.0" encoding="ISO-8859-1"?>', "latin-1"),
        ('<?xml version="1.0" encoding="utf-16"?>', "utf-16"),
        ('<?xml version="1.0"?>', "utf-8-sig"),
        ('\n\n<?xml version="1.0"?>', "utf-8"),
    ],
)
def test_a_file_is_read_in_the_letters_that_it_says(
    head: str, encoding: str, tmp_path: Path
) -> None:
    file = tmp_path / "arm.urdf"
    text = f"{head}<!-- für Träger -->{finger()}".replace("finger", "möbel")
    file.write_bytes(text.encode(encoding))
    arm = sm.load_robot(file, tool="tip")
    assert arm.name == "möbel"
    assert arm.dof == 4


def test_an_arm_of_one_joint_is_an_arm(tmp_path: Path) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text(ONE_JOINT.format(link="b", limit=LIMIT))
    robot = sm.load_robot(file)
    assert robot.jacobian([0.3]).shape == (6, 1)
    assert robot.redundancy("position") == 1
    path = sm.paths.Waypoints.from_poses([0.0, 1.0], [robot.pose([0.3])] * 2)
    motion = sm.Trajectory([0.0, 1.0], [[0.3], [0.3]], [[0.0], [0.0]], robot.joint_names)
    assert sm.certify(robot, path, "pose", motion).verified

"""What is a pair: bodies fixed across a joint, bodies that held joints place, none at all."""

import re
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import trimesh

import selfmotion as sm
from selfmotion.basics import Array
from support.arms import robot_named

BOXES = {
    "base": ("0.1 0.1 0.1", "0 0 -0.3"),
    "l1": ("0.3 0.04 0.04", "0.17 0 0"),
    "l2": ("0.3 0.04 0.04", "0.17 0 0"),
    "l3": ("0.2 0.04 0.04", "0.12 0 0"),
    "camera": ("0.04 0.04 0.2", "0 0 0"),
    "l4": ("0.1 0.04 0.04", "0.07 0 0"),
    "torch": ("0.3 0.02 0.02", "0.15 0 0"),
    "tcp": None,
}
TURNS = (("base", "l1", "0"), ("l1", "l2", "0.35"), ("l2", "l3", "0.35"), ("l3", "l4", "0.25"))
FIXED = (("l3", "camera", "0.12 0.12 0"), ("l4", "torch", "0.12 0 0"), ("torch", "tcp", "0.3 0 0"))


def torch_urdf(bodies: set[str], velocity: float = 3.0, effort: float = 100.0) -> str:
    """A planar arm with a torch fixed to the last link, and a camera to the one before."""
    parts = []
    inertia = 'ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"'
    for name, box in BOXES.items():
        body = ""
        if box is not None and name in bodies:
            size, place = box
            shape = f'<geometry><box size="{size}"/></geometry>'
            body = f'<collision><origin xyz="{place}"/>{shape}</collision>'
        mass = f'<inertial><mass value="1"/><inertia {inertia}/></inertial>'
        parts.append(f'<link name="{name}">{mass}{body}</link>')
    limit = f'<limit lower="-3.1" upper="3.1" velocity="{velocity}" effort="{effort}"/>'
    for k, (parent, child, x) in enumerate(TURNS, 1):
        ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{x} 0 0"/>'
        parts.append(f'<joint name="j{k}" type="revolute">{ends}<axis xyz="0 0 1"/>{limit}</joint>')
    for parent, child, place in FIXED:
        ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{place}"/>'
        parts.append(f'<joint name="to_{child}" type="fixed">{ends}</joint>')
    return f'<robot name="torch4">{"".join(parts)}</robot>'


def arm(folder: Path, bodies: set[str] | None = None, **options: float) -> sm.RobotModel:
    file = folder / "torch4.urdf"
    file.write_text(torch_urdf(set(BOXES) if bodies is None else bodies, **options))
    return sm.load_robot(file, "tcp")


def sweep(robot: sm.RobotModel, first: Array, last: Array) -> tuple[sm.paths.Path, sm.Trajectory]:
    t = np.linspace(0.0, 4.0, 60)
    u = t[:, None] / 4.0
    q = first + (last - first) * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    qd = (last - first) * 30.0 * (u * (1.0 - u)) ** 2 / 4.0
    path = sm.paths.Waypoints(t, [robot.pose(each).translation for each in q])
    return path, sm.Trajectory(t, q, qd, robot.joint_names)


def test_what_is_fixed_across_a_joint_is_judged(tmp_path: Path) -> None:
    """The torch sweeps through the camera; only the two links that the joint joins are no pair."""
    robot = arm(tmp_path)
    pairs = {frozenset(pair) for pair in sm.obstacles.CollisionModel(robot).pairs}
    wanted = (("camera", "torch"), ("camera", "l4"), ("l3", "torch"))
    assert {frozenset(pair) for pair in wanted} <= pairs
    assert frozenset(("l3", "l4")) not in pairs
    path, motion = sweep(robot, np.array([0.3, 0.6, -0.9, 2.0]), np.array([0.3, 0.6, -0.9, 2.8]))
    kept = sm.constraints.Clearance(distance=0.0).requirement(robot)
    found = sm.certify(robot, path, "planar", motion, 1.0, [kept])
    assert not found.verified
    assert re.search("camera - torch|torch - camera", found.verdict)


def test_links_that_held_joints_put_into_each_other_are_told(tmp_path: Path) -> None:
    """Held at two thirds of a turn, a link lies on the one before the one that it hangs on."""
    parts = [
        f'<link name="l{k}"><collision><origin xyz="0.17 0 0"/><geometry>'
        '<box size="0.3 0.04 0.04"/></geometry></collision></link>'
        for k in range(1, 7)
    ]
    limit = '<limit lower="-3.1" upper="3.1" velocity="3" effort="100"/>'
    for k in range(6):
        ends = f'<parent link="l{k}"/><child link="l{k + 1}"/><origin xyz="{0.35 * (k > 0)} 0 0"/>'
        parts.append(
            f'<joint name="j{k + 1}" type="revolute">{ends}<axis xyz="0 0 1"/>{limit}</joint>'
        )
    file = tmp_path / "six.urdf"
    file.write_text(f'<robot name="six"><link name="l0"/>{"".join(parts)}</robot>')
    for angle, is_kept in ((2.0944, False), (1.0, True)):
        robot = sm.load_robot(file, "l6", lock={"j5": angle, "j6": angle})
        q = np.array([0.3, 0.5, -0.6, 0.7])
        path = sm.paths.Dwell(robot.pose(q), 1.0)
        motion = sm.Trajectory([0.0, 1.0], [q, q], np.zeros((2, 4)), robot.joint_names)
        kept = sm.constraints.Clearance(distance=0.0).requirement(robot)
        found = sm.certify(robot, path, "planar", motion, requirements=[kept])
        assert found.verified is is_kept, found.verdict
        assert (
            "joints that are held, or places of parts, put l4 - l6 4.02 mm into each other"
            in found.verdict
        ) is (not is_kept)


@pytest.mark.parametrize("bodies", [{"base"}, {"l4", "torch"}, set(BOXES)])
def test_what_no_pair_measures_is_not_covered(tmp_path: Path, bodies: set[str]) -> None:
    robot = arm(tmp_path, bodies)
    kept = sm.constraints.Clearance(distance=0.0).requirement(robot)
    assert ("self-collision" in kept.covers) is (len(bodies) > 2)
    assert ("nothing was measured" in " ".join(kept.remarks)) is (len(bodies) <= 2)
    wall = sm.obstacles.Box("wall", [9.0, 9.0, 9.0], [0.1] * 3)
    if bodies == {"base"}:
        with pytest.raises(
            sm.errors.ProblemError, match="no link that moves has collision geometry"
        ):
            sm.constraints.Clearance([wall]).requirement(robot)
    else:
        assert "obstacles" in sm.constraints.Clearance([wall]).requirement(robot).covers


def test_what_has_no_limit_is_not_kept(tmp_path: Path) -> None:
    robot = arm(tmp_path, velocity=0.0, effort=0.0)
    q = np.array([0.3, 0.6, -0.9, 1.0])
    motion = sm.Trajectory([0.0, 1.0], [q, q], np.zeros((2, 4)), robot.joint_names)
    torques = sm.constraints.JointTorqueLimits().requirement(robot)
    path = sm.paths.Dwell(robot.pose(q), 1.0)
    found = sm.certify(robot, path, "planar", motion, requirements=[torques])
    assert not {"speeds", "torques"} & set(found.covers)
    assert "speeds" in found.not_checked
    assert re.search(r"not limited: torque of joint 'j1'", " ".join(found.remarks))
    assert "joint velocity limits: 4 of 4 joints are not limited" in found.remarks


def test_nobody_moves_what_was_judged() -> None:
    box = sm.obstacles.Box("b", [2.0, 2.0, 2.0], [0.2] * 3)
    line = sm.paths.Line(pin.SE3.Identity(), pin.SE3(np.eye(3), np.array([0.1, 0.0, 0.0])), 3.0)
    for pose in (box.pose, line.start, sm.paths.Dwell(box.pose, 1.0).at):
        before = pose.homogeneous.copy()
        with pytest.raises(AttributeError):
            pose.translation = np.ones(3)
        with pytest.raises(ValueError, match="read-only"):
            pose.translation[0] = 9.0
        with pytest.raises(ValueError, match="read-only"):
            pose.rotation[0, 0] = 9.0
        with pytest.raises(AttributeError, match="cannot be changed"):
            pose.setRandom()
        np.testing.assert_array_equal(pose.homogeneous, before)
        assert isinstance(pose * pose.inverse(), pin.SE3)


def test_a_mesh_in_millimetres_is_refused(tmp_path: Path) -> None:
    """As an obstacle, and as a body of the tool."""
    post = trimesh.creation.box((100.0, 100.0, 1200.0))
    post.apply_translation([400.0, 400.0, 600.0])
    post.export(tmp_path / "post.stl")
    panda = robot_named("panda")
    for scale, said in ((1.0, True), (1e-3, False)):
        mesh = sm.obstacles.Mesh("post", [0.0] * 3, str(tmp_path / "post.stl"), scale=scale)
        for use in (
            lambda mesh: sm.constraints.Clearance([mesh]).requirement(panda),
            lambda mesh: sm.load_robot("panda", bodies=[mesh]),
        ):
            with (
                pytest.raises(
                    sm.errors.CollisionError, match=r"is 1\.2e\+03 m long: scale = 0\.001"
                )
                if said
                else nullcontext()
            ):
                use(mesh)


def test_an_obstacle_placed_in_millimetres_gets_a_hint() -> None:
    panda = robot_named("panda")
    for far, said in ((400.0, True), (0.4, False)):
        post = sm.obstacles.Box("post", [far, far, 0.6], [0.1, 0.1, 1.2])
        remarks = sm.constraints.Clearance([post]).requirement(panda).remarks
        assert any("millimetres?" in text for text in remarks) is said


def test_links_that_mostly_overlap_are_told_before_planning(tmp_path: Path) -> None:
    """A camera so long that it meets the torch in most configurations, but not in all."""
    text = torch_urdf(set(BOXES)).replace("0.04 0.04 0.2", "0.5 0.36 0.2")
    (tmp_path / "long.urdf").write_text(text)
    robot = sm.load_robot(tmp_path / "long.urdf", "tcp")
    q = np.array([0.3, 0.6, -0.9, 1.0])
    problem = sm.Problem(robot, sm.paths.Dwell(robot.pose(q), 1.0), task="planar", start=q)
    model = sm.obstacles.CollisionModel(robot)
    mostly = {frozenset((x.first, x.second)) for x in model.overlapping if x.is_checked}
    assert mostly
    for pair in mostly:
        first, second = pair
        assert any(
            f"{a} - {b}: these links overlap in " in text and "<disable_collisions" in text
            for text in problem.remarks
            for a, b in ((first, second), (second, first))
        )
    panda = robot_named("panda")
    home = panda.dexterous_configuration()
    assert sm.Problem(panda, sm.paths.Dwell(panda.pose(home), 1.0), start=home).remarks == ()

"""Loading arms; forward kinematics against yourdfpy; refusals."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy

import selfmotion as sm
from selfmotion.robot import NAMED_ARMS

# Two independent implementations of the same products of rotations.
FORWARD_KINEMATICS = 1e-9

PLANAR = Path(sm.load_robot("planar_3r").urdf.source)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_forward_kinematics_equals_yourdfpy(robot: sm.RobotModel) -> None:
    oracle = yourdfpy.URDF.load(robot.urdf.source, load_meshes=False, build_scene_graph=True)
    rng = np.random.default_rng(1)
    lower, upper = robot.finite_limits()
    for _ in range(5):
        q = rng.uniform(lower, upper)
        values = dict(zip(robot.joint_names, q, strict=True)) | dict(robot.locked)
        oracle.update_cfg([values.get(name, 0.0) for name in oracle.actuated_joint_names])
        expected = oracle.get_transform(robot.tool, oracle.base_link)
        np.testing.assert_allclose(
            robot.pose(q).homogeneous, expected, rtol=0, atol=FORWARD_KINEMATICS
        )


def test_jacobian_is_the_derivative_of_the_pose(robot: sm.RobotModel) -> None:
    rng = np.random.default_rng(2)
    q, qd = robot.dexterous_configuration("position"), rng.normal(size=robot.dof)
    h = 1e-6
    before, after = robot.pose(q - h * qd), robot.pose(q + h * qd)
    linear = (after.translation - before.translation) / (2 * h)
    angular = pin.log3(after.rotation @ before.rotation.T) / (2 * h)
    twist = np.concatenate([linear, angular])
    np.testing.assert_allclose(robot.jacobian(q) @ qd, twist, atol=1e-8)


def test_every_joint_has_one_coordinate(robot: sm.RobotModel) -> None:
    assert robot.model.nq == robot.model.nv == robot.dof == len(robot.joint_names)
    assert robot.lower.shape == robot.upper.shape == robot.velocity_limit.shape == (robot.dof,)
    assert np.all(robot.lower < robot.upper)
    with pytest.raises(ValueError, match="read-only"):
        robot.lower[0] = 0.0


def test_continuous_joints_turn_without_limits() -> None:
    kinova = sm.load_robot("kinova")
    assert np.isinf(kinova.upper).tolist() == [True, False, False, True, False, True]
    q = kinova.dexterous_configuration("position")
    turned = q + np.array([2, 0, 0, -2, 0, 4]) * np.pi
    np.testing.assert_allclose(
        kinova.pose(q).homogeneous, kinova.pose(turned).homogeneous, atol=1e-12
    )


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
    with pytest.raises(sm.InverseKinematicsError, match=r"misses by 1 m") as caught:
        planar.inverse_kinematics(pin.SE3(np.eye(3), np.array([6.0, 0, 0])), "planar", attempts=5)
    assert caught.value.position_miss == pytest.approx(1.0)


def test_lock_holds_a_joint() -> None:
    tiago = sm.load_robot("tiago", lock={"torso_lift_joint": 0.2})
    assert tiago.dof == 7
    free = sm.load_robot("tiago")
    q = tiago.dexterous_configuration("pose")
    np.testing.assert_allclose(
        tiago.pose(q).homogeneous, free.pose(np.append(0.2, q)).homogeneous, atol=1e-12
    )


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>', r"joint 'joint1' has axis"),
        ('lower="-6.283185307179586"', 'lower="7"', r"joint 'joint1' has reversed limits"),
        ('<mass value="4"/>', '<mass value="-4"/>', r"link 'link1' has a negative mass"),
        ('<child link="link2"/>', '<child link="link1"/>', r"link 'link1' has two parents"),
        ('<child link="link3"/>', '<child link="link9"/>', r"link 'link9', which does not exist"),
        ('type="revolute"', 'type="planar"', r"joint 'joint1' is planar"),
        ('type="revolute"', 'type="hinge"', r"joint 'joint1' has type 'hinge'"),
        ('name="joint2"', 'name="joint1"', r"joint name 'joint1' is used more than once"),
        ("</robot>", "", r"not well-formed XML"),
        ("robot", "model", r"expected <robot>"),
        ('<limit lower="-6', '<mimic joint="joint3"/><limit lower="-6', r"mimics 'joint3'"),
    ],
)
def test_broken_urdfs_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = PLANAR.read_text()
    assert old in text
    file = tmp_path / "broken.urdf"
    file.write_text(text.replace(old, new) if old == "robot" else text.replace(old, new, 1))
    with pytest.raises(sm.RobotError, match=message):
        sm.load_robot(file)


def test_a_sound_copy_is_accepted(tmp_path: Path) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text(PLANAR.read_text())
    assert sm.load_robot(file).tool == "tool"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: sm.load_robot("pandaa"), "unknown robot 'pandaa'"),
        (lambda: sm.load_robot("nowhere.urdf"), "no such URDF file"),
        (lambda: sm.load_robot("panda", tool="hand"), "no link 'hand'"),
        (lambda: sm.load_robot("panda", lock={"joint9": 0.0}), "'joint9', which is not movable"),
        (
            lambda: sm.load_robot("panda", lock={"panda_joint1": np.nan}),
            r"lock\['panda_joint1'\] is nan",
        ),
        (lambda: sm.load_robot("panda").pose([0.0] * 6), r"shape \(6,\), expected \(7,\)"),
        (lambda: sm.load_robot("panda").pose([np.nan] * 7), "'panda_joint1' is nan"),
        (lambda: sm.load_robot(Path(sm.load_robot("panda").urdf.source)), "3 end links"),
    ],
)
def test_bad_requests_are_refused(call, message: str) -> None:
    with pytest.raises(sm.RobotError, match=message):
        call()


@pytest.mark.parametrize("kind", [pin.GeometryType.VISUAL, pin.GeometryType.COLLISION])
def test_geometry_hangs_on_the_chain(panda: sm.RobotModel, kind: pin.GeometryType) -> None:
    geometry = panda.geometry(kind)
    assert len(geometry.geometryObjects) > 8
    assert all(item.parentJoint <= panda.dof for item in geometry.geometryObjects)

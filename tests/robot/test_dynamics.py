"""Torques, against a recursion of our own on yourdfpy's data."""

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy

import selfmotion as sm
from selfmotion.model.robot import Dynamics
from support.arms import robot_named
from support.circles import upright_circle

GRAVITY = np.array([0.0, 0.0, -9.81])


# Sums of some hundred products of numbers up to 100 Nm.
EQUAL = 1e-8


def held(urdf: yourdfpy.URDF, root: str, robot: sm.RobotModel) -> list[tuple[np.ndarray, str]]:
    """Return the links that move as one with `root`: their places in its frame, and names."""
    found = [(np.eye(4), root)]
    for joint in urdf.robot.joints:
        if joint.name in robot.joint_names:
            continue
        for place, name in list(found):
            if joint.parent == name:
                at = np.eye(4) if joint.origin is None else joint.origin
                q = robot.locked.get(joint.name, 0.0)
                turn = np.eye(4)
                if joint.type in ("revolute", "continuous"):
                    turn[:3, :3] = pin.exp3(q * np.array(joint.axis))
                elif joint.type == "prismatic":
                    turn[:3, 3] = q * np.array(joint.axis)
                found.append((place @ at @ turn, joint.child))
    return found


def newton_euler(
    robot: sm.RobotModel,
    q: np.ndarray,
    qd: np.ndarray,
    qdd: np.ndarray,
    payload: tuple[float, np.ndarray, np.ndarray] | None = None,
) -> np.ndarray:
    """Return joint torques, body by body in world axes: forces of all masses beyond each joint."""
    bare = {"load_meshes": False, "build_scene_graph": False, "build_collision_scene_graph": False}
    urdf = yourdfpy.URDF.load(robot.urdf.source, **bare)
    links = {link.name: link for link in urdf.robot.links}
    by_name = {joint.name: joint for joint in urdf.robot.joints}
    parents = {joint.child: joint for joint in urdf.robot.joints}
    axes, points, forces, moments = [], [], [], []
    omega, alpha, at, acceleration = np.zeros(3), np.zeros(3), np.zeros(3), -GRAVITY
    place = np.eye(4)
    for k, name in enumerate(robot.joint_names):
        joint = by_name[name]
        # From the carrier of the last joint to this one, over fixed and held joints.
        way, link = [joint.origin if joint.origin is not None else np.eye(4)], joint.parent
        stop = by_name[robot.joint_names[k - 1]].child if k else None
        while link != stop and link in parents:
            over = parents[link]
            way.append(np.eye(4) if over.origin is None else over.origin)
            link = over.parent
        for step in reversed(way):
            place = place @ step
        axis = place[:3, :3] @ np.array(joint.axis)
        arm = place[:3, 3] - at
        acceleration = acceleration + np.cross(alpha, arm) + np.cross(omega, np.cross(omega, arm))
        at = place[:3, 3].copy()
        alpha = alpha + axis * qdd[k] + np.cross(omega, axis * qd[k])
        omega = omega + axis * qd[k]
        place = place.copy()
        place[:3, :3] = place[:3, :3] @ pin.exp3(q[k] * np.array(joint.axis))
        axes.append(axis)
        points.append(at)
        force, moment = np.zeros(3), np.zeros(3)
        bodies = []
        for relative, inner in held(urdf, joint.child, robot):
            inertial = links[inner].inertial
            if inertial is not None:
                own = np.eye(4) if inertial.origin is None else inertial.origin
                bodies.append((place @ relative @ own, inertial.mass, inertial.inertia))
            if inner == robot.tool and payload is not None:
                mass, center, turning = payload
                own = np.eye(4)
                own[:3, 3] = center
                bodies.append((place @ relative @ own, mass, turning))
        for pose, mass, turning in bodies:
            rest = pose[:3, 3] - at
            linear = acceleration + np.cross(alpha, rest) + np.cross(omega, np.cross(omega, rest))
            world = pose[:3, :3] @ turning @ pose[:3, :3].T
            force = force + mass * linear
            moment = moment + np.cross(rest, mass * linear)
            moment = moment + world @ alpha + np.cross(omega, world @ omega)
        forces.append(force)
        moments.append(moment)
    return np.array(
        [
            axes[k]
            @ sum(
                moments[j] + np.cross(points[j] - points[k], forces[j]) for j in range(k, len(axes))
            )
            for k in range(len(axes))
        ]
    )


@pytest.mark.parametrize("name", ["panda", "xarm7", "ur5"])
@pytest.mark.parametrize("loaded", [False, True])
def test_torques_equal_those_of_another_recursion(name: str, loaded: bool) -> None:
    robot, rng = robot_named(name), np.random.default_rng(3)
    box = np.diag([0.02, 0.03, 0.04])
    payload = (2.5, np.array([0.02, -0.05, 0.1]), box) if loaded else None
    dynamics = Dynamics(robot, *payload) if payload else Dynamics(robot)
    lower, upper = robot.finite_limits()
    for _ in range(20):
        q = rng.uniform(lower, upper)
        qd, qdd = rng.normal(size=(2, robot.dof))
        found = dynamics.torques(q[None], qd[None], qdd[None])[0]
        np.testing.assert_allclose(
            found, newton_euler(robot, q, qd, qdd, payload), rtol=0, atol=EQUAL
        )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"payload": -1.0}, "payload is -1.0 kg"),
        ({"center": [0.0, np.nan, 0.0]}, "center is"),
        ({"inertia": np.diag([1.0, -1.0, 1.0])}, "moments ≥ 0"),
        ({"limit": 0.0}, "joint torque limits"),
    ],
)
def test_payloads_that_make_no_sense(panda: sm.RobotModel, options: dict, message: str) -> None:
    with pytest.raises(sm.errors.ProblemError, match=message):
        upright_circle(panda, constraints=[sm.constraints.JointTorqueLimits(**options)])


def test_an_arm_without_masses_is_refused(panda: sm.RobotModel, tmp_path: Path) -> None:
    bare = re.sub(r"<inertial>.*?</inertial>", "", panda.urdf.text, flags=re.DOTALL)
    bare = re.sub(r"<(visual|collision)>.*?</\1>", "", bare, flags=re.DOTALL)
    (tmp_path / "bare.urdf").write_text(bare)
    robot = sm.load_robot(tmp_path / "bare.urdf", tool=panda.tool)
    with pytest.raises(sm.errors.ProblemError, match="gives no masses"):
        upright_circle(robot, constraints=[sm.constraints.JointTorqueLimits()])


def test_inertias_of_products_and_of_rods_are_taken() -> None:
    """R I Rᵀ is symmetric up to rounding, and a rod's least moment 0 up to it."""
    from scipy.spatial.transform import Rotation

    rng, robot = np.random.default_rng(0), robot_named("panda")
    for turn in Rotation.random(20, rng=rng).as_matrix():
        for moments in ([0.0, 0.02, 0.02], rng.uniform(0.01, 0.02, 3)):
            Dynamics(robot, 1.0, inertia=turn @ np.diag(moments) @ turn.T)
    for wrong in (np.diag([0.02, 0.02, -1e-6]), [[0.02, 1e-6, 0], [0, 0.02, 0], [0, 0, 0.02]]):
        with pytest.raises(sm.errors.ProblemError, match="is not symmetric with moments"):
            Dynamics(robot, 1.0, inertia=wrong)

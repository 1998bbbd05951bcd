"""Forward kinematics against yourdfpy, coordinates, locks."""

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy

import selfmotion as sm

# Two independent implementations of the same products of rotations.
FORWARD_KINEMATICS = 1e-9


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


def test_lock_holds_a_joint() -> None:
    tiago = sm.load_robot("tiago", lock={"torso_lift_joint": 0.2})
    assert tiago.dof == 7
    free = sm.load_robot("tiago")
    q = tiago.dexterous_configuration("pose")
    np.testing.assert_allclose(
        tiago.pose(q).homogeneous, free.pose(np.append(0.2, q)).homogeneous, atol=1e-12
    )


@pytest.mark.parametrize("kind", [pin.GeometryType.VISUAL, pin.GeometryType.COLLISION])
def test_geometry_hangs_on_the_chain(panda: sm.RobotModel, kind: pin.GeometryType) -> None:
    geometry = panda.geometry(kind)
    assert len(geometry.geometryObjects) > 8
    assert all(item.parentJoint <= panda.dof for item in geometry.geometryObjects)

"""Joints that mimic others: one coordinate in kinematics, derivatives, dynamics and bodies."""

import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yourdfpy

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.certificate import path_error
from selfmotion.model.motion import NullMotionTable, PolynomialNullMotion
from selfmotion.model.robot import Dynamics, Energy, ToolRates
from selfmotion.model.robot.tree_arrays import JOINT
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.rollout import FixedStart
from support.arms import Case, central_difference, objective_of, short_line
from support.files_of_people import finger, torso
from support.nodes import around_of, centred, moved, nodes_of, problem_of, random_step
from support.rollouts import assert_sensitivities, rollout_of

# Against other libraries' products of rotations, and differences [m, rad].
EXACT, DIFFERENCE, STEP = 1e-12, 2e-7, 1e-6
CASES = {"finger": ("side", finger()), "telescope": ("side", finger(telescope=True)),
         "torso": ("left7", torso())}  # fmt: skip


@pytest.fixture(scope="module", params=CASES)
def robot(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> sm.RobotModel:
    tool, text = CASES[request.param]
    file = tmp_path_factory.mktemp("coupled") / f"{request.param}.urdf"
    file.write_text(text)
    return sm.load_robot(file, tool=tool)


def drawn(robot: sm.RobotModel, count: int = 5) -> Array:
    lower, upper = robot.finite_limits()
    return np.random.default_rng(0).uniform(lower, upper, (count, robot.dof))


def differences(function, q: Array) -> Array:
    """Return ∂function/∂q at q (n,), the joints last."""
    steps = STEP * np.eye(len(q))
    return np.stack([(function(q + e) - function(q - e)) / (2.0 * STEP) for e in steps], axis=-1)


def test_the_finger_is_where_a_product_of_rotations_puts_it(tmp_path: Path) -> None:
    file = tmp_path / "finger.urdf"
    file.write_text(finger())
    arm = sm.load_robot(file, tool="tip")
    assert arm.joint_names == ("j1", "j2", "j3", "j5")
    radius = 0.5 * np.cos(0.4) + 0.3 * np.cos(0.9)
    height = 0.4 - 0.5 * np.sin(0.4) - 0.3 * np.sin(0.9)
    place = arm.pose([0.3, 0.4, 0.5, 0.2]).translation
    wanted = [radius * np.cos(0.3), radius * np.sin(0.3), height]
    np.testing.assert_allclose(place, wanted, atol=EXACT)
    np.testing.assert_allclose(place, [0.6181, 0.1912, -0.0297], atol=5e-5)


def test_all_links_are_where_yourdfpy_puts_them(robot: sm.RobotModel) -> None:
    other = yourdfpy.URDF.load(robot.urdf.source, load_meshes=False)
    for q in drawn(robot):
        joints = {name: float(x[0]) for name, x in robot.all_joints(q[None]).items()}
        other.update_cfg(
            {**robot.locked, **{n: x for n, x in zip(robot.joint_names, q, strict=True)}}
        )
        for link in robot.urdf.links:
            wanted = other.get_transform(link, robot.urdf.root)
            np.testing.assert_allclose(
                robot.chain_to(link).place(q).homogeneous, wanted, atol=EXACT
            )
        for name, joint in robot.urdf.joints.items():
            if joint.mimics is not None and name in joints:
                expected = joint.multiplier * joints[joint.mimics] + joint.offset
                assert joints[name] == pytest.approx(expected, abs=EXACT)


def test_all_kinematics_agree_with_differences(robot: sm.RobotModel) -> None:
    for q in drawn(robot, 3):
        slopes = differences(lambda x: robot.pose(x).translation, q)
        jacobian = robot.jacobian(q)
        np.testing.assert_allclose(jacobian[:3], slopes, atol=DIFFERENCE)
        along, rotations, places = robot.chain.along(q[None])
        np.testing.assert_allclose(along[0], jacobian, atol=EXACT)
        np.testing.assert_allclose(places[0], robot.pose(q).translation, atol=EXACT)
        # The certificate's own, and that of every joint on its own.
        np.testing.assert_allclose(
            path_error.jacobians(robot.chain, q[None])[0][0], jacobian, atol=EXACT
        )
        np.testing.assert_allclose(path_error.poses(robot.chain, q[None])[0], rotations, atol=EXACT)
        every = robot.chain.every_along(q[None])[0]
        whole = np.zeros_like(jacobian)
        own = robot.chain.table[:-1, JOINT, 0].astype(int)
        np.add.at(whole.T, own, every.T)
        np.testing.assert_allclose(whole, jacobian, atol=EXACT)


def test_velocities_and_accelerations_agree_with_differences(robot: sm.RobotModel) -> None:
    rates, rng = ToolRates(robot.chain), np.random.default_rng(1)
    for q in drawn(robot, 2):
        qd, qdd = rng.normal(size=(2, robot.dof))
        velocity, acceleration = (x[0] for x in rates(q[None], qd[None], qdd[None]))
        turn = robot.pose(q).rotation
        np.testing.assert_allclose(turn @ velocity[:3], robot.jacobian(q)[:3] @ qd, atol=EXACT)

        def moving(t: float, q: Array = q, qd: Array = qd, qdd: Array = qdd) -> Array:
            return robot.pose(q + t * qd + 0.5 * t * t * qdd).translation

        step = 1e-4
        second = (moving(step) - 2.0 * moving(0.0) + moving(-step)) / step**2
        np.testing.assert_allclose(turn @ acceleration[:3], second, atol=1e-5)
        (v_by_q, v_by_qd), (a_by_q, _, _) = rates.derivatives(q[None], qd[None], qdd[None])
        for order, found in ((0, v_by_q), (1, a_by_q)):
            slopes = differences(
                lambda x, k=order, v=qd, a=qdd: rates(x[None], v[None], a[None])[k][0], q
            )
            np.testing.assert_allclose(found[0], slopes, atol=1e-6)
        np.testing.assert_allclose(v_by_qd[0] @ qd, velocity, atol=EXACT)


def test_torques_are_those_of_the_energies(robot: sm.RobotModel) -> None:
    """Lagrange's equations, of energies summed over the links by their own places."""
    dynamics, energy, rng = Dynamics(robot), Energy(robot), np.random.default_rng(2)
    centres = []
    for link in ElementTree.fromstring(robot.urdf.text).findall("link"):
        for inertial in link.findall("inertial"):
            at = [float(x) for x in inertial.find("origin").get("xyz").split()]
            mass = float(inertial.find("mass").get("value"))
            centres.append((link.get("name"), mass, np.array(at)))

    def potential(q: Array) -> float:
        return 9.81 * sum(m * robot.chain_to(link).place(q).act(at)[2] for link, m, at in centres)

    for q in drawn(robot, 2):
        qd, qdd = rng.normal(size=(2, robot.dof))
        slopes = differences(lambda x: np.array(potential(x)), q)
        np.testing.assert_allclose(energy.gravity(q[None])[0], slopes, atol=1e-6)
        kinetic = energy.kinetic(q[None], qd[None])[0]
        assert kinetic == pytest.approx(0.5 * qd @ energy.mass(q) @ qd, rel=1e-10)
        still = dynamics.torques(q[None], 0 * qd[None], qdd[None])[0]
        np.testing.assert_allclose(still - slopes, energy.mass(q) @ qdd, atol=1e-6)
        whole = dynamics.torques(q[None], qd[None], qdd[None])[0]
        # d/dt ∂T/∂q̇ - ∂T/∂q + ∂V/∂q.
        by_q = differences(lambda x, v=qd: energy.kinetic(x[None], v[None])[0], q)
        along = sum(
            differences(lambda x, k=k, v=qd: energy.mass(x)[k] @ v, q) @ qd * np.eye(robot.dof)[k]
            for k in range(robot.dof)
        )
        np.testing.assert_allclose(whole, energy.mass(q) @ qdd + along - by_q + slopes, atol=1e-5)
        found = dynamics.derivatives(q[None], qd[None], qdd[None])
        by_place = differences(
            lambda x, v=qd, a=qdd: dynamics.torques(x[None], v[None], a[None])[0], q
        )
        np.testing.assert_allclose(found[0][0], by_place, atol=1e-5)


def case_of(robot: sm.RobotModel) -> Case:
    start = robot.dexterous_configuration("position")
    return robot, sm.Task.POSITION, start, short_line(robot, start)


def test_gradients_of_rollouts_are_differences(robot: sm.RobotModel) -> None:
    """Through the Hessian of the chain, in which joints that share a coordinate are two."""
    case = case_of(robot)
    rollout = rollout_of(case, 8)
    t = rollout.grid.stage_times
    functions = PolynomialNullMotion(2, "joint").functions(t, case[3].duration)
    table = NullMotionTable(functions, None, robot.dof)
    costs = [
        sm.costs.JointVelocity(),
        sm.costs.InverseManipulability(1e-3),
        sm.costs.KineticEnergy(robot),
    ]
    objective = objective_of(rollout, table, costs, FixedStart(case[2]))
    x = 0.1 * np.random.default_rng(7).normal(size=objective.size)
    exact = objective.gradient(x)
    found = central_difference(objective.value, x, 1e-5)
    assert np.abs(exact - found).max() <= 1e-6 * np.abs(found).max()
    by_x = 0.05 * np.random.default_rng(8).normal(size=objective.size)
    assert_sensitivities(rollout, table, case[2], by_x, 1e-6)


def test_gradients_on_nodes_are_differences(robot: sm.RobotModel) -> None:
    motion = nodes_of(problem_of(case_of(robot)))
    motion = moved(motion, random_step(motion, 2, 0.02))
    step, near, here = random_step(motion, 3), 1e-5, centred(motion)
    above, below = (moved(here, sign * near * step).place.nodes for sign in (1.0, -1.0))
    expected = (above - below) / (2 * near)
    found = np.einsum("konw,kw->kon", around_of(here).changes, step)
    np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())


def test_bodies_turn_with_what_they_mimic(robot: sm.RobotModel) -> None:
    model = sm.obstacles.CollisionModel(robot)
    rng = np.random.default_rng(3)
    for q in drawn(robot, 2):
        step = 1e-2 * rng.normal(size=robot.dof)
        before, after = model.distances(np.array([q, q + step]))
        moved = np.abs(after - before)
        assert (moved <= model.pair_levers @ np.abs(step) + 1e-9).all()
        joints = robot.all_joints(q[None])
        assert set(robot.joint_names) <= set(joints)


def test_the_torso_carries_both_arms(tmp_path: Path) -> None:
    file = tmp_path / "torso.urdf"
    file.write_text(torso())
    arm = sm.load_robot(file, tool="left7")
    assert arm.joint_names == ("t1", *(f"left_j{k}" for k in range(1, 8)))
    assert "t2" not in arm.locked
    q = np.zeros(8)
    q[0] = 0.7
    turn, at = arm.chain_to("right7").place(q).rotation, arm.chain_to("right7").place(q).translation
    still = arm.chain_to("right7").place(np.zeros(8))
    turned = np.array([[np.cos(0.7), -np.sin(0.7), 0], [np.sin(0.7), np.cos(0.7), 0], [0, 0, 1]])
    np.testing.assert_allclose(turn, turned @ still.rotation, atol=EXACT)
    np.testing.assert_allclose(at, turned @ still.translation, atol=EXACT)
    with pytest.raises(
        sm.errors.RobotError, match="lock holds joint 't2', which mimics 't1', and that"
    ):
        sm.load_robot(file, tool="left7", lock={"t2": 0.0})
    held = sm.load_robot(file, tool="left7", lock={"t1": 0.4})
    assert held.locked["t2"] == pytest.approx(0.4)


def test_limits_are_the_tighter_ones(tmp_path: Path) -> None:
    text = finger(
        limits='lower="-0.5" upper="2" velocity="1" effort="5"',
        mimic='multiplier="-2" offset="0.1"',
    )
    file = tmp_path / "finger.urdf"
    file.write_text(text)
    arm = sm.load_robot(file, tool="tip")
    k = arm.joint_names.index("j3")
    # -0.5 ≤ -2 q + 0.1 ≤ 2, and |−2 q̇| ≤ 1.
    assert arm.lower[k] == pytest.approx(-0.95)
    assert arm.upper[k] == pytest.approx(0.3)
    assert arm.velocity_limit[k] == pytest.approx(0.5)
    file.write_text(finger(limits='lower="8" upper="9" velocity="1" effort="5"', mimic=""))
    with pytest.raises(
        sm.errors.RobotError, match="joint 'j3' has no position within the limits of all"
    ):
        sm.load_robot(file, tool="tip")


def test_coupled_arms_plan_save_export_and_replay(robot: sm.RobotModel, tmp_path: Path) -> None:
    q = robot.dexterous_configuration("position")
    path = sm.paths.Circle.around(robot.pose(q), 0.03, 3.0)
    plan = sm.plan(sm.Problem(robot, path, "position", q))
    assert plan.certificate.verified, plan.certificate.verdict
    plan.save(tmp_path / "plan.npz")
    again = sm.load_plan(tmp_path / "plan.npz")
    assert again.certificate.verified
    np.testing.assert_array_equal(again.robot.coupling.matrix, robot.coupling.matrix)
    # By a library of its own, from the file.
    other = yourdfpy.URDF.load(robot.urdf.source, load_meshes=False)
    for t in np.linspace(0.0, path.duration, 7):
        other.update_cfg(
            {**robot.locked, **dict(zip(robot.joint_names, plan.trajectory(t), strict=True))}
        )
        at = other.get_transform(robot.tool, robot.urdf.root)[:3, 3]
        np.testing.assert_allclose(at, path.pose(t).translation, atol=1e-6)
    sm.files.write_motion(plan, tmp_path / "plan.csv")
    assert sm.files.read_motion(tmp_path / "plan.csv").joint_names == robot.joint_names
    poses = robot.joint_poses(plan.trajectory.q[[0, -1]])
    assert poses.shape[1] == robot.model.nv


def test_what_is_computed_of_a_chain_has_room_for_all_its_joints(robot: sm.RobotModel) -> None:
    """More joints than coordinates: with tolerances, and towards what is out of reach."""
    start = robot.dexterous_configuration("position")
    path = sm.paths.Line(robot.pose(start), robot.pose(start + 0.02), 1.0)
    problem = sm.Problem(
        robot, path, "position", start, constraints=(), rest=False, clearance=None,
        relaxations=[sm.Relaxation("z", 0.01)],
    )  # fmt: skip
    relaxed = Formulation.of(problem).follows
    q = np.append(start, 0.0)
    tip = relaxed.items[0].chain.place(q)
    np.testing.assert_allclose(tip.homogeneous, robot.pose(start).homogeneous, atol=EXACT)
    assert sm.plan(problem).certificate.verified
    away = robot.pose(start)
    away.translation = away.translation + np.array([9.0, 0.0, 0.0])
    with pytest.raises(sm.SelfmotionError):
        sm.plan(replace(problem, path=sm.paths.Dwell(away, 1.0), start=None, relaxations=()))

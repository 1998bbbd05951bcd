"""What is asked of a finished plan: its null-space velocity, and its cost by any cost."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.planning.result import Reversals
from support.arms import PANDA_HOME, Case, robot_named, short_line, start_of

# Roundings of velocities, by two ways to a pseudo-inverse.
ROUNDING = 1e-9
# Between its nodes a motion leaves its path by less than the tolerance; velocities by more [m/s].
BETWEEN_NODES = 1e-3
# A motion evaluated and summed in another order: its jerks are differences of large numbers.
SUMMED = 1e-10

# By what a path is put elsewhere [m].
MOVED = np.array([0.01, -0.02, 0.03])


@pytest.fixture
def plan(case: Case) -> sm.Plan:
    robot, task, start, path = case
    return sm.plan(sm.Problem(robot, path, task, start), max_evaluations=3)


def test_it_is_what_the_pseudo_inverse_leaves(plan: sm.Plan) -> None:
    """q̇ = J⁺ẋ + N z, ẋ once what the tool does, once what the path asks for."""
    t = np.linspace(0.0, plan.trajectory.duration, 7)
    found = plan.null_motion(t)
    twists = plan.path.evaluate(t).twist
    for k, (q, qd) in enumerate(zip(plan.trajectory(t), plan.trajectory(t, 1), strict=True)):
        rows = plan.robot.task_jacobian(q, plan.task)
        inverse = np.linalg.pinv(rows)
        np.testing.assert_allclose(inverse @ rows @ qd + found.joints[k], qd, atol=ROUNDING)
        asked = plan.task.select(twists[k][:, None], plan.robot.pose(q).rotation)[:, 0]
        np.testing.assert_allclose(inverse @ asked + found.joints[k], qd, atol=BETWEEN_NODES)
        np.testing.assert_allclose(rows @ found.joints[k], 0.0, atol=ROUNDING)
        basis = found.basis[k]
        np.testing.assert_allclose(basis.T @ basis, np.eye(basis.shape[1]), atol=ROUNDING)
        np.testing.assert_allclose(found.coordinates[k], basis.T @ qd, atol=ROUNDING)
        np.testing.assert_allclose(found.joints[k], basis @ found.coordinates[k], atol=ROUNDING)


@pytest.mark.parametrize("task", ["pose", "pointing"])
def test_a_deviation_is_what_poses_of_arm_and_path_differ_by(task: str) -> None:
    """By Pinocchio's logarithm, and of axes by the angle between them."""
    panda = robot_named("panda")
    circle = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.1, 4.0, normal=(1, 0, 0))
    relaxations = [
        sm.Relaxation(("rx", "ry"), 0.1),
        sm.Relaxation("z", 2e-3, axes="tool"),
        *([sm.Relaxation("rz", during=(1.0, 2.5))] if task == "pose" else []),
    ]
    problem = sm.Problem(panda, circle, task, PANDA_HOME, relaxations=relaxations)
    plan = sm.plan(problem).require()
    t = np.linspace(0.0, plan.trajectory.duration, 401)
    found = plan.deviation(t)
    assert found.shape == (len(t), 6)
    places = zip(found, plan.robot.pose(plan.trajectory(t)), plan.path.pose(t), strict=True)
    for row, actual, target in places:
        apart = target.actInv(actual)
        np.testing.assert_allclose(row[:3], apart.translation, atol=ROUNDING)
        if task == "pose":
            np.testing.assert_allclose(row[3:], pin.log3(apart.rotation), atol=ROUNDING)
        else:
            # Aligned, the one axis is the other; nothing turns about it.
            aligned = target.rotation @ pin.exp3(row[3:])
            np.testing.assert_allclose(aligned[:, 2], actual.rotation[:, 2], atol=ROUNDING)
            assert row[5] == 0.0
    for item, worst in zip(relaxations, plan.certificate.deviations, strict=True):
        size = np.linalg.norm(found[:, item.indices], axis=1).max()
        assert 0.99 * worst.value < size <= worst.value + ROUNDING
    np.testing.assert_allclose(plan.deviation(t[7]), found[7], rtol=0.0, atol=ROUNDING)
    # On another path it is another; in world axes the same length in other rows.
    other = replace(plan.problem, relaxations=relaxations[:1])
    world = replace(plan, problem=other).deviation(t)
    np.testing.assert_allclose(*(np.linalg.norm(x[:, :3], axis=1) for x in (world, found)))
    assert np.abs(world[:, :3] - found[:, :3]).max() > 1e-4
    moved = sm.paths.Placed(circle, pin.SE3(np.eye(3), MOVED))
    elsewhere = replace(plan.problem, path=moved, relaxations=(), start="free")
    off = replace(plan, problem=elsewhere).deviation(t)
    np.testing.assert_allclose(off[:, :3], world[:, :3] - MOVED, atol=ROUNDING)
    with pytest.raises(ValueError, match="outside the motion"):
        plan.deviation(99.0)
    with pytest.raises(ValueError, match=r"t has shape \(1, 2\), expected a time or times"):
        plan.deviation([[0.0, 1.0]])


def test_a_null_space_velocity_is_told_in_a_line(plan: sm.Plan) -> None:
    n, many = plan.robot.dof, plan.null_motion([0.1, 0.4])
    most = np.abs(many.joints).max()
    said = f"{n} joints, {many.coordinates.shape[1]} coordinates, at most {most:.4g} rad/s or m/s)"
    assert repr(many) == f"NullSpaceVelocity(2 times, {said}"
    assert repr(plan.null_motion(0.1)).startswith(f"NullSpaceVelocity({n} joints, ")


def test_one_time_is_one_of_many(plan: sm.Plan) -> None:
    t = np.array([0.4, 0.9])
    one, many = plan.null_motion(0.9), plan.null_motion(t)
    assert one.joints.shape == (plan.robot.dof,)
    np.testing.assert_allclose(one.joints, many.joints[1], atol=ROUNDING)
    # The basis is another, but spans the same.
    np.testing.assert_allclose(
        np.linalg.norm(one.coordinates), np.linalg.norm(many.coordinates[1]), atol=ROUNDING
    )
    with pytest.raises(ValueError, match="outside the motion"):
        plan.null_motion(99.0)
    with pytest.raises(ValueError, match=r"t has shape \(1, 2\), expected a time or times"):
        plan.null_motion([[0.0, 1.0]])


def test_its_coordinates_do_not_jump(plan: sm.Plan) -> None:
    """No more than joint velocities and bases do, whose signs are arbitrary one by one."""
    t = np.linspace(0.0, plan.trajectory.duration, 400)
    steps = np.abs(np.diff(plan.null_motion(t).coordinates, axis=0)).max()
    assert steps < 0.05 * max(1.0, np.abs(plan.trajectory(t, 1)).max())


@pytest.fixture(scope="module")
def panda_plan() -> sm.Plan:
    panda = robot_named("panda")
    start = start_of(panda, "position")
    costs = (
        sm.costs.JointVelocity(),
        sm.costs.JointAcceleration(0.1),
        sm.costs.JointJerk(1e-3),
        sm.costs.Manipulability(mu=0.1),
        sm.costs.GravityTorque(panda),
        sm.costs.PathLength(),
        sm.costs.Posture(posture=start),
    )
    path = short_line(panda, start)
    return sm.plan(sm.Problem(panda, path, "position", start, costs=costs), max_evaluations=5)


def test_of_its_own_costs_it_is_the_report(panda_plan: sm.Plan) -> None:
    for cost in panda_plan.problem.costs:
        found, told = panda_plan.evaluate(cost), panda_plan.report.terms[cost.name]
        assert found == pytest.approx(told, rel=SUMMED)
    assert sum(map(panda_plan.evaluate, panda_plan.problem.costs)) == pytest.approx(
        panda_plan.report.cost, rel=SUMMED
    )


def test_with_tolerances_it_is_the_report_as_well(panda_plan: sm.Plan) -> None:
    asked = replace(panda_plan.problem, task="pose", relaxations=[sm.Relaxation("rz", 0.3)])
    found = sm.plan(asked, max_evaluations=5)
    for cost in found.problem.costs:
        assert found.evaluate(cost) == pytest.approx(found.report.terms[cost.name], rel=SUMMED)


def test_of_any_other_cost_it_is_the_integral(panda_plan: sm.Plan) -> None:
    """Against a trapezoidal sum on 20,000 steps, of a function of one's own."""

    def g(qd: Array, q: Array, t: Array) -> Array:
        return np.sum(qd**2, axis=1) * (1.0 + t) + np.sin(q[:, 0])

    motion = panda_plan.trajectory
    t = np.linspace(motion.t[0], motion.t[-1], 20001)
    expected = np.trapezoid(g(motion(t, 1), motion(t), t), t)
    assert panda_plan.evaluate(sm.costs.FunctionCost(g)) == pytest.approx(expected, rel=1e-7)


def test_a_plan_with_another_motion_costs_what_that_does(panda_plan: sm.Plan) -> None:
    slow = sm.Trajectory(
        2.0 * panda_plan.trajectory.t,
        panda_plan.trajectory.q,
        0.5 * panda_plan.trajectory.qd,
        panda_plan.trajectory.joint_names,
        0.25 * panda_plan.trajectory.qdd,
    )
    speed = sm.costs.JointVelocity()
    assert replace(panda_plan, trajectory=slow).evaluate(speed) == pytest.approx(
        0.5 * panda_plan.evaluate(speed), rel=1e-12
    )


def test_what_cannot_be_evaluated_says_why(panda_plan: sm.Plan, tmp_path: Path) -> None:
    for cost, message in (
        (3, r"cost is 3, expected a cost such as sm.costs.JointVelocity\(\)"),
        (sm.costs.JointVelocity, "the class JointVelocity, not an object of it"),
        (sm.costs.JointVelocity([1.0, 2.0]), "expected one entry per joint"),
        (sm.costs.FunctionCost(lambda qd, q, t: t / (t - t)), "its value is inf at t = "),
        (sm.costs.FunctionCost(lambda qd, q, t: t[1:]), "returned shape"),
    ):
        with (
            np.errstate(divide="ignore", invalid="ignore"),
            pytest.raises(sm.errors.ProblemError, match=message),
        ):
            panda_plan.evaluate(cost)
    lost = replace(
        panda_plan.problem, costs=[sm.costs.FunctionCost(lambda qd, q, t: t, name="own")]
    )
    sm.plan(lost, max_evaluations=2).save(tmp_path / "plan.npz")
    (own,) = sm.load_plan(tmp_path / "plan.npz").problem.costs
    with pytest.raises(sm.errors.ProblemError, match=r"'own' was a FunctionCost.*give it again"):
        panda_plan.evaluate(own)


# Joints that turn round are counted, and a cost makes them do so less often.

# Where a motion turns round, by samples of it [s].
NEAR = 1e-4


def swinging(size: float, turns: int, duration: float = 4.0) -> sm.Trajectory:
    """Return a joint that swings from rest to rest, and one that goes one way."""
    t = np.linspace(0.0, duration, 801)
    w = np.pi * turns / duration
    q = np.stack([size * np.cos(w * t), t**2], axis=1)
    qd = np.stack([-size * w * np.sin(w * t), 2.0 * t], axis=1)
    qdd = np.stack([-size * w**2 * np.cos(w * t), np.full(len(t), 2.0)], axis=1)
    return sm.Trajectory(t, q, qd, ("swings", "goes"), qdd)


@pytest.mark.parametrize("turns", [1, 2, 7])
def test_a_swing_turns_round_where_it_is_farthest(turns: int) -> None:
    found = Reversals.of(swinging(0.3, turns))
    expected = 4.0 * np.arange(1, turns) / turns
    np.testing.assert_allclose(found.times["swings"], expected, atol=NEAR)
    assert not len(found.times["goes"])
    assert found.count == turns - 1
    assert str(found) == {0: "0", 1: "1 (swings 1)", 6: "6 (swings 6)"}[turns - 1]


def test_trembling_is_no_turning() -> None:
    slow, trembling = swinging(0.3, 2), swinging(2e-4, 40)
    both = sm.Trajectory(
        slow.t, slow.q + trembling.q, slow.qd + trembling.qd, slow.joint_names, None
    )
    assert Reversals.of(both).count == 1
    assert Reversals.of(trembling).count == 0
    # Three times the size it is more than the least that counts.
    assert Reversals.of(swinging(6e-4, 40)).count == 39


def test_the_cost_counts_and_a_motion_turns_round_less_often() -> None:
    arm = sm.load_robot("planar_3r")
    points = [[2.0, -0.6, 0.0], [2.0, 0.6, 0.0], [1.7, 0.6, 0.0], [1.7, -0.6, 0.0]]
    path = sm.paths.Feed(sm.paths.Polyline(points, tolerance=0.03), 1.0, within=0.5)
    velocity, turning = sm.costs.JointVelocity(), sm.costs.JointReversals(0.2)
    q = arm.inverse_kinematics(path.pose(0.0), "planar", seed=[-1.2, 1.2, 0.6])
    limits = [sm.constraints.JointPositionLimits()]
    problem = sm.Problem(arm, path, "planar", q, costs=[velocity], constraints=limits)
    plain, fewer = (
        sm.plan(replace(problem, costs=costs)) for costs in ([velocity], [velocity, turning])
    )
    assert plain.certificate.on_path
    assert fewer.certificate.on_path
    assert fewer.reversals.count < plain.reversals.count
    # A joint that turns round costs the weight, one that begins or ends half of it.
    own = fewer.report.terms["joint reversals"] / 0.2
    assert fewer.reversals.count <= own <= 1.5 * (fewer.reversals.count + arm.dof)

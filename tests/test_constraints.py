"""Constraints: exact gradients, kept on the fine grid, or named where they cannot be."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from rich.console import Console

import selfmotion as sm
from conftest import PANDA_HOME, central_difference, robot_named, short_line, start_of
from selfmotion.basics.arrays import Array
from selfmotion.certificate import ClosedMotion, EndState, JointLimits
from selfmotion.cli.tables import show
from selfmotion.constraints import NodeTangents
from selfmotion.engine import Objective, StillMotion
from selfmotion.engine.start import FreeStart
from selfmotion.motion.grid import Grid
from selfmotion.motion.null_motion import PolynomialNullMotion
from selfmotion.optimise import pulled_back

Circle = Callable[..., sm.Problem]

LIMITS = (sm.JointPositionLimits(), sm.JointVelocityLimits())
# Exact gradients against central differences, relative to the gradient's largest entry.
GRADIENT = 1e-6


def certify_again(plan: sm.Plan, requirements: list[sm.Requirement]) -> sm.Certificate:
    """Return a plan's certificate with other requirements."""
    return sm.certify(plan.robot, plan.path, plan.task, plan.trajectory, requirements=requirements)


CONSTRAINTS = {
    "position": lambda r: sm.JointPositionLimits(
        np.full(r.dof, -0.02), np.full(r.dof, 0.02), replace=True
    ),
    "velocity": lambda r: sm.JointVelocityLimits(np.full(r.dof, 0.02)),
    "acceleration": lambda r: sm.JointAccelerationLimits(0.05),
    "end": lambda r: sm.EndConfiguration(np.full(r.dof, 0.3)),
    "end velocity": lambda r: sm.EndVelocity(),
    "closed": lambda r: sm.ClosedPath(),
    "closed in position": lambda r: sm.ClosedPath(velocity=False),
}


def objective_with(constraint: sm.Constraint, name: str, task: str) -> Objective:
    """Return an objective with a free start and one constraint that is violated."""
    robot, rows = robot_named(name), sm.Task.of(task)
    start = start_of(robot, task)
    path = short_line(robot, start)
    grid = Grid.aligned(path.knots, 12)
    motion = PolynomialNullMotion(1, "joint")
    problem = sm.Problem(robot, path, rows, start, motion, constraints=(), rest=False)
    still = StillMotion.on(problem, start, grid)
    bound = constraint.bind(robot, rows, start, start)
    return Objective.of(problem, still, free=True, constraints=[bound])


@pytest.mark.parametrize("constraint", CONSTRAINTS)
@pytest.mark.parametrize(("name", "task"), [("planar_3r", "planar"), ("panda", "pointing")])
def test_rows_equal_central_differences(constraint: str, name: str, task: str) -> None:
    """Of all conditions at once, also of those that are not violated."""
    objective = objective_with(CONSTRAINTS[constraint](robot_named(name)), name, task)
    x = 0.02 * np.random.default_rng(1).normal(size=objective.size)
    assert objective.conditions(x).worst > 1.0
    weights = np.random.default_rng(2).normal(size=len(objective.conditions(x).h))
    exact = pulled_back(objective.condition_rows(x), weights)
    differences = central_difference(lambda x: float(weights @ objective.conditions(x).h), x, 1e-6)
    assert np.abs(exact - differences).max() <= GRADIENT * np.abs(differences).max()


@pytest.mark.parametrize("constraint", CONSTRAINTS)
def test_tangents_equal_central_differences(constraint: str) -> None:
    made = CONSTRAINTS[constraint](robot_named("panda"))
    objective = objective_with(made, "panda", "pose")
    bound = made.bind(robot_named("panda"), sm.Task.POSE, np.zeros(7), np.zeros(7))
    x = 0.02 * np.random.default_rng(2).normal(size=objective.size)
    tangents: NodeTangents = objective.node_tangents(x)
    exact = bound.tangents(objective.samples(x), tangents)
    for i in (0, 1, objective.size - 1):
        ends = []
        for sign in (1.0, -1.0):
            shift = np.zeros_like(x)
            shift[i] = sign * 1e-5
            ends.append(bound.residual(objective.samples(x + shift)).copy())
        differences = (ends[0] - ends[1]) / 2e-5
        scale = max(1.0, np.abs(differences).max())
        np.testing.assert_allclose(exact[..., i], differences, atol=1e-6 * scale)


@pytest.mark.parametrize("constraint", CONSTRAINTS)
def test_rows_on_demand_are_those_of_all_tangents(constraint: str) -> None:
    """Some, along a direction, and after other motions were looked at."""
    made = CONSTRAINTS[constraint](robot_named("panda"))
    objective = objective_with(made, "panda", "pose")
    rng = np.random.default_rng(4)
    x = 0.02 * rng.normal(size=objective.size)
    tangents, samples = objective.node_tangents(x), objective.samples(x)
    bound = objective.constraints.constraints[0]
    expected = bound.tangents(samples, tangents).reshape(-1, objective.size)
    rows = objective.condition_rows(x)
    # All of one motion is computed once.
    count = objective.evaluations
    objective.value(x), objective.conditions(x), objective.gradient(x), objective.metric(x)
    assert objective.evaluations == count
    objective.conditions(x + 0.1)
    assert objective.evaluations == count + 1
    direction, which = rng.normal(size=objective.size), rng.integers(0, len(expected), 40)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(rows.picked(which), expected[which], atol=1e-12 * scale)
    np.testing.assert_allclose(
        rows.along(direction), expected @ direction, atol=1e-11 * scale * len(direction)
    )


def test_clearance_rows_equal_central_differences() -> None:
    robot = robot_named("panda")
    pose = robot.pose(start_of(robot, "pose"))
    box = sm.Box("box", pose.translation + np.array([0.0, 0.0, 0.25]), [0.1, 0.1, 0.1])
    objective = objective_with(sm.Clearance((box,), 0.1), "panda", "pose")
    x = 0.01 * np.random.default_rng(3).normal(size=objective.size)
    excess = np.maximum(objective.conditions(x).h, 0.0)
    assert excess.any()

    def value(x: Array) -> float:
        return float(np.sum(np.maximum(objective.conditions(x).h, 0.0) ** 2))

    exact = 2.0 * pulled_back(objective.condition_rows(x), excess)
    differences = central_difference(value, x, 1e-7)
    # Closest points jump on flat faces; away from jumps the agreement is that of the differences.
    assert np.abs(exact - differences).max() <= 1e-4 * np.abs(differences).max()


def test_a_hundred_loops_of_a_closed_circle_do_not_drift(panda_circle: Circle) -> None:
    open_loop = sm.plan(panda_circle())
    plan = sm.plan(panda_circle(constraints=(*LIMITS, sm.ClosedPath())))
    assert plan.certificate.verified
    assert plan.certificate.closure <= 1e-9
    assert plan.certificate.closure * 100 <= 1e-6
    assert open_loop.certificate.closure > 0.01
    ends = plan.trajectory.qd[[0, -1]]
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-6)
    # What the pseudo-inverse alone does in one loop.
    drift = open_loop.initial_trajectory.q[-1] - open_loop.initial_trajectory.q[0]
    assert np.linalg.norm(drift) > 0.01
    assert plan.report.cost < 1.1 * open_loop.report.cost


def test_closed_paths_from_a_free_start(panda_circle: Circle) -> None:
    problem = panda_circle(constraints=(*LIMITS, sm.ClosedPath()))
    fixed = sm.plan(problem)
    free = sm.plan(dataclasses.replace(problem, start=None))
    assert free.certificate.verified
    assert free.certificate.closure <= 1e-8
    assert free.report.cost < fixed.report.cost


def test_a_closed_joint_path_needs_a_closed_tool_path(panda: sm.RobotModel) -> None:
    line = short_line(panda, PANDA_HOME)
    with pytest.raises(sm.ProblemError, match="needs a closed tool path"):
        sm.Problem(panda, line, start=PANDA_HOME, constraints=[sm.ClosedPath()])


def test_velocity_limits_are_kept_between_samples(panda_circle: Circle) -> None:
    robot = panda_circle().robot
    limit = 0.55 * robot.velocity_limit
    without = sm.plan(panda_circle())
    assert (np.abs(without.trajectory.qd) / limit).max() > 1.0
    motion = sm.BSplineNullMotion(8)
    constraints = (sm.JointPositionLimits(), sm.JointVelocityLimits(limit))
    plan = sm.plan(panda_circle(null_motion=motion, constraints=constraints))
    assert plan.certificate.verified
    t = np.linspace(0, plan.trajectory.duration, 5001)
    assert (np.abs(plan.trajectory(t, 1)) / limit).max() <= 1.0
    assert plan.certificate.velocity_ratio.value > 0.9


def test_position_limits_are_kept_between_samples(panda_circle: Circle) -> None:
    free = sm.plan(panda_circle())
    upper = np.array(free.robot.upper)
    upper[1] = free.trajectory.q[:, 1].max() - 0.05
    constraints = (sm.JointPositionLimits(upper=upper), sm.JointVelocityLimits())
    plan = sm.plan(panda_circle(null_motion=sm.BSplineNullMotion(8), constraints=constraints))
    assert plan.certificate.verified
    t = np.linspace(0, plan.trajectory.duration, 5001)
    assert plan.trajectory(t)[:, 1].max() <= upper[1]


def test_end_configuration_is_reached(panda_circle: Circle) -> None:
    """The start itself, and a configuration further along the self-motion."""
    problem = panda_circle()
    robot, task = problem.robot, sm.Task.POSE
    manifold = FreeStart(robot, task, PANDA_HOME)
    target = manifold.configuration(np.array([0.2]), problem.path.pose(0.0))
    assert target is not None
    constraints = (*LIMITS, sm.EndConfiguration(target))
    plan = sm.plan(panda_circle(constraints=constraints))
    assert plan.certificate.verified
    np.testing.assert_allclose(plan.trajectory.q[-1], target, atol=1e-7)


def test_an_end_velocity_is_reached_and_checked(panda_circle: Circle) -> None:
    """Rest where the path rests; the velocity of a motion known to be possible where it moves."""
    rest = sm.plan(panda_circle("pointing", constraints=(*LIMITS, sm.EndVelocity())))
    assert rest.certificate.verified, rest.certificate.verdict
    np.testing.assert_allclose(rest.trajectory.qd[-1], 0.0, atol=1e-6)
    problem = panda_circle("pointing")
    first = problem.path.pose(0.0)
    path = sm.Circle.around(first, 0.15, 4.0, normal=(1.0, 0.0, 0.0), time_law="constant")
    problem = dataclasses.replace(problem, path=path)
    with pytest.raises(sm.ProblemError, match="cannot end at rest"):
        dataclasses.replace(problem, constraints=[sm.EndVelocity()])
    free = sm.plan(problem)
    end, target = free.trajectory.q[-1], free.trajectory.qd[-1]
    ends = (sm.EndConfiguration(end), sm.EndVelocity(target))
    kept = sm.plan(dataclasses.replace(problem, constraints=(*LIMITS, *ends)))
    assert kept.certificate.verified, kept.certificate.verdict
    np.testing.assert_allclose(kept.trajectory.qd[-1], target, atol=1e-6)
    for wrong in (EndState(1, target + 0.1), EndState(0, end + 0.1)):
        check = certify_again(kept, [wrong])
        assert "'panda_joint" in check.verdict
        assert not check.verified


def test_a_jump_in_velocity_is_refused_where_the_path_repeats(panda_circle: Circle) -> None:
    plan = sm.plan(panda_circle(constraints=(*LIMITS, sm.ClosedPath(velocity=False)), rest=False))
    assert plan.certificate.verified
    check = certify_again(plan, [ClosedMotion(velocity=True)])
    assert "off that of the start" in check.verdict


def test_unreachable_limits_are_named(panda_circle: Circle) -> None:
    robot = panda_circle().robot
    constraints = [sm.JointVelocityLimits(0.1 * robot.velocity_limit)]
    plan = sm.plan(panda_circle(constraints=constraints))
    assert not plan.certificate.verified
    assert "velocity limits: speed of joint 'panda_joint" in plan.report.message
    assert "times its limit" in plan.certificate.verdict
    with pytest.raises(sm.PlanError):
        plan.require()


def test_obstacles_are_avoided_on_the_real_meshes(panda: sm.RobotModel) -> None:
    """A box in the elbow's way: without the constraint the plan collides, with it it does not."""
    path = sm.Circle.around(panda.pose(PANDA_HOME), 0.1, 4.0, normal=(1.0, 0.0, 0.0))
    plain = sm.plan(sm.Problem(panda, path, start=PANDA_HOME))
    box = sm.Box("box", np.array([0.0, -0.18, 0.62]), [0.1, 0.1, 0.1])
    model = sm.CollisionModel(panda, (box,))
    assert model.worst(plain.trajectory.q).value < -0.005
    clearance = sm.Clearance((box,), 0.005)
    problem = sm.Problem(
        panda,
        path,
        start=PANDA_HOME,
        null_motion=sm.BSplineNullMotion(6),
        constraints=(*LIMITS, clearance),
    )
    plan = sm.plan(problem)
    assert plan.certificate.verified, plan.certificate.verdict
    assert plan.certificate.clearance is not None
    assert plan.certificate.clearance.value >= clearance.distance
    assert model.worst(plan.trajectory(np.linspace(0, 4, 301))).value >= clearance.distance


def test_free_start_is_never_worse_and_repeats(panda_circle: Circle) -> None:
    fixed = sm.plan(panda_circle())
    free = sm.plan(dataclasses.replace(panda_circle(), start="free"))
    again = sm.plan(dataclasses.replace(panda_circle(), start=None))
    assert free.report.cost <= fixed.report.cost
    assert free.certificate.verified
    np.testing.assert_array_equal(free.trajectory.q, again.trajectory.q)


def test_free_start_stays_on_the_path_and_knows_its_tangent() -> None:
    for name, task in (("planar_3r", "planar"), ("panda", "pose"), ("ur5", "position")):
        robot, rows = robot_named(name), sm.Task.of(task)
        start = start_of(robot, task)
        path = short_line(robot, start)
        manifold = FreeStart(robot, rows, start)
        pose = path.pose(0.0)
        z = 0.2 * np.random.default_rng(4).normal(size=manifold.size)
        q = manifold.configuration(z, pose)
        assert q is not None
        assert max(rows.miss(path.pose(0.0), robot.pose(q))) < 1e-11
        tangent, _ = manifold.tangent()
        for i in range(manifold.size):
            ends = []
            for sign in (1.0, -1.0):
                shift = np.zeros_like(z)
                shift[i] = sign * 1e-6
                moved = manifold.configuration(z + shift, pose)
                assert moved is not None
                ends.append(moved)
            np.testing.assert_allclose(tangent[:, i], (ends[0] - ends[1]) / 2e-6, atol=1e-7)
    assert manifold.configuration(np.full(manifold.size, 50.0), pose) is None


def test_bad_constraints_are_refused(panda: sm.RobotModel) -> None:
    path = short_line(panda, PANDA_HOME)
    for constraint, message in (
        (lambda: sm.JointPositionLimits(lower=np.zeros(3)), "one for each of the 7 joints"),
        (
            lambda: sm.JointPositionLimits(lower=np.full(7, 9.0)),
            "not below upper",
        ),
        (lambda: sm.JointVelocityLimits(np.full(7, -1.0)), "expected numbers > 0"),
        (lambda: sm.JointVelocityLimits(margin=0.0), "margin is 0.0"),
        (lambda: sm.JointAccelerationLimits([1.0, 2.0, 3.0]), "one for each of the 7 joints"),
        (lambda: sm.JointAccelerationLimits(np.nan), "expected numbers > 0"),
        (lambda: sm.EndVelocity([1.0, 2.0, 3.0]), "one for each of the 7 joints"),
        (lambda: sm.EndConfiguration(PANDA_HOME), "off the end of the path"),
        (lambda: sm.Clearance(distance=-1.0), "distance is -1.0"),
        (lambda: sm.Clearance(distance=np.inf), "distance is inf"),
        (lambda: sm.Clearance(["x"]), "expected Box, Sphere"),
    ):
        with pytest.raises(sm.ProblemError, match=message):
            sm.plan(sm.Problem(panda, path, start=PANDA_HOME, constraints=[constraint()]))


@pytest.mark.parametrize("tight_first", [True, False])
def test_of_two_constraints_of_a_kind_both_are_judged(
    panda_circle: Circle, tight_first: bool
) -> None:
    """Whatever their order: the loose one does not stand in for the tight one."""
    tight = sm.JointAccelerationLimits(0.01)
    loose = sm.JointAccelerationLimits(100.0, replace=True)
    pair = (tight, loose) if tight_first else (loose, tight)
    free = sm.plan(panda_circle())
    asked = dataclasses.replace(free.problem, constraints=(*LIMITS, *pair))
    check = dataclasses.replace(free, problem=asked).check()
    amounts = [f.amount for f in check.findings if f.requirement == "joint acceleration limits"]
    assert len(amounts) == 2
    assert max(amounts) == pytest.approx(1e4 * min(amounts))
    assert not check.verified
    assert check.acceleration_ratio is not None
    assert check.acceleration_ratio.value == max(amounts)
    kept = sm.plan(panda_circle(constraints=(*LIMITS, sm.JointAccelerationLimits(8.0), loose)))
    assert kept.certificate.verified, kept.certificate.verdict


def test_end_conditions_that_contradict_each_other_are_named(panda_circle: Circle) -> None:
    robot, path = panda_circle().robot, panda_circle().path
    manifold = FreeStart(robot, sm.Task.POSE, PANDA_HOME)
    end = manifold.configuration(np.array([0.3]), path.pose(0.0))
    assert end is not None
    plan = sm.plan(panda_circle(constraints=[sm.ClosedPath(), sm.EndConfiguration(end)]))
    assert not plan.certificate.verified
    assert "not all constraints could be met" in plan.report.message


def test_a_limit_on_one_side_is_kept(panda_circle: Circle) -> None:
    free = sm.plan(panda_circle())
    joint = int(np.argmax(np.ptp(free.trajectory.q, axis=0)))
    lower, upper = np.full(7, -np.inf), np.full(7, np.inf)
    upper[joint] = free.trajectory.q[:, joint].max() - 0.02
    kept = sm.plan(panda_circle("position", constraints=[sm.JointPositionLimits(lower, upper)]))
    assert kept.certificate.verified, kept.certificate.verdict
    assert kept.trajectory.q[:, joint].max() < upper[joint]


def test_accelerations_are_judged_at_their_extremes(panda_circle: Circle) -> None:
    """Where a cubic begins or ends, also at t = 0 and T."""
    plan = sm.plan(panda_circle())
    times = np.linspace(0.0, 4.0, 100_001)
    extreme = np.abs(plan.trajectory(times, order=2)).max()
    found = np.abs(plan.trajectory.extremes(2)[1]).max()
    assert extreme <= found * (1.0 + 1e-9)
    assert found <= extreme * 1.01
    check = certify_again(
        plan, [JointLimits(2, np.full(7, -0.999 * found), np.full(7, 0.999 * found))]
    )
    assert "accelerates at 1.001 times its limit" in check.verdict


def test_saved_plans_keep_what_was_required(panda: sm.RobotModel, tmp_path) -> None:
    path = short_line(panda, PANDA_HOME)
    box = sm.Box("far", np.array([0.0, 0.0, 2.0]), [0.1, 0.1, 0.1])
    constraints = (*LIMITS, sm.JointAccelerationLimits(20.0), sm.Clearance((box,), 0.001))
    plan = sm.plan(sm.Problem(panda, path, start=PANDA_HOME, constraints=constraints))
    assert plan.certificate.verified
    plan.save(tmp_path / "plan.npz")
    loaded = sm.load_plan(tmp_path / "plan.npz")
    assert loaded.certificate == plan.certificate
    assert loaded.check() == plan.certificate
    assert loaded.obstacles[0].name == "far"


def test_broken_motions_fail_what_is_required(panda_circle: Circle) -> None:
    problem = panda_circle(constraints=(*LIMITS, sm.ClosedPath()))
    plan = sm.plan(problem)
    q: Array = plan.trajectory.q.copy()
    q[-1] += 1e-4
    broken = dataclasses.replace(plan.trajectory, q=q)
    certificate = sm.certify(
        plan.robot, plan.path, plan.task, broken, requirements=plan.requirements
    )
    assert "away from the start" in certificate.verdict
    slow = JointLimits(2, np.full(7, -0.1), np.full(7, 0.1))
    assert "accelerates at" in certify_again(plan, [slow]).verdict
    certificate = certify_again(plan, [slow, EndState(0, PANDA_HOME + 0.1)])
    assert "accelerates at" in certificate.verdict
    assert "away from where it should" in certificate.verdict


def test_clearance_of_an_arm_without_geometry_is_refused(planar: sm.RobotModel) -> None:
    start = planar.inverse_kinematics(planar.pose([0.3, 0.8, 0.5]), "planar")
    path = short_line(planar, start)
    with pytest.raises(sm.ProblemError, match="planar_3r: a clearance is asked for, but its URDF"):
        sm.Problem(planar, path, "planar", start, constraints=[sm.Clearance()])


def test_a_table_under_the_base_is_no_obstacle_to_it(panda_circle: Circle) -> None:
    table = sm.Box("table", [0.0, 0.0, -0.05], [0.6, 0.6, 0.1])
    problem = panda_circle(constraints=[sm.Clearance([table], 1e-3)])
    assert sm.plan(problem).certificate.verified


def test_passing_closer_than_capsules_allow_costs_nothing(panda_circle: Circle) -> None:
    """A box a centimetre from the hulls on the best motion, well inside the capsules."""
    free = sm.plan(panda_circle())
    model = sm.CollisionModel(free.robot)
    box = None
    for side in np.linspace(0.12, 0.4, 29):
        box = sm.Box("near", [0.45, side, 0.75], [0.1, 0.1, 0.1])
        model = sm.CollisionModel(free.robot, [box])
        if model.worst(free.trajectory.q).value > 0.01:
            break
    plan = sm.plan(panda_circle(constraints=[sm.Clearance([box], 5e-3)]))
    assert plan.certificate.verified
    assert plan.report.cost == pytest.approx(free.report.cost, rel=1e-3)


# A price is a first derivative: this near to what re-planning saves.
PRICE = 0.2


@pytest.mark.parametrize("kind", ["acceleration", "position"])
def test_prices_are_what_easing_a_limit_saves(panda_circle: Circle, kind: str) -> None:
    """Against plans with a limit that is a little wider."""
    robot = panda_circle().robot
    motion = sm.BSplineNullMotion(8)
    free = sm.plan(panda_circle("position", null_motion=motion))
    assert free.report.active == ()
    highest = float(free.trajectory.q[:, 3].max())

    def limited(eased: float) -> sm.Plan:
        upper = np.array(robot.upper)
        upper[3] = highest - 0.05 + 0.01 * eased
        limits: tuple[sm.Constraint, ...] = (sm.JointPositionLimits(upper=upper), LIMITS[1])
        if kind == "acceleration":
            limits = (*LIMITS, sm.JointAccelerationLimits(1.0 * (1.0 + 0.02 * eased)))
        return sm.plan(panda_circle("position", null_motion=motion, constraints=limits))

    tight, wide = limited(0.0), limited(0.2)
    assert tight.certificate.verified
    assert wide.certificate.verified
    saved = tight.report.cost - wide.report.cost
    priced = 0.2 * sum(item.saving for item in tight.report.active)
    assert saved > 0.0
    assert priced == pytest.approx(saved, rel=PRICE)
    first = tight.report.active[0]
    assert first.constraint == f"joint {kind} limits"
    assert "joint 'panda_joint4'" in first.easing
    assert all(0.0 <= a <= b <= 4.0 for a, b in first.spans)


def test_prices_are_saved_and_shown(panda_circle: Circle, tmp_path) -> None:
    limits = (*LIMITS, sm.JointAccelerationLimits(1.5), sm.ClosedPath())
    plan = sm.plan(panda_circle("position", constraints=limits))
    assert {"closed path", "joint acceleration limits"} <= {
        item.constraint for item in plan.report.active
    }
    plan.save(tmp_path / "plan.npz")
    assert sm.load_plan(tmp_path / "plan.npz").report.active == plan.report.active
    console = Console(record=True, width=120)
    show(plan, console)
    text = console.export_text()
    assert "2 % more acceleration for joint 'panda_joint" in text
    assert "constraints that bind" in text


def test_what_is_not_finite_is_named_with_its_time(panda_circle: Circle) -> None:
    """The cost's value, its gradient, and a constraint's residual; without limits and with."""

    def late(t: Array) -> Array:
        return np.where(t > 2.0, np.nan, 1.0)

    value = sm.FunctionCost(lambda qd, q, t: late(t), lambda qd, q, t: (0 * qd, 0 * q), "late")
    gradient = sm.FunctionCost(
        lambda qd, q, t: np.sum(q**2, axis=1),
        lambda qd, q, t: (0 * qd, late(t)[:, None] * q),
        "bad",
    )
    tight = sm.JointVelocityLimits(0.1)
    for constraints in (LIMITS, (*LIMITS, tight)):
        for cost, text in (
            (value, r"cost 'late': its value is nan at t = 2\.0625 s"),
            (gradient, r"cost 'bad': its gradient is .* at t = 2\.0625 s"),
        ):
            with pytest.raises(sm.ProblemError, match=text):
                sm.plan(panda_circle(costs=[cost], constraints=constraints))


def test_a_wrong_gradient_is_no_convergence(panda_circle: Circle) -> None:
    wrong = sm.FunctionCost(
        lambda qd, q, t: np.sum(q**2, axis=1), lambda qd, q, t: (0 * qd, -2 * q), "wrong"
    )
    plan = sm.plan(panda_circle(costs=[wrong], constraints=()))
    assert plan.report.status is sm.Status.GRADIENT
    assert "check_cost" in plan.report.message


def test_limits_that_do_not_bind_cost_no_evaluation(panda_circle: Circle) -> None:
    """Exactly the quasi-Newton method then, point by point."""
    without, within = sm.plan(panda_circle(constraints=())), sm.plan(panda_circle())
    assert without.report.evaluations == within.report.evaluations
    for first, second in zip(without.report.history, within.report.history, strict=True):
        np.testing.assert_array_equal(first.x, second.x)


def test_conditions_name_an_equality_that_is_missed_on_either_side() -> None:
    objective = objective_with(sm.ClosedPath(velocity=False), "panda", "pose")
    signs = set()
    for seed in range(6):
        x = 0.05 * np.random.default_rng(seed).normal(size=objective.size)
        signs.add(float(np.sign(objective.conditions(x).h[0])))
        assert objective.conditions(x).worst > 1.0
        assert "closed path" in objective.violations(x)[0]
    assert signs == {-1.0, 1.0}


@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_metric_is_the_differenced_gauss_newton_matrix(
    panda: sm.RobotModel, order: int
) -> None:
    """∫ (∂q^(k)/∂x)ᵀ W (∂q^(k)/∂x) dt, the derivatives by central differences of motions."""
    cost = (sm.JointVelocity(), sm.JointAcceleration(), sm.JointJerk())[order - 1]
    path = short_line(panda, PANDA_HOME)
    motion = PolynomialNullMotion(3, "joint")
    problem = sm.Problem(panda, path, "pose", PANDA_HOME, motion, costs=[cost], constraints=())
    objective = Objective.of(
        problem, StillMotion.on(problem, PANDA_HOME, Grid.aligned(path.knots, 12))
    )
    x = 0.05 * np.random.default_rng(0).normal(size=objective.size)
    sampling = objective.grid.sampling

    def derivative(x: Array) -> Array:
        samples = objective.samples(x)
        table = samples.qd if order == 1 else (samples.qdd if order == 2 else samples.qddd)
        return table.copy()

    step = 1e-5
    tangent = np.stack(
        [(derivative(x + e) - derivative(x - e)) / (2 * step) for e in step * np.eye(len(x))],
        axis=2,
    )
    weight = cost.curvature(7)[order]
    expected = np.einsum("s,sid,ij,sje->de", sampling.weights, tangent, weight, tangent)
    metric = objective.metric(x)
    np.testing.assert_allclose(metric, expected, atol=1e-6 * np.abs(expected).max())

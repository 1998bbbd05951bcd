"""Laws of the singularity-robust inverse, and the plans made with it."""

import dataclasses
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.follow import Follows
from selfmotion.model.motion import Grid, NullMotionTable, PolynomialNullMotion
from selfmotion.model.task import DampingLaw
from selfmotion.planning.rollout import FixedStart, Rollout
from selfmotion.problem.costs import OffPath
from support.arms import Case, central_difference, objective_of
from support.rollouts import assert_sensitivities

# Exact gradients against central differences, relative to the largest entry.
GRADIENT = 1e-6


# The law in numpy against the kernel's eigenvalues.
ALGEBRA = 1e-9


def smallest_singular_values(rollout: Rollout) -> Array:
    return np.linalg.svd(rollout.samples().task_jacobian, compute_uv=False)[:, -1]


def table_of(rollout: Rollout, degree: int = 2) -> NullMotionTable:
    t, duration = rollout.grid.stage_times, rollout.follows.duration
    functions = PolynomialNullMotion(degree, "joint").functions(t, duration)
    return NullMotionTable(functions, None, rollout.robot.dof)


def partly_damped(case: Case, start: Array | None = None, steps: int = 8) -> Rollout:
    """Return a rollout whose threshold lies amid the singular values along the x = 0 motion."""
    robot, task, given, path = case
    start = given if start is None else start
    grid = Grid.aligned(path.knots, steps)
    free = Rollout(Follows.of(robot, path, task), grid)
    epsilon = np.zeros((len(grid.stage_times), robot.dof))
    assert free.run(start, epsilon) is None
    threshold = float(np.median(smallest_singular_values(free)))
    rollout = Rollout(
        Follows.of(robot, path, task), grid, damping=DampingLaw(threshold, 0.5 * threshold)
    )
    assert rollout.run(start, epsilon) is None
    assert rollout.damped
    return rollout


def test_damped_equation_4_at_every_stage(case: Case) -> None:
    """q̇ with numpy's own eigenvalues; exactly no damping beyond the threshold."""
    robot, task, start, path = case
    rollout = partly_damped(case)
    epsilon = 0.3 * np.random.default_rng(1).normal(size=(len(rollout.grid.stage_times), robot.dof))
    assert rollout.run(start, epsilon) is None
    samples, law = rollout.samples(), rollout.damping
    assert law is not None
    target, gain = path.samples(samples.t), 20.0 / path.duration
    factors = law.factor(smallest_singular_values(rollout))
    for s in range(len(samples.t)):
        jacobian, share = samples.task_jacobian[s], (factors[s] / law.strength) ** 2
        actual = pin.SE3(samples.rotation[s], samples.translation[s])
        goal = pin.SE3(target.rotation[s], target.translation[s])
        twist = target.twist[s] + (1.0 - share) * gain * task.twist_error(goal, actual)
        command = task.select(twist[:, None], samples.rotation[s])[:, 0]
        gram = jacobian @ jacobian.T + factors[s] ** 2 * np.eye(task.dimension)
        y = np.linalg.solve(gram, command - jacobian @ epsilon[s])
        expected = jacobian.T @ y + epsilon[s]
        np.testing.assert_allclose(samples.qd[s], expected, atol=ALGEBRA * np.abs(y).max())


def test_damping_out_of_reach_changes_no_bit(case: Case) -> None:
    robot, task, start, path = case
    grid = Grid.aligned(path.knots, 20)
    epsilon = 0.1 * np.random.default_rng(2).normal(size=(len(grid.stage_times), robot.dof))
    free = Rollout(Follows.of(robot, path, task), grid)
    assert free.run(start, epsilon) is None
    threshold = 0.99 * float(smallest_singular_values(free).min())
    damped = Rollout(Follows.of(robot, path, task), grid, damping=DampingLaw(threshold, threshold))
    assert damped.run(start, epsilon) is None
    assert not damped.damped
    np.testing.assert_array_equal(damped.samples().q, free.samples().q)
    np.testing.assert_array_equal(damped.samples().qd, free.samples().qd)
    for mine, plain in zip(damped.polished(), free.polished(), strict=True):
        np.testing.assert_array_equal(mine, plain)


def test_damped_gradient_equals_central_differences(case: Case) -> None:
    """Damped along a part of the motion, with the path error among the costs."""
    start = case[2]
    rollout = partly_damped(case)
    table = table_of(rollout)
    away = OffPath(1e3, case[1].dimension)
    costs = [sm.costs.JointVelocity(), sm.costs.Manipulability(0.7), away]
    objective = objective_of(rollout, table, costs, FixedStart(start))
    x = 0.1 * np.random.default_rng(7).normal(size=objective.size)
    exact = objective.gradient(x)
    assert rollout.damped
    assert objective.terms(x)["path error"] > 1e-9
    differences = central_difference(objective.value, x, 1e-5)
    assert np.abs(exact - differences).max() <= GRADIENT * np.abs(differences).max()


def test_damped_pullback_to_the_start_equals_central_differences(case: Case) -> None:
    """Also off the path, with cotangents on q, q̇ and the pose error."""
    robot, _, start, _ = case
    rng = np.random.default_rng(8)
    off = start + 0.02 * rng.normal(size=robot.dof)
    rollout = partly_damped(case, off)
    shape = (len(rollout.grid.stage_times), robot.dof)
    epsilon = 0.1 * rng.normal(size=shape)
    by_q, by_qd = rng.normal(size=(2, *shape))
    by_error = rng.normal(size=(shape[0], 6))
    if not case[1].tool_axes:
        # Rows that the task leaves free have no error to speak of.
        by_error[:, np.isin(np.arange(6), case[1].rows, invert=True)] = 0.0

    def value(q: Array) -> float:
        assert rollout.run(q, epsilon) is None
        samples = rollout.samples()
        total = (by_q * samples.q).sum() + (by_qd * samples.qd).sum()
        return float(total + (by_error * rollout.samples().error).sum())

    differences = central_difference(value, off)
    value(off)
    assert rollout.damped
    _, exact = rollout.pullback(by_q, by_qd, by_error)
    assert np.abs(exact - differences).max() <= GRADIENT * np.abs(differences).max()


def test_damped_sensitivities_equal_central_differences(case: Case) -> None:
    _, _, start, _ = case
    rollout = partly_damped(case, steps=20)
    table = table_of(rollout, 1)
    x = 0.1 * np.random.default_rng(9).normal(size=table.size)
    assert rollout.run(start, table.epsilon(x)) is None
    assert rollout.damped
    assert_sensitivities(rollout, table, start, x, GRADIENT)


def test_damping_fades_in_continuously_differentiable() -> None:
    """λ² and its slope are 0 at the threshold; λ = λ0 at a singular pose."""
    law = DampingLaw(0.4, 0.3)
    assert law.factor(np.array(0.0)) == 0.3
    np.testing.assert_array_equal(law.factor(np.array([0.4, 0.41, 5.0])), 0.0)
    step = 1e-6
    slope = law.factor(np.array(0.4 - step)) ** 2 / step
    assert 0.0 < slope < 1e-5


def touching(planar: sm.RobotModel, reach: float) -> sm.Problem:
    """Return a circle whose farthest point is `reach` from the base (5 m: stretched)."""
    pose = np.eye(4)
    pose[0, 3] = reach - 1.0
    circle = sm.paths.Circle(
        pose, np.array([reach - 0.5, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]), 4.0
    )
    start = planar.inverse_kinematics(circle.pose(0.0), "planar")
    return sm.Problem(planar, circle, "planar", start, damping=sm.Damping())


@pytest.fixture(scope="module")
def overreach() -> sm.Plan:
    """The circle leaves the workspace by 2 mm, about t = 2 s."""
    return sm.plan(touching(sm.load_robot("planar_3r"), 5.002))


def test_a_damped_plan_says_what_damping_cost(overreach: sm.Plan) -> None:
    certificate = overreach.certificate
    (stretch,) = certificate.damped
    assert 1.5 < stretch.start < 2.0 < stretch.end < 2.5
    assert stretch.singular_value < 0.15
    assert 0.002 < certificate.position_error.value < 0.02
    assert stretch.start < certificate.position_error.time < stretch.end
    for words in ("where damping was active", f"{stretch.start:.3f} to {stretch.end:.3f} s"):
        assert words in certificate.verdict
    assert "the inverse was damped" in overreach.report.message
    assert overreach.report.terms["path error"] > 0.0


def test_a_damped_plan_within_the_tolerance_is_verified(
    planar: sm.RobotModel, tmp_path: Path
) -> None:
    plan = sm.plan(touching(planar, 5.002), tolerance=sm.Tolerance(position=0.02))
    assert plan.certificate.verified
    said = "m and 0 µrad off the path (20 mm and 1 µrad are allowed); damped"
    assert said in plan.certificate.verdict
    plan.save(tmp_path / "plan.npz")
    loaded = sm.load_plan(tmp_path / "plan.npz")
    assert loaded.tolerance == plan.tolerance
    assert loaded.check() == plan.certificate


def test_a_damped_plan_is_exact_before_and_smooth_throughout(overreach: sm.Plan) -> None:
    """Damping's error is not polished away node by node, and the rest keeps the tolerance."""
    motion, path, robot = overreach.trajectory, overreach.path, overreach.robot
    (stretch,) = overreach.certificate.damped
    early = np.linspace(0.0, stretch.start - 0.01, 400)
    misses = [overreach.task.miss(path.pose(t), robot.pose(motion(t)))[0] for t in early]
    assert max(misses) < 1e-6
    # Where q jumped, the speed between two samples would not be near those at them: of a smooth
    # motion it differs by a quarter of what it does over twice the time.
    middle = motion(0.5 * (motion.t[1:] + motion.t[:-1]), order=1)
    bends = np.abs(middle - 0.5 * (motion.qd[1:] + motion.qd[:-1])).max()
    wider = np.abs(motion.qd[1:-1] - 0.5 * (motion.qd[2:] + motion.qd[:-2])).max()
    assert bends < 0.35 * wider
    assert wider < 0.01 * np.abs(motion.qd).max()


def test_a_damped_plan_survives_the_disk(overreach: sm.Plan, tmp_path: Path) -> None:
    file = tmp_path / "plan.npz"
    overreach.save(file)
    again = sm.load_plan(file)
    assert again.certificate == overreach.certificate
    assert again.check() == overreach.certificate
    assert again.problem.damping == overreach.problem.damping


def test_damping_that_never_acts_leaves_the_plan(planar: sm.RobotModel) -> None:
    # The same null motion for both: what is left to save decides how far one is refined.
    cubic = sm.PolynomialNullMotion()
    problem = touching(planar, 4.9)
    # A turn away from the limits, where nothing holds either of them.
    start = np.add(problem.given_start, [0.0, 0.0, 2.0 * np.pi])
    problem = dataclasses.replace(problem, null_motion=cubic, start=start)
    damped = sm.plan(problem)
    plain = sm.plan(dataclasses.replace(problem, damping=None))
    assert damped.certificate.verified
    assert not damped.certificate.damped
    assert "damped" not in damped.certificate.verdict
    cost = damped.report.terms["joint velocity"]
    assert cost == pytest.approx(plain.report.terms["joint velocity"], rel=1e-4)
    # What the integration lets in, before the nodes are put onto the path.
    assert damped.report.terms["path error"] < 1e-5 * cost


def test_a_heavier_path_weight_leaves_less_path_error(planar: sm.RobotModel) -> None:
    errors = []
    for weight in (1e-3, 1.0, 1e3):
        damping = sm.Damping(path_weight=weight)
        plan = sm.plan(dataclasses.replace(touching(planar, 5.002), damping=damping))
        errors.append(plan.report.terms["path error"] / weight)
    assert errors[0] > errors[1] > errors[2]


def test_what_damping_refuses(planar: sm.RobotModel) -> None:
    with pytest.raises(sm.errors.ProblemError, match=r"damping: strength is 0\.0, expected"):
        sm.Damping(strength=0.0)
    with pytest.raises(sm.errors.ProblemError, match=r"damping is 0\.1, expected a Damping"):
        dataclasses.replace(sm.sample_problem(), damping=0.1)
    twice = dataclasses.replace(
        sm.sample_problem(), costs=[sm.costs.JointVelocity(name="path error")]
    )
    with pytest.raises(sm.errors.ProblemError, match="two costs are called 'path error'"):
        dataclasses.replace(twice, damping=sm.Damping())
    damped = dataclasses.replace(sm.sample_problem(), damping=sm.Damping())
    with pytest.raises(sm.errors.ProblemError, match="damping is for the optimised motion"):
        sm.plan_by(damped, sm.baselines.PseudoInverse())

"""Eq. 4 along the path: on every arm and task."""

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.follow import Follows
from selfmotion.model.motion import Grid, NullMotionTable
from selfmotion.planning.rollout import FixedStart, Rollout
from support.arms import Case, central_difference, objective_of, robot_named, short_line, start_of
from support.rollouts import random_epsilon, rollout_of

# Products of well-conditioned matrices with entries of order 1.
ALGEBRA = 1e-10


# Exact gradients against central differences of F, relative to the gradient's largest entry.
GRADIENT = 1e-6


def test_null_space_projector(case: Case) -> None:
    robot, task, start, _ = case
    jacobian = robot.task_jacobian(start, task)
    inverse = np.linalg.pinv(jacobian)
    projector = np.eye(robot.dof) - inverse @ jacobian
    np.testing.assert_allclose(jacobian @ projector, 0.0, atol=ALGEBRA)
    np.testing.assert_allclose(projector @ projector, projector, atol=ALGEBRA)
    np.testing.assert_allclose(projector, projector.T, atol=ALGEBRA)


def test_equation_4_at_every_stage(case: Case) -> None:
    """q̇ is J⁺u + (I - J⁺J)ε with numpy's own pseudo-inverse, and J q̇ = u."""
    rollout = rollout_of(case)
    epsilon = random_epsilon(rollout, 1)
    assert rollout.run(case[2], epsilon) is None
    samples, task = rollout.samples(), case[1]
    target = case[3].samples(samples.t)
    gain = 20.0 / case[3].duration
    for s in range(0, len(samples.t), 7):
        jacobian = samples.task_jacobian[s]
        actual = pin.SE3(samples.rotation[s], samples.translation[s])
        goal = pin.SE3(target.rotation[s], target.translation[s])
        twist = target.twist[s] + gain * task.twist_error(goal, actual)
        command = task.select(twist[:, None], samples.rotation[s])[:, 0]
        inverse = np.linalg.pinv(jacobian)
        expected = inverse @ command + epsilon[s] - inverse @ (jacobian @ epsilon[s])
        np.testing.assert_allclose(samples.qd[s], expected, atol=1e-9)
        np.testing.assert_allclose(jacobian @ samples.qd[s], command, atol=1e-9)


def test_path_error_does_not_depend_on_the_null_motion(case: Case) -> None:
    """Whatever ε does, what is left of the path error is the integration's and vanishes with h."""
    for seed in range(3):
        drifts = []
        for steps in (20, 80):
            rollout = rollout_of(case, steps)
            assert rollout.run(case[2], random_epsilon(rollout, seed, 0.2)) is None
            drifts.append(np.abs(rollout.drift).max())
        assert drifts[1] < 1e-6
        assert drifts[1] < drifts[0] / 50 or drifts[0] < 1e-11


@pytest.mark.parametrize(("name", "task"), [("planar_3r", "planar"), ("panda", "pose")])
def test_integration_is_of_fourth_order(name: str, task: str) -> None:
    robot = robot_named(name)
    start = start_of(robot, task)
    path = short_line(robot, start)
    # From 40 steps on the feedback (20 over the motion) is resolved and the order shows.
    ends, steps = [], np.array([40, 80, 160, 320, 1600])
    for count in steps:
        rollout = Rollout(
            Follows.of(robot, path, sm.Task.of(task)), Grid.aligned(path.knots, int(count))
        )
        assert rollout.run(start, random_epsilon(rollout, 4, 0.5)) is None
        ends.append(rollout.samples().q[-1].copy())
    errors = [np.linalg.norm(end - ends[-1]) for end in ends[:-1]]
    slope = -np.polyfit(np.log(steps[:-1]), np.log(errors), 1)[0]
    assert slope == pytest.approx(4.0, abs=0.2)


def test_motion_equals_a_high_order_integration(case: Case) -> None:
    """The rollout against DOP853 on eq. 4 written with numpy's pseudo-inverse."""
    from scipy.integrate import solve_ivp

    robot, task, start, path = case
    rollout = rollout_of(case, 100)
    coefficients = 0.3 * np.random.default_rng(6).normal(size=(4, robot.dof))

    def epsilon(t: float) -> Array:
        return (t / path.duration) ** np.arange(3, -1, -1) @ coefficients

    def rate(t: float, q: Array) -> Array:
        rotation = robot.pose(q).rotation
        jacobian = task.select(robot.jacobian(q), rotation)
        inverse = np.linalg.pinv(jacobian)
        command = task.select(path.twist(t)[:, None], rotation)[:, 0]
        return inverse @ command + epsilon(t) - inverse @ (jacobian @ epsilon(t))

    table = np.array([epsilon(t) for t in rollout.grid.stage_times])
    assert rollout.run(start, table) is None
    oracle = solve_ivp(rate, (0, path.duration), start, method="DOP853", rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(rollout.samples().q[-1], oracle.y[:, -1], atol=2e-7)


def test_pullback_to_the_start_equals_central_differences(case: Case) -> None:
    """Also off the path, where the pose error and its derivative matter."""
    robot, _, start, _ = case
    rollout = rollout_of(case, 10)
    rng = np.random.default_rng(8)
    epsilon = random_epsilon(rollout, 2, 0.1)
    off = start + 0.02 * rng.normal(size=robot.dof)
    by_q, by_qd = rng.normal(size=(2, *epsilon.shape))

    def value(q: Array) -> float:
        assert rollout.run(q, epsilon) is None
        samples = rollout.samples()
        return float((by_q * samples.q).sum() + (by_qd * samples.qd).sum())

    differences = central_difference(value, off)
    value(off)
    _, exact = rollout.pullback(by_q, by_qd)
    assert np.abs(exact - differences).max() <= GRADIENT * np.abs(differences).max()


def test_breakdown_is_reported_not_raised(planar: sm.RobotModel) -> None:
    """From the stretched pose outward no q̇ exists."""
    start = np.array([0.3, 0.0, 0.0])
    pose = planar.pose(start)
    end = pose.copy()
    end.translation = pose.translation * 1.1
    path = sm.paths.Line(pose, end, 1.0)
    rollout = Rollout(Follows.of(planar, path, sm.Task.PLANAR), Grid.aligned(path.knots, 10))
    assert rollout.run(start, np.zeros((41, 3))) == 0.0
    table = NullMotionTable(np.ones((41, 1)), None, 3)
    objective = objective_of(rollout, table, [sm.costs.JointVelocity()], FixedStart(start))
    assert objective.value(np.zeros(3)) == np.inf
    assert np.isnan(objective.gradient(np.zeros(3))).all()
    assert rollout.run(np.array([0.3, 1.0, np.nan]), np.zeros((41, 3))) is not None


def test_accelerations_and_jerks_are_derivatives(case: Case) -> None:
    """Five-point differences of q̇ against differences of q̇ on a four times finer grid."""
    rollout = rollout_of(case, 80)
    assert rollout.run(case[2], random_epsilon(rollout, 5)) is None
    samples = rollout.samples()
    nodes = rollout.grid.node_stages[2:-2]
    h = case[3].duration / rollout.grid.steps
    qd = samples.qd[rollout.grid.node_stages]
    central = (qd[:-4] - 8 * qd[1:-3] + 8 * qd[3:-1] - qd[4:]) / (12 * h)
    np.testing.assert_allclose(samples.qdd[nodes], central, atol=1e-8)
    second = (-qd[:-4] + 16 * qd[1:-3] - 30 * qd[2:-2] + 16 * qd[3:-1] - qd[4:]) / (12 * h**2)
    np.testing.assert_allclose(samples.qddd[nodes], second, atol=1e-6)


@pytest.mark.parametrize("last", [False, True])
def test_a_breakdown_has_the_time_of_the_first_number_that_is_not_finite(
    case: Case, last: bool
) -> None:
    robot, task, start, path = case
    rollout = Rollout(Follows.of(robot, path, task), Grid.aligned(path.knots, 8))
    times = rollout.grid.stage_times
    stage = len(times) - 1 if last else 13
    epsilon = np.zeros((len(times), robot.dof))
    assert rollout.run(start, epsilon) is None
    assert rollout.jacobian_evaluations == len(times)
    for broken in (np.nan, np.inf):
        epsilon[stage, 0] = broken
        before = rollout.jacobian_evaluations
        assert rollout.run(start, epsilon) == times[stage]
        assert rollout.jacobian_evaluations == before + stage + 1


@pytest.mark.parametrize(("name", "task"), [("panda", "pointing"), ("ur5", "pointing")])
def test_polished_nodes_of_a_tilted_pointing_path_are_on_it(name: str, task: str) -> None:
    """A tool axis along no axis of the world, and a grid so coarse that there is much to do."""
    robot = robot_named(name)
    start = start_of(robot, task) + 0.3
    pose = robot.pose(start)
    assert np.abs(pose.rotation[:, 2]).max() < 0.95
    end = pose.copy()
    end.translation = pose.translation + np.array([-0.04, 0.03, -0.03])
    end.rotation = pin.exp3(np.array([0.2, -0.3, 0.1])) @ pose.rotation
    path = sm.paths.Line(pose, end, 1.5)
    rows = sm.Task.of(task)
    rollout = Rollout(Follows.of(robot, path, rows), Grid.aligned(path.knots, 8))
    assert rollout.run(start, 0.1 * np.ones((33, robot.dof))) is None
    assert np.abs(rollout.drift).max() > 1e-7
    t, q, qd = rollout.polished()
    for here, speed, when in zip(q, qd, t, strict=True):
        error = rows.twist_error(path.pose(when), robot.pose(here))
        np.testing.assert_allclose(error, 0.0, atol=1e-12)
        rotation = robot.pose(here).rotation
        wanted = rows.select(path.twist(when)[:, None], rotation)[:, 0]
        np.testing.assert_allclose(robot.task_jacobian(here, rows) @ speed, wanted, atol=1e-12)


def test_polishing_leaves_the_run_as_it_is(panda: sm.RobotModel) -> None:
    """What `samples` and `pullback` return is that of the last run."""
    start = start_of(panda, "pose")
    path = short_line(panda, start)
    rollout = Rollout(Follows.of(panda, path, sm.Task.POSE), Grid.aligned(path.knots, 8))
    assert rollout.run(start, 0.1 * np.ones((33, 7))) is None
    before, drift = rollout.samples().q.copy(), rollout.drift
    counted = rollout.jacobian_evaluations
    _, q, _ = rollout.polished()
    assert rollout.jacobian_evaluations == counted + len(q)
    assert not np.array_equal(q, before[rollout.grid.node_stages])
    np.testing.assert_array_equal(rollout.samples().q, before)
    np.testing.assert_array_equal(rollout.drift, drift)


def test_what_broke_down_is_polished_as_far_as_it_goes(panda: sm.RobotModel) -> None:
    """Beyond the breakdown there is nothing that could be put onto the path."""
    start = start_of(panda, "pose")
    path = short_line(panda, start)
    rollout = Rollout(Follows.of(panda, path, sm.Task.POSE), Grid.aligned(path.knots, 8))
    epsilon = np.zeros((33, 7))
    epsilon[13] = np.inf
    assert rollout.run(start, epsilon) is not None
    t, q, _ = rollout.polished()
    for when, here in zip(t[:3], q[:3], strict=True):
        assert max(sm.Task.POSE.miss(path.pose(when), panda.pose(here))) < 1e-11

"""Retimed plans keep their geometry and the limits."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import linprog
from scipy.sparse import lil_array, vstack

import selfmotion as sm
from selfmotion.model.robot import Dynamics
from support.arms import PANDA_HOME, robot_named

ACCELERATION = 6.0
# A pace is the fastest where some limit is used by so much at nearly all times.
USED, BUSY = 0.9, 0.95
# With limits of the jerk, which change from one to the next within a quarter of a millisecond.
BUSY_WITH_JERKS = 0.85
# How much longer a motion may be than the optimum of its limits of velocity and acceleration on a
# grid: limits are kept between its points, and accelerations do not jump.
LONGER = 1.02
# What a pace on few knots loses where it begins, ends and goes from one joint's limit to another's;
# and how many those of a circle are, however slow it is.
SLOWLY, FEW_KNOTS = 2e-3, 6000


@pytest.fixture(scope="module")
def fast() -> sm.Plan:
    """A circle in half a second: far too fast for a Panda."""
    panda = robot_named("panda")
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 0.5, normal=(1.0, 0.0, 0.0))
    only = (sm.constraints.JointPositionLimits(),)
    return sm.plan(sm.Problem(panda, path, start=PANDA_HOME, constraints=only))


def test_retimed_plans_keep_limits_and_geometry(fast: sm.Plan, tmp_path) -> None:
    assert not fast.certificate.verified
    slow = sm.retime(fast, ACCELERATION)
    assert slow.certificate.verified, slow.certificate.verdict
    assert slow.certificate.acceleration_ratio is not None
    assert slow.certificate.acceleration_ratio.value <= 1.0
    assert slow.trajectory.duration > 2.0 * fast.trajectory.duration
    np.testing.assert_allclose(slow.trajectory.qd[[0, -1]], 0.0, atol=1e-6)
    assert isinstance(slow.path, sm.paths.Retimed)
    sigma = slow.path.pace(slow.trajectory.t)
    np.testing.assert_allclose(slow.trajectory.q, fast.trajectory(sigma), atol=1e-9)
    slow.save(tmp_path / "slow.npz")
    assert sm.load_plan(tmp_path / "slow.npz").check() == slow.certificate


@pytest.mark.parametrize("rate", [60.0, 125.0, 1000.0])
def test_samples_at_a_rate_keep_limits_and_geometry(fast: sm.Plan, rate: float) -> None:
    free, slow = sm.retime(fast, ACCELERATION), sm.retime(fast, ACCELERATION, rate=rate)
    assert slow.certificate.acceleration_ratio is not None
    assert slow.certificate.acceleration_ratio.value <= 1.0
    np.testing.assert_allclose(np.diff(slow.trajectory.t), 1.0 / rate, atol=1e-9)
    assert slow.trajectory.duration == pytest.approx(slow.path.duration)
    assert free.trajectory.duration < slow.trajectory.duration < 1.2 * free.trajectory.duration
    # At the samples it is on the same joint path, at a pace that is slower as a whole.
    at = slow.trajectory.t * free.trajectory.duration / slow.trajectory.duration
    np.testing.assert_allclose(slow.trajectory.q, free.trajectory(np.minimum(at, at[-1])),
                               atol=1e-9)  # fmt: skip
    # Sampled as it is, it passes them: that is what the time is for.
    sampled = free.trajectory.sample(rate)
    assert np.abs(sampled.extremes(2)[1]).max() > ACCELERATION
    for bad in (0.0, np.nan, 0.1, 1e12):
        with pytest.raises(sm.errors.ProblemError, match="rate is"):
            sm.retime(free, ACCELERATION, rate=bad)


def test_what_binds_does_so_where_it_did(panda: sm.RobotModel) -> None:
    """At other times, but at the same places of the joint path."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 6.0, normal=(1.0, 0.0, 0.0))
    limits = (sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits(0.36))
    problem = sm.Problem(panda, path, task="position", start=PANDA_HOME, constraints=limits)
    plan = sm.plan(problem).require()
    again = sm.retime(plan, ACCELERATION, velocity=0.15)
    plans, times = (plan, again), []
    for each in plans:
        spans = [span for item in each.report.active for span in item.spans]
        times.append(np.array(spans).ravel())
    assert len(times[0]) >= 2
    there = [each.trajectory(when) for each, when in zip(plans, times, strict=True)]
    np.testing.assert_allclose(there[1], there[0], atol=1e-6)
    assert np.abs(times[1] - times[0]).max() > 0.9


def test_the_factor_is_the_one_that_suffices(fast: sm.Plan) -> None:
    factor = sm.slowdown(fast)
    assert factor == pytest.approx(fast.certificate.velocity_ratio.value)
    panda = fast.robot
    for share, verified in ((1.01, True), (0.9, False)):
        duration = 0.5 * factor * share
        path = sm.paths.Circle.around(
            panda.pose(PANDA_HOME), 0.15, duration, normal=(1.0, 0.0, 0.0)
        )
        only = (sm.constraints.JointPositionLimits(),)
        plan = sm.plan(sm.Problem(panda, path, start=PANDA_HOME, constraints=only))
        assert plan.certificate.verified is verified
    assert sm.slowdown(fast, ACCELERATION) > factor


def test_bad_limits_are_refused(fast: sm.Plan) -> None:
    with pytest.raises(sm.errors.ProblemError, match="expected numbers > 0"):
        sm.retime(fast, 0.0)


def test_a_retimed_plan_keeps_what_the_plan_was_asked_to_keep(panda: sm.RobotModel) -> None:
    """Clearance and own velocity limits: what was refused before is not verified afterwards."""
    pose = panda.pose(PANDA_HOME)
    path = sm.paths.Circle.around(pose, 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    wall = sm.obstacles.Box(
        "wall", pose.translation + np.array([0.0, 0.0, 0.16]), [0.05, 0.05, 0.05]
    )
    slow = np.full(7, 0.9)
    problem = sm.Problem(
        panda,
        path,
        start=PANDA_HOME,
        constraints=[sm.constraints.JointVelocityLimits(slow)],
        clearance=sm.constraints.Clearance(wall, 0.03),
    )
    plan = sm.plan(problem, max_evaluations=5)
    retimed = sm.retime(plan, 10.0)
    assert "wall overlap by" in retimed.certificate.verdict
    assert retimed.certificate == retimed.check()
    assert np.abs(retimed.trajectory.qd).max() <= 0.9
    for bad in (np.nan, 0.0, [1.0, 2.0]):
        with pytest.raises(sm.errors.ProblemError):
            sm.slowdown(plan, bad)
        with pytest.raises(sm.errors.ProblemError):
            sm.retime(plan, bad)


@pytest.mark.site
def test_retiming_keeps_torques_and_what_the_tool_may(panda: sm.RobotModel) -> None:
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.12, 4.0, normal=(1.0, 0.0, 0.0))
    slow = sm.plan(sm.Problem(panda, path, start=PANDA_HOME)).require()
    dynamics, t = Dynamics(panda), np.linspace(0.0, 4.0, 2001)
    motion = slow.trajectory
    needed = np.abs(dynamics.torques(motion(t), motion(t, 1), motion(t, 2))).max(axis=0)
    for limit in (
        sm.constraints.JointTorqueLimits(1.1 * needed + 0.5),
        sm.constraints.ToolLimits(speed=0.6),
        sm.constraints.ToolLimits(acceleration=1.2),
    ):
        problem = dataclasses.replace(slow.problem, constraints=(*slow.problem.constraints, limit))
        asked = dataclasses.replace(slow, problem=problem)
        assert asked.check().verified
        free, kept = sm.retime(slow, 15.0), sm.retime(asked, 15.0)
        assert kept.certificate.verified, kept.certificate.verdict
        assert free.path.duration < kept.path.duration < slow.path.duration
        assert kept.limits_used.busy > BUSY


def cornered(robot: sm.RobotModel, start: np.ndarray) -> sm.paths.Path:
    """Straight legs around corners of 2 mm, at a constant feed."""
    pose = robot.pose(start)
    legs = np.array(
        [[0, 0, 0], [0, 0.1, 0], [0, 0.1, 0.03], [0, 0, 0.03], [0, 0, 0.06], [0, 0.1, 0.06]]
    )
    seam = sm.paths.Feed(
        sm.paths.Polyline(
            pose.translation + legs, np.tile(_quaternion(pose), (6, 1)), tolerance=2e-3
        ),
        0.1,
    )
    # A bit slower nobody asks for its feed.
    slower = 1.001
    rates = np.full(2, 1.0 / slower)
    return sm.paths.Retimed(seam, [0.0, slower * seam.duration], [0.0, seam.duration], rates)


def _quaternion(pose: pin.SE3) -> np.ndarray:
    x, y, z, w = pin.Quaternion(pose.rotation).coeffs()
    return np.array([w, x, y, z])


def optimum(motion: sm.Trajectory, velocity: np.ndarray, acceleration: np.ndarray) -> float:
    """Return the least time of a joint path by limits on a grid over its length: by HiGHS."""
    q_grid = motion(np.linspace(motion.t[0], motion.t[-1], 20001))
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(q_grid, axis=0), axis=1)))
    keep = np.append(True, np.diff(length) > 1e-12)
    s = np.linspace(0.0, length[-1], 1501)
    path = CubicSpline(length[keep], q_grid[keep])
    slope, bend, h = path(s, 1), path(s, 2), s[1]
    n, count = slope.shape[1], len(s)
    most = (velocity / np.maximum(np.abs(slope), 1e-12)).min(axis=1) ** 2
    most[0] = most[-1] = 0.0
    rows, right = [], []
    for k in range(count - 1):
        for at in (k, k + 1):
            table = lil_array((n, count))
            table[:, [k]] = -(slope[at] / (2.0 * h))[:, None]
            table[:, [k + 1]] = (slope[at] / (2.0 * h))[:, None]
            table[:, [at]] += bend[at][:, None]
            rows += [table, -table]
            right += [acceleration, acceleration]
    found = linprog(
        -np.ones(count),
        A_ub=vstack(rows, format="csr"),
        b_ub=np.concatenate(right),
        bounds=[(0.0, value) for value in most],
        method="highs",
    )
    rate = np.sqrt(np.maximum(found.x, 0.0))
    return float((2.0 * h / (rate[1:] + rate[:-1])).sum())


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_no_motion_along_the_path_is_much_faster(name: str) -> None:
    robot = robot_named(name)
    start = robot.dexterous_configuration()
    only = (sm.constraints.JointPositionLimits(),)
    plan = sm.plan(
        sm.Problem(robot, cornered(robot, start), "position", start=start, constraints=only)
    )
    velocity = np.full(robot.dof, 1.5)
    acceleration = np.minimum(8.0, robot.acceleration_limit)
    fast = sm.retime(plan, acceleration, velocity)
    assert fast.certificate.verified, fast.certificate.verdict
    motion = fast.trajectory
    assert motion.duration <= LONGER * optimum(plan.trajectory, velocity, acceleration)
    t = np.linspace(0.0, motion.duration, 5001)
    used = np.maximum(np.abs(motion(t, 1)) / velocity, np.abs(motion(t, 2)) / acceleration).max(
        axis=1
    )
    assert used.max() <= 1.0
    assert np.mean(used >= USED) >= BUSY


def test_jerks_cost_time_and_are_kept(panda: sm.RobotModel) -> None:
    path = cornered(panda, PANDA_HOME)
    times = []
    for jerk in (200.0, np.inf):
        limits = () if jerk == np.inf else (sm.constraints.JointJerkLimits(jerk, replace=True),)
        only = (sm.constraints.JointPositionLimits(), *limits)
        plan = sm.plan(sm.Problem(panda, path, "position", start=PANDA_HOME, constraints=only))
        fast = sm.retime(plan, 8.0, 1.5)
        assert fast.certificate.verified, fast.certificate.verdict
        assert np.abs(fast.trajectory.extremes(3)[1]).max() <= jerk
        times.append(fast.trajectory.duration)
        assert ("without a limit of jerk" in fast.report.message) is (jerk == np.inf)
        assert fast.report.message.startswith(plan.report.message)
        # No slower in corners than limits ask: at nearly all times some limit is used.
        motion = fast.trajectory
        t = np.linspace(0.0, motion.duration, 5001)
        used = [np.abs(motion(t, k)) / most for k, most in ((1, 1.5), (2, 8.0), (3, jerk))]
        assert np.mean(np.concatenate(used, axis=1).max(axis=1) >= USED) >= BUSY_WITH_JERKS
    assert times[0] > times[1]


def test_slow_limits_take_time_of_the_arm_alone(fast: sm.Plan) -> None:
    t = np.linspace(0.0, fast.trajectory.duration, 20001)
    speeds = np.abs(fast.trajectory(t, 1)).max(axis=1)
    # Each joint may be equally fast, so that the fastest of each time tells how long it takes.
    way = float(np.trapezoid(speeds, t))
    for velocity in (1e-2, 1e-3):
        slow = sm.retime(fast, 1.0, velocity)
        assert slow.certificate.verified, slow.certificate.verdict
        assert way <= velocity * slow.trajectory.duration <= (1.0 + SLOWLY) * way
        assert len(slow.trajectory.t) < FEW_KNOTS


def test_a_motion_that_begins_moving_goes_on_as_it_did(panda: sm.RobotModel) -> None:
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.1, 4.0, normal=(1.0, 0.0, 0.0))
    free = sm.plan(sm.Problem(panda, path, start=PANDA_HOME))
    qd = free.trajectory.qd[0]
    kept = (
        *free.problem.constraints,
        sm.constraints.StartVelocity(qd),
        sm.constraints.StartAcceleration(np.zeros(7)),
    )
    plan = dataclasses.replace(free, problem=dataclasses.replace(free.problem, constraints=kept))
    fast = sm.retime(plan, 8.0)
    assert np.abs(fast.trajectory.qd[0] - qd).max() <= 1e-9
    assert np.abs(fast.trajectory.qd[-1]).max() <= 1e-9
    assert fast.trajectory.duration < 0.7 * free.trajectory.duration


def test_waits_are_told_of_and_what_rests_all_the_time_is_refused(panda: sm.RobotModel) -> None:
    pose = panda.pose(PANDA_HOME)
    there = pin.SE3(pose.rotation, pose.translation + np.array([0.0, 0.05, 0.0]))
    forth, back = sm.paths.Line(pose, there, 1.0), sm.paths.Line(there, pose, 1.0)
    for waiting, told in ((forth + sm.paths.Dwell(there, 0.5) + back, True), (forth + back, False)):
        plan = sm.plan(sm.Problem(panda, waiting, start=PANDA_HOME))
        message = sm.retime(plan, ACCELERATION).report.message
        assert ("the 0.5 s that the tool waits" in message) == told
    still = sm.plan(sm.Problem(panda, sm.paths.Dwell(pose, 1.0), start=PANDA_HOME))
    with pytest.raises(sm.errors.PlanError, match="rests all the time"):
        sm.retime(still, ACCELERATION)


def test_windows_of_tolerances_are_where_they_were_on_the_path() -> None:
    """Up to rounding, not to the steps of the pace: near rest it hardly moves in one."""
    robot = robot_named("planar_3r")
    start, window = np.array([0.1, 0.9, 0.9]), np.array([0.05, 1.93])
    line = sm.paths.Line(robot.pose(start), robot.pose(start + 0.2), 2.0)
    limits = [sm.constraints.JointVelocityLimits(2.0), sm.constraints.JointAccelerationLimits(3.0)]
    relaxed = [sm.Relaxation("x", 0.01, during=tuple(window))]
    problem = sm.Problem(robot, line, "planar", start, constraints=limits, relaxations=relaxed)
    faster = sm.retime(sm.plan(problem, max_evaluations=3))
    passed = faster.path.pace(np.array(faster.problem.relaxations[0].during))
    np.testing.assert_allclose(passed, window, atol=1e-12)

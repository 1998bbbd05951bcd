"""Rows that may leave the path: laws of the deviation, and plans that use it."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.costs import OffPath
from selfmotion.engine.deviation import Deviation
from selfmotion.engine.objective import Objective
from selfmotion.engine.rollout import Rollout
from selfmotion.engine.start import FixedStart, FreeStart
from selfmotion.follow import Follows
from selfmotion.motion import NullMotionTable, PolynomialNullMotion
from selfmotion.motion.grid import Grid
from selfmotion.task.damping import DampingLaw
from support.arms import (
    PANDA_HOME,
    central_difference,
    objective_of,
    robot_named,
    short_line,
    start_of,
)
from support.followed import standing
from support.random_cells import LEFT, RIGHT, random_cell, random_follows

# Exact gradients against central differences, relative to the largest entry.
GRADIENT = 1e-6


# Central differences of targets over 2e-5 s: their truncation, third derivatives times 1e-10.
TARGET = 1e-7


# Bands hold by construction: what is left is rounding.
ROUNDING = 1e-12


RELAXATIONS = {
    "a row": [sm.Relaxation("z", 0.01)],
    "tool axes": [sm.Relaxation(("x", "z"), 0.02, axes="tool")],
    "a cone": [sm.Relaxation(("rx", "ry"), 0.3)],
    "a window": [sm.Relaxation("y", during=(0.3, 1.1), intervals=6)],
    "several": [
        sm.Relaxation(("rx", "ry"), 0.4),
        sm.Relaxation("z", 0.03, axes="tool"),
        sm.Relaxation("rz", during=(0.2, 0.9), intervals=7),
        sm.Relaxation("x", 0.01, during=(0.5, 1.5), axes="tool"),
    ],
}


TASKS = {"pose": RELAXATIONS, "pointing": {k: RELAXATIONS[k] for k in ("tool axes", "a cone")}}


CASES = [(task, name) for task, listed in TASKS.items() for name in listed]


def turning_path(robot: sm.RobotModel, start: Array) -> sm.Path:
    """Return a path of 1.5 s on which the tool also turns, about no axis of its own."""
    pose = robot.pose(start)
    end = pose.copy()
    end.translation = pose.translation + np.array([-0.04, 0.03, -0.03])
    end.rotation = pin.exp3(np.array([0.2, -0.3, 0.4])) @ pose.rotation
    return sm.Line(pose, end, 1.5)


def objective_with(task: str, name: str, *, free: bool, damped: bool) -> Objective:
    robot, rows, relaxations = robot_named("panda"), sm.Task.of(task), TASKS[task][name]
    start = start_of(robot, task)
    path = turning_path(robot, start)
    grid = Grid.aligned(path.knots, 12)
    functions = PolynomialNullMotion(1, "joint").functions(grid.stage_times, path.duration)
    # Above every singular value on the way: damped throughout, with the path error as a cost.
    law = DampingLaw(0.5, 0.25) if damped else None
    costs: list[sm.Cost] = [sm.JointVelocity(), sm.Posture(np.ones(7), posture=PANDA_HOME)]
    return objective_of(
        Rollout(Follows.of(robot, path, rows), grid, damping=law),
        NullMotionTable(functions, None, robot.dof),
        [*costs, OffPath(100.0, rows.dimension)] if damped else costs,
        FreeStart(standing(robot, rows), start) if free else FixedStart(start),
        deviation=Deviation(path, relaxations, grid.stage_times, (not free, False)),
    )


@pytest.mark.parametrize("damped", [False, True])
@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize(("task", "name"), CASES)
def test_gradient_and_tangents_equal_central_differences(
    task: str, name: str, free: bool, damped: bool
) -> None:
    assert_derivatives(objective_with(task, name, free=free, damped=damped))


@pytest.mark.parametrize("damped", [False, True])
@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("seed", range(2))
def test_the_first_of_several_paths_may_be_relaxed(
    seed: int, free: bool, damped: bool, tmp_path: Path
) -> None:
    """Cells made at random: a band in a row of each kind that the first path's task has."""
    rng = np.random.default_rng(seed)
    robot = sm.load_robot(random_cell(rng, tmp_path), tool=(LEFT, RIGHT))
    items: list[sm.Follow] = []
    while len(items) < 2:
        items, follows, start = random_follows(rng, robot)
    first = follows.items[0]
    bands = {"position": [("x", "y")], "pointing": ["z", "rx"], "pose": ["y", ("rx", "rz")]}
    relaxations = [sm.Relaxation(rows, 0.05) for rows in bands[first.task.value]]
    grid = Grid.aligned(first.path.knots, 12)
    functions = PolynomialNullMotion(1, "joint").functions(grid.stage_times, first.path.duration)
    costs: list[sm.Cost] = [sm.JointVelocity(), sm.Posture(np.ones(robot.dof), posture=start)]
    objective = objective_of(
        Rollout(follows, grid, damping=DampingLaw(0.5, 0.25) if damped else None),
        NullMotionTable(functions, None, robot.dof),
        [*costs, OffPath(100.0, follows.dimension)] if damped else costs,
        FreeStart(follows, start) if free else FixedStart(start),
        deviation=Deviation(first.path, relaxations, grid.stage_times, (not free, False)),
    )
    assert_derivatives(objective)


def assert_derivatives(objective: Objective) -> None:
    x = 0.02 * np.random.default_rng(5).normal(size=objective.size)
    exact = objective.gradient(x)
    approximate = central_difference(objective.value, x)
    np.testing.assert_allclose(exact, approximate, atol=GRADIENT * np.abs(exact).max())
    tangents = objective.node_tangents(x)
    direction = np.random.default_rng(6).normal(size=objective.size)
    ends = []
    for sign in (1.0, -1.0):
        samples = objective.samples(x + sign * 1e-6 * direction)
        ends.append(samples.qd[samples.nodes].copy())
    expected = (ends[0] - ends[1]) / 2e-6
    scale = np.abs(expected).max()
    np.testing.assert_allclose(tangents.qd @ direction, expected, atol=1e-6 * scale)


@pytest.mark.parametrize(("task", "name"), CASES)
def test_a_pullback_is_what_the_matrix_says(task: str, name: str) -> None:
    """Also with a deviation at c = 0."""
    robot, t = robot_named("panda"), np.linspace(0.0, 1.5, 13)
    path = turning_path(robot, start_of(robot, task))
    rng = np.random.default_rng(9)
    size = Deviation(path, TASKS[task][name], t, (True, False)).size
    around = 0.3 * rng.normal(size=size)
    deviation = Deviation(path, TASKS[task][name], t, (True, False), around=around)
    c, cotangents = rng.normal(size=size), rng.normal(size=(len(t), 12))
    expected = np.tensordot(cotangents, deviation.matrix(c), 2)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(deviation.pullback(c, cotangents), expected, atol=1e-12 * scale)


@pytest.mark.parametrize("free", [False, True])
def test_the_metric_counts_the_path_error_of_a_damped_motion(free: bool) -> None:
    """∫ Σ (∂y/∂x)ᵀ W (∂y/∂x) dt over q, q̇ and the error S e, by central differences of motions."""
    objective = objective_with("pose", "a window", free=free, damped=True)
    x = 0.01 * np.random.default_rng(7).normal(size=objective.size)
    weights = objective.grid.sampling.weights

    def motion(x: Array) -> list[Array]:
        samples = objective.samples(x)
        return [samples.qd.copy(), samples.q.copy(), samples.error.copy()]

    ends = [[motion(x + sign * e) for sign in (1.0, -1.0)] for e in 1e-6 * np.eye(len(x))]
    expected = np.zeros((len(x), len(x)))
    for which, weight in enumerate((1.0, 1.0, 100.0)):
        rows = np.stack([(a[which] - b[which]) / 2e-6 for a, b in ends], axis=2)
        expected += weight * np.einsum("s,sid,sie->de", weights, rows, rows)
    # To first order in the error, which damping makes a few degrees.
    np.testing.assert_allclose(objective.metric(x), expected, atol=0.02 * np.abs(expected).max())


def test_the_metric_bends_where_bands_hold() -> None:
    """Besides the Gauss-Newton matrix |∂F/∂c|, for what is within a band and for nothing else."""
    objective = objective_with("pose", "several", free=False, damped=False)
    x = 0.02 * np.random.default_rng(8).normal(size=objective.size)
    z, coefficients, c = objective.parts(x)
    assert (len(z), len(coefficients) + len(c)) == (0, len(x))
    weights, metric = objective.grid.sampling.weights, objective.metric(x)
    tangents = objective._sensitivities(x)
    plain = sum(np.einsum("s,sid,sie->de", weights, rows, rows) for rows in tangents)
    extra = metric - plain
    bent = np.abs(objective.gradient(x))[-len(c) :] * objective._deviation.banded
    assert 0 < np.count_nonzero(bent) < len(c)
    expected = np.diag(np.concatenate([np.zeros(len(coefficients)), bent]))
    np.testing.assert_allclose(extra, expected, atol=1e-9 * np.abs(plain).max())


@pytest.mark.parametrize("name", RELAXATIONS)
def test_twist_is_the_derivative_of_the_displaced_pose(name: str) -> None:
    robot = robot_named("panda")
    path = turning_path(robot, PANDA_HOME)
    t, step = np.linspace(0.05, 1.45, 9), 1e-5
    times = np.concatenate([t - step, t, t + step])
    deviation = Deviation(path, RELAXATIONS[name], times, (False, False))
    c = 0.05 * np.random.default_rng(2).normal(size=deviation.size)
    target = deviation.target(c)
    before, here, after = (slice(k * len(t), (k + 1) * len(t)) for k in range(3))
    velocity = (target.translation[after] - target.translation[before]) / (2 * step)
    np.testing.assert_allclose(target.twist[here, :3], velocity, atol=TARGET)
    turned = target.rotation[after] @ target.rotation[before].transpose(0, 2, 1)
    spin = np.array([pin.log3(rotation) for rotation in turned]) / (2 * step)
    np.testing.assert_allclose(target.twist[here, 3:], spin, atol=TARGET)


@pytest.mark.parametrize("size", [1e-3, 0.05, 1.0])
@pytest.mark.parametrize("name", RELAXATIONS)
def test_target_matrix_equals_central_differences(name: str, size: float) -> None:
    """Also where the sine of the band is past its crest."""
    path = turning_path(robot_named("panda"), PANDA_HOME)
    deviation = Deviation(path, RELAXATIONS[name], np.linspace(0.0, 1.5, 23), (False, True))
    c = size * np.random.default_rng(3).normal(size=deviation.size)
    exact = deviation.matrix(c)
    here = deviation.target(c)
    for i in range(deviation.size):
        shift = np.zeros_like(c)
        shift[i] = 1e-6
        up, down = deviation.target(c + shift), deviation.target(c - shift)
        by_twist = (up.twist - down.twist) / 2e-6
        by_p = (up.translation - down.translation) / 2e-6
        by_r = (up.rotation - down.rotation) @ here.rotation.transpose(0, 2, 1) / 2e-6
        scale = max(np.abs(by_twist).max(), 1.0)
        np.testing.assert_allclose(exact[:, :3, i], by_p, atol=1e-7)
        vector = np.stack([by_r[:, 2, 1], by_r[:, 0, 2], by_r[:, 1, 0]], axis=1)
        np.testing.assert_allclose(exact[:, 3:6, i], vector, atol=1e-7)
        np.testing.assert_allclose(exact[:, 6:, i], by_twist, atol=1e-6 * scale)


@pytest.mark.parametrize("name", RELAXATIONS)
def test_bands_and_windows_hold_for_any_coefficients(name: str) -> None:
    """Measured from the poses alone: within the band, and nothing outside the window."""
    path = turning_path(robot_named("panda"), PANDA_HOME)
    t = np.linspace(0.0, 1.5, 301)
    for item in RELAXATIONS[name]:
        deviation = Deviation(path, [item], t, (True, False))
        c = np.random.default_rng(7).normal(size=deviation.size)
        target, nominal = deviation.target(c), path.samples(t)
        shift = target.translation - nominal.translation
        if item.axes == "tool":
            shift = np.einsum("kji,kj->ki", nominal.rotation, shift)
        relative = nominal.rotation.transpose(0, 2, 1) @ target.rotation
        rows = np.hstack([shift, [pin.log3(rotation) for rotation in relative]])
        size = np.linalg.norm(rows[:, item.indices], axis=1)
        assert size.max() <= item.band + ROUNDING
        assert size.max() > 0.5 * min(item.band, 0.1)
        others = [k for k in range(6) if k not in item.indices]
        # log near half a turn and small sines: rounding grows to some 1e-12.
        np.testing.assert_allclose(rows[:, others], 0.0, atol=1e-11)
        first, last = item.window(1.5)
        assert np.all(size[(t < first) | (t > last)] <= ROUNDING)
        assert size[0] <= ROUNDING
        if set(item.rows) == {"rx", "ry"}:
            axis = np.arccos(np.clip(relative[:, 2, 2], -1.0, 1.0))
            assert axis.max() <= item.band + 1e-7


@pytest.mark.parametrize("free", [False, True])
def test_a_cone_lowers_the_cost_and_is_kept(panda_circle: Callable, free: bool) -> None:
    problem = panda_circle()
    if free:
        problem = dataclasses.replace(problem, start="free")
    # A cone is kept by whatever optimises it; the global search has tests of its own.
    search = sm.Search(mode="local") if free else None
    exact = sm.plan(problem, search=search)
    cone = sm.Relaxation(("rx", "ry"), 0.2)
    plan = sm.plan(dataclasses.replace(problem, relaxations=[cone]), search=search)
    assert plan.certificate.verified, plan.certificate.verdict
    assert plan.report.cost < 0.99 * exact.report.cost
    # Judged without the package: the tool's axis against the path's.
    t = np.linspace(0.0, 4.0, 401)
    angles = []
    for time, q in zip(t, plan.trajectory(t), strict=True):
        target, actual = plan.path.pose(time), plan.robot.pose(q)
        assert np.linalg.norm(actual.translation - target.translation) < 1e-6
        angles.append(np.arccos(np.clip(actual.rotation[:, 2] @ target.rotation[:, 2], -1, 1)))
    assert 0.05 < max(angles) <= 0.2 + 1e-6
    # Without the relaxation the same motion is refused.
    exact = dataclasses.replace(plan.problem, relaxations=())
    assert not dataclasses.replace(plan, problem=exact).check().verified


def test_a_band_is_used_and_a_smaller_one_is_refused(planar: sm.RobotModel) -> None:
    problem = dataclasses.replace(
        sm.sample_problem(), relaxations=[sm.Relaxation("y", 0.05)], constraints=()
    )
    plan = sm.plan(problem)
    exact = sm.plan(dataclasses.replace(problem, relaxations=()))
    assert plan.certificate.verified, plan.certificate.verdict
    assert plan.report.cost < exact.report.cost
    t = np.linspace(0.0, 1.0, 501)
    q = plan.trajectory(t)
    x, y = planar_tool(q)
    target = plan.path.samples(t).translation
    np.testing.assert_allclose(x, target[:, 0], atol=1e-6)
    assert 0.02 < np.abs(y - target[:, 1]).max() <= 0.05 + 1e-6
    narrower = (sm.Relaxation("y", 0.02),)
    asked = dataclasses.replace(plan.problem, relaxations=narrower)
    check = dataclasses.replace(plan, problem=asked).check()
    assert not check.verified
    largest = np.abs(y - target[:, 1]).max()
    assert check.position_error.value == pytest.approx(largest - 0.02, abs=1e-4)


def planar_tool(q: Array) -> tuple[Array, Array]:
    """Return x and y of the sample problem's tool: links 2, 2, 1 m."""
    angles = np.cumsum(q, axis=1)
    lengths = np.array([2.0, 2.0, 1.0])
    return np.cos(angles) @ lengths, np.sin(angles) @ lengths


def test_a_row_is_off_in_its_window_only(panda_circle: Callable) -> None:
    window = sm.Relaxation("rz", during=(1.0, 2.5))
    plan = sm.plan(panda_circle(relaxations=[window]))
    assert plan.certificate.verified, plan.certificate.verdict
    t = np.linspace(0.0, 4.0, 801)
    misses = []
    for time, q in zip(t, plan.trajectory(t), strict=True):
        relative = plan.path.pose(time).rotation.T @ plan.robot.pose(q).rotation
        misses.append(pin.log3(relative))
    turned = np.abs(misses)
    outside = (t < 1.0) | (t > 2.5)
    assert turned[outside].max() < 1e-6
    assert turned[:, :2].max() < 1e-6
    assert turned[:, 2].max() > 1e-3
    # Neither speed nor acceleration jumps at the window's ends.
    for edge in (1.0, 2.5):
        for order in (1, 2):
            sides = plan.trajectory(np.array([edge - 1e-3, edge + 1e-3]), order=order)
            scale = np.abs(plan.trajectory(t, order=order)).max()
            assert np.abs(np.diff(sides, axis=0)).max() < 0.05 * scale


def test_six_joints_and_a_full_pose_with_a_cone() -> None:
    """No self-motion at all: the deviation is all there is to optimise."""
    robot = robot_named("ur5")
    start = start_of(robot, "pose")
    path = short_line(robot, start)
    with pytest.raises(sm.RedundancyError, match="relax"):
        sm.Problem(robot, path, start=start)
    cone = sm.Relaxation(("rx", "ry"), 0.3)
    for given in (start, None):
        search = sm.Search(starts=4) if given is None else None
        plan = sm.plan(sm.Problem(robot, path, start=given, relaxations=[cone]), search=search)
        assert plan.certificate.verified, plan.certificate.verdict
        assert plan.report.cost < 0.99 * plan.report.initial_cost
    circle = sm.Circle.around(robot.pose(start), 0.05, 2.0, normal=(1.0, 0.0, 0.0))
    closed = sm.plan(
        sm.Problem(robot, circle, start=start, relaxations=[cone], constraints=[sm.ClosedPath()])
    )
    assert closed.certificate.verified, closed.certificate.verdict


@pytest.mark.parametrize("band", [1e-3, 1e-4, 1e-5])
def test_a_narrow_band_costs_no_more_than_none(panda_circle: Callable, band: float) -> None:
    """And no work or acceleration beyond what the plan without it takes, up to small factors."""
    # By one method: a path that is not relaxed is optimised by another one otherwise.
    way = {"null_motion": sm.RefinedNullMotion()}
    exact = sm.plan(panda_circle(**way))
    plan = sm.plan(panda_circle(relaxations=[sm.Relaxation("z", band)], **way))
    assert plan.certificate.verified, plan.certificate.verdict
    assert plan.report.cost <= exact.report.cost * (1.0 + 1e-6)
    assert plan.report.steps <= 4 * exact.report.steps
    fastest = [np.abs(each.trajectory.extremes(2)[1]).max() for each in (plan, exact)]
    assert fastest[0] < 2.0 * fastest[1]


def test_other_methods_refuse_relaxations(panda_circle: Callable) -> None:
    with pytest.raises(sm.ProblemError, match="leave the relaxations out"):
        sm.plan_by(panda_circle(relaxations=[sm.Relaxation("z", 0.01)]), sm.PseudoInverse())


def test_closed_paths_begin_and_end_on_the_path(panda_circle: Callable) -> None:
    band = sm.Relaxation("x", 0.01)
    constraints = (sm.JointPositionLimits(), sm.JointVelocityLimits(), sm.ClosedPath())
    plan = sm.plan(
        dataclasses.replace(panda_circle(), start=None, relaxations=[band], constraints=constraints)
    )
    assert plan.certificate.verified, plan.certificate.verdict
    assert plan.certificate.closure < 1e-6
    for time, q in ((0.0, plan.trajectory.q[0]), (4.0, plan.trajectory.q[-1])):
        miss = sm.Task.POSE.miss(plan.path.pose(time), plan.robot.pose(q))
        assert max(miss) < 1e-6


def test_relaxations_survive_saving_and_retiming(panda_circle: Callable, tmp_path: Path) -> None:
    relaxations = [
        sm.Relaxation(("rx", "ry"), 0.1, during=(1.0, 3.0)),
        sm.Relaxation("x", axes="tool", during=(0.5, 2.0)),
    ]
    plan = sm.plan(panda_circle(relaxations=relaxations))
    plan.save(tmp_path / "plan.npz")
    loaded = sm.load_plan(tmp_path / "plan.npz")
    assert loaded.problem.relaxations == tuple(relaxations)
    assert loaded.check().verified
    slower = sm.retime(plan, acceleration=5.0)
    assert slower.certificate.verified, slower.certificate.verdict
    assert slower.problem.relaxations[0].during != (1.0, 3.0)

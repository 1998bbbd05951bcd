"""Plans that make use of tolerances: within their bands, in their windows, for less."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.planner.largest_part import _Push, _start_guess_of, _until
from support.arms import robot_named, short_line, start_of


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
    free = sm.sample_problem(null_motion=sm.motion.FreeNullMotion())
    problem = dataclasses.replace(free, relaxations=[sm.Relaxation("y", 0.05)], constraints=())
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
    with pytest.raises(sm.errors.RedundancyError, match="relax"):
        sm.Problem(robot, path, start=start)
    cone = sm.Relaxation(("rx", "ry"), 0.3)
    for given in (start, None):
        search = sm.Search(starts=4) if given is None else None
        plan = sm.plan(sm.Problem(robot, path, start=given, relaxations=[cone]), search=search)
        assert plan.certificate.verified, plan.certificate.verdict
        assert plan.report.cost < 0.99 * plan.report.initial_cost
    circle = sm.paths.Circle.around(robot.pose(start), 0.05, 2.0, normal=(1.0, 0.0, 0.0))
    closed = sm.plan(
        sm.Problem(
            robot,
            circle,
            start=start,
            relaxations=[cone],
            constraints=[sm.constraints.ClosedPath()],
        )
    )
    assert closed.certificate.verified, closed.certificate.verdict


@pytest.mark.parametrize("band", [1e-3, 1e-4, 1e-5])
def test_a_narrow_band_costs_no_more_than_none(panda_circle: Callable, band: float) -> None:
    """And no work or acceleration beyond what the plan without it takes, up to small factors."""
    exact = sm.plan(panda_circle())
    plan = sm.plan(panda_circle(relaxations=[sm.Relaxation("z", band)]))
    assert plan.certificate.verified, plan.certificate.verdict
    assert plan.report.cost <= exact.report.cost * (1.0 + 1e-6)
    assert plan.report.steps <= 4 * exact.report.steps
    fastest = [np.abs(each.trajectory.extremes(2)[1]).max() for each in (plan, exact)]
    assert fastest[0] < 2.0 * fastest[1]


def test_other_methods_refuse_relaxations(panda_circle: Callable) -> None:
    with pytest.raises(sm.errors.ProblemError, match="leave the relaxations out"):
        sm.plan_by(
            panda_circle(relaxations=[sm.Relaxation("z", 0.01)]), sm.baselines.PseudoInverse()
        )


@pytest.mark.parametrize("given", [False, True])
def test_where_a_path_closes_the_deviation_does_so_too(panda_circle: Callable, given: bool) -> None:
    """A given start is on the path itself, and so is the end then."""
    band = sm.Relaxation("x", 0.01)
    constraints = (
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
        sm.constraints.ClosedPath(),
    )
    problem = dataclasses.replace(panda_circle(), relaxations=[band], constraints=constraints)
    problem = problem if given else dataclasses.replace(problem, start=None)
    plan = sm.plan(problem)
    assert plan.certificate.verified, plan.certificate.verdict
    assert plan.certificate.closure < 1e-6
    ends = ((0.0, plan.trajectory.q[0]), (4.0, plan.trajectory.q[-1]))
    away = [plan.robot.pose(q).translation - plan.path.pose(t).translation for t, q in ends]
    np.testing.assert_allclose(away[0], away[1], atol=1e-6)
    assert (np.abs(away).max() < 1e-6) == given


def test_ends_that_are_asked_for_are_on_the_path(panda_circle: Callable) -> None:
    """However much of the band is used on the way."""
    exact = sm.plan(panda_circle())
    end = sm.constraints.EndConfiguration(exact.trajectory.q[-1])
    band = sm.Relaxation(("x", "y"), 0.01)
    limits = (sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits())
    for asked in (end, sm.constraints.EndVelocity(0.0)):
        plan = sm.plan(panda_circle(relaxations=[band], constraints=[*limits, asked]))
        assert plan.certificate.verified, plan.certificate.verdict
        assert plan.certificate.deviations[0].value > 1e-3
        miss = sm.Task.POSE.miss(plan.path.pose(4.0), plan.robot.pose(plan.trajectory.q[-1]))
        assert max(miss) < 1e-6


def test_a_plan_is_begun_with_where_its_tool_deviates(panda_circle: Callable) -> None:
    band = sm.Relaxation(("rx", "ry"), 0.2)
    first = sm.plan(panda_circle(relaxations=[band]))
    again = sm.plan(panda_circle(relaxations=[band]), warm_start=first)
    assert again.certificate.verified
    assert again.report.evaluations < first.report.evaluations
    assert again.report.cost == pytest.approx(first.report.cost, rel=1e-4)


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


def test_a_part_before_a_window_has_none_of_its_joints(panda: sm.RobotModel) -> None:
    """Out of reach before the window begins: what is planned ends where it does without it."""
    start = panda.dexterous_configuration()
    pose = panda.pose(start)
    away = pin.SE3(pose.rotation, pose.translation + np.array([1.2, 0.0, 0.0]))
    line = sm.paths.Line(pose, away, 4.0)
    problem = sm.Problem(panda, line, start=start, clearance=None)
    late = sm.Relaxation("z", 5e-3, during=(3.5, 3.9), axes="tool")
    ends = [
        sm.plan(dataclasses.replace(problem, relaxations=items), max_evaluations=20)
        for items in ([], [late])
    ]
    assert all(plan.report.ending for plan in ends)
    assert ends[1].trajectory.duration == pytest.approx(ends[0].trajectory.duration, rel=0.02)
    # What was begun with on a longer part is cut to the joints that are left.
    whole = Formulation.of(dataclasses.replace(problem, relaxations=[late]))
    part, push = _until(whole, 2.0), _Push(np.ones(8))
    failed: Any = SimpleNamespace(formulation=whole, start_guess=(whole.given_start, push))
    first, guide = _start_guess_of(part, failed)
    np.testing.assert_array_equal(first, start)
    assert guide is not None
    np.testing.assert_array_equal(guide(np.zeros(2)), np.ones((2, 7)))


def test_the_published_method_knows_no_tolerances() -> None:
    """Nothing would keep the tool within its band: said at once."""
    problem = dataclasses.replace(sm.sample_problem(), relaxations=[sm.Relaxation("y", 0.05)])
    with pytest.raises(sm.errors.ProblemError, match=r"relaxations: .* leave null_motion out"):
        sm.plan(problem)


def test_a_part_without_self_motion_is_none() -> None:
    """Before a window six joints have none: what is in the way is said, not that of a part."""
    arm = robot_named("ur10")
    start = arm.dexterous_configuration("pose")
    far = arm.pose(start)
    far.translation = 3.0 * far.translation
    line = sm.paths.Line(arm.pose(start), far, 4.0)
    window = [sm.Relaxation("rz", 0.3, during=(2.5, 3.5))]
    problem = sm.Problem(arm, line, "pose", relaxations=window)
    with pytest.raises(sm.errors.NoSequenceError, match="no motion along the path passes"):
        sm.plan(problem)


# A deviation of the given start that is allowed, and one a little beyond.
WITHIN, BEYOND = 0.99, 1.01


def leaning(
    arm: str, share: float, band: float = 0.2
) -> tuple[sm.RobotModel, Array, sm.paths.Path]:
    """Return an arm, its start, and a line from where the tool leans by a share of the band."""
    robot = robot_named(arm)
    start = start_of(robot, "pose")
    lean = pin.SE3(pin.exp3(share * band * np.array([0.6, -0.8, 0.0])), np.zeros(3))
    first = robot.pose(start).act(lean.inverse())
    last = pin.SE3(first.rotation, first.translation + np.array([0.0, 0.05, 0.0]))
    return robot, start, sm.paths.Line(first, last, 3.0)


@pytest.mark.parametrize("arm", ["panda", "xarm7"])
def test_a_motion_may_begin_and_end_where_tolerances_allow(arm: str) -> None:
    cone = [sm.Relaxation(("rx", "ry"), 0.2)]
    robot, start, path = leaning(arm, WITHIN)
    problem = sm.Problem(robot, path, "pose", start, relaxations=cone, clearance=None)
    plan = sm.plan(problem)
    assert plan.certificate.verified, plan.certificate.verdict
    np.testing.assert_allclose(plan.trajectory.q[0], start, atol=1e-12)
    # It ends elsewhere in the cone: that may be asked for as well.
    last = plan.trajectory.q[-1]
    assert np.linalg.norm(plan.deviation([3.0])[0, 3:5]) > 0.01
    asked = (*problem.constraints, sm.constraints.EndConfiguration(last))
    again = sm.plan(dataclasses.replace(problem, constraints=asked))
    assert again.certificate.verified, again.certificate.verdict
    np.testing.assert_allclose(again.trajectory.q[-1], last, atol=1e-6)


def test_a_start_or_an_end_beyond_tolerances_is_refused() -> None:
    cone = [sm.Relaxation(("rx", "ry"), 0.2)]
    robot, start, path = leaning("panda", BEYOND)
    with pytest.raises(sm.errors.StartError, match=r"0.002 rad off .* beyond its tolerances"):
        sm.Problem(robot, path, "pose", start, relaxations=cone)
    end = [sm.constraints.EndConfiguration(start)]
    backwards = sm.paths.Line(path.pose(3.0), path.pose(0.0), 3.0)
    with pytest.raises(sm.errors.ProblemError, match=r"0.002 rad off the end .* its tolerances"):
        sm.Problem(robot, backwards, "pose", relaxations=cone, constraints=end)
    # Nor where the window is shut.
    robot, start, path = leaning("panda", WITHIN)
    later = [sm.Relaxation(("rx", "ry"), 0.2, during=(1.0, 2.0))]
    with pytest.raises(sm.errors.StartError, match=r"0.198 rad off"):
        sm.Problem(robot, path, "pose", start, relaxations=later)


def test_parts_are_one_where_a_start_leans() -> None:
    """The search for parts knows the path itself alone, which no step leads to from there."""
    cone = [sm.Relaxation(("rx", "ry"), 0.2)]
    robot, start, path = leaning("panda", WITHIN)
    parts = sm.plan_in_parts(sm.Problem(robot, path, "pose", start, relaxations=cone))
    assert len(parts.plans) == 1
    assert parts.verified

"""Plans: the paper's numbers, the accuracy promised, and what is said of what falls short."""

import dataclasses
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import yourdfpy

import selfmotion as sm
from selfmotion.certificate import Certificate, Extreme
from selfmotion.planning.optimise import Status
from selfmotion.planning.planner.local_search import LocalSearch
from selfmotion.planning.planner.run import message_of, status_of
from support.arms import robot_named

# Share of the cost that finer nodes may still save.
LEFT = 2e-4


@pytest.fixture(scope="module")
def sample() -> sm.Plan:
    return sm.plan(sm.sample_problem())


def certified(sample: sm.Plan, *failures: str, off: float = 0.0) -> Certificate:
    """Return a certificate of which something is wrong: the tool that far off, and what is said."""
    certificate = sample.certificate
    error = dataclasses.replace(certificate.position_error, value=off)
    least = Extreme(3e-7, 1.5, "tool")
    return dataclasses.replace(
        certificate, failures=failures, position_error=error, smallest_singular_value=least
    )


@pytest.mark.parametrize("on_path", [True, False])
def test_next_to_a_singular_pose_no_gradient_is_blamed(sample: sm.Plan, on_path: bool) -> None:
    wrong = () if on_path else ("the tool is off",)
    certificate = certified(sample, *wrong, off=0.0 if on_path else 1.0)
    said = message_of(Status.GRADIENT, (), certificate)
    singular = "the motion passes a singular pose near t = 1.5 s (smallest singular value 3e-07)"
    assert said.startswith(Status.GRADIENT.message if on_path else singular)
    assert ("the tool is off" in said) != on_path


@pytest.mark.parametrize("verified", [True, False])
def test_what_is_verified_is_not_called_infeasible(sample: sm.Plan, verified: bool) -> None:
    wrong = "clearance: the convex hulls of 'torch' and 'pipes' overlap by 49.37 mm"
    certificate = certified(sample, *(() if verified else ("torch - pipes meet",)))
    said = message_of(Status.INFEASIBLE, (wrong,), certificate)
    assert wrong in said
    assert ("kept by the motion" in said) == verified
    status = status_of(Status.INFEASIBLE, certificate)
    assert status is (Status.PRECISION if verified else Status.INFEASIBLE)


Circle = Callable[..., sm.Problem]


def test_sample_problem_without_self_motion(sample: sm.Plan) -> None:
    """Against an independent high-order integration (rtol 1e-10)."""
    report = sample.report
    assert report.initial_cost == pytest.approx(15.500547, abs=1e-4)
    assert report.initial_terms["joint velocity"] == pytest.approx(15.415431, abs=1e-4)
    assert report.initial_terms["inverse manipulability"] == pytest.approx(0.085116, abs=1e-5)
    end = sample.initial_trajectory.q[-1]
    np.testing.assert_allclose(end, [-1.582881, 4.814126, -0.269540], atol=2e-5)


def test_sample_problem_optimum(sample: sm.Plan) -> None:
    assert sample.report.cost == pytest.approx(10.5137, abs=1e-4)
    first = next(i for i in sample.report.history if i.cost <= 10.5145)
    assert first.evaluations <= 10
    assert sample.report.evaluations <= 15
    assert sample.report.status is sm.optimise.Status.CONVERGED
    assert sample.certificate.verified


def test_the_papers_twelve_coefficients() -> None:
    motion = sm.PolynomialNullMotion(3, "joint", "monomial")
    plan = sm.plan(sm.sample_problem(null_motion=motion))
    assert plan.coefficients.shape == (12,)
    assert plan.report.cost <= 10.4855
    identity = sm.plan(
        sm.sample_problem(null_motion=motion), optimizer=sm.QuasiNewton(initial_metric="identity")
    )
    assert identity.report.cost <= 10.4900
    default = sm.plan(sm.sample_problem())
    assert default.report.evaluations < 0.5 * identity.report.evaluations


def test_higher_degree_is_never_worse() -> None:
    costs = [
        sm.plan(sm.sample_problem(null_motion=sm.PolynomialNullMotion(degree))).report.cost
        for degree in (0, 1, 3, 7)
    ]
    assert np.all(np.diff(costs) < 1e-6)
    assert costs[-1] == pytest.approx(10.4931, abs=2e-4)


def test_there_and_back() -> None:
    plan = sm.plan(sm.sample_problem(duration=2.0, null_motion=sm.PolynomialNullMotion(7)))
    assert plan.certificate.verified
    assert plan.report.cost < plan.report.initial_cost


def test_without_the_velocity_term_joints_race(sample: sm.Plan) -> None:
    """Why the paper adds the term: manipulability alone is bought with any joint speed."""
    alone = dataclasses.replace(sm.sample_problem(), costs=[sm.costs.Manipulability()])
    plan = sm.plan(alone, max_evaluations=100)
    assert np.abs(plan.trajectory.qd).max() > 2.0 * np.abs(sample.trajectory.qd).max()
    assert plan.report.cost < plan.report.initial_cost


@pytest.mark.parametrize("task", [None, "pose", "position", "pointing"])
def test_evaluations_to_the_optimum(panda_circle: Circle, task: str | None) -> None:
    """Within 1 % after at most 6 evaluations, within 1e-6 after at most 15, on one grid."""
    problem = sm.sample_problem() if task is None else panda_circle(task)
    tight = sm.QuasiNewton(tolerance=1e-13, line_search=sm.optimise.LineSearch(sigma=0.1))
    best = _first_grid(sm.plan(problem, optimizer=tight))[-1].cost
    history = _first_grid(sm.plan(problem))
    near = next(i.evaluations for i in history if i.cost <= best * 1.01)
    converged = next(i.evaluations for i in history if i.cost <= best * (1 + 1e-6))
    assert near <= 6
    assert converged <= 15


def _first_grid(plan: sm.Plan) -> list[sm.optimise.Iteration]:
    """Return the iterations up to the second grid's start (a record without a step)."""
    history = plan.report.history
    end = next((k for k in range(1, len(history)) if history[k].step == 0.0), len(history))
    return list(history[:end])


@pytest.mark.parametrize("task", ["pose", "position", "pointing"])
def test_panda_circle_is_followed_to_a_micrometre(
    panda_circle: Callable[..., sm.Problem], task: str
) -> None:
    """On a grid of its own, with yourdfpy's kinematics instead of Pinocchio's."""
    plan = sm.plan(panda_circle(task))
    assert plan.certificate.verified
    assert plan.report.cost < plan.report.initial_cost
    assert plan.report.evaluations <= 35
    oracle = yourdfpy.URDF.load(plan.robot.urdf.source, load_meshes=False, build_scene_graph=True)
    fingers = [0.0] * (len(oracle.actuated_joint_names) - 7)
    for t in np.linspace(0, 4, 173):
        oracle.update_cfg([*plan.trajectory(t), *fingers])
        actual = oracle.get_transform(plan.robot.tool, oracle.base_link)
        pose = plan.path.pose(float(t))
        assert np.linalg.norm(actual[:3, 3] - pose.translation) < 1e-6
        if task == "pose":
            assert np.abs(actual[:3, :3] - pose.rotation).max() < 1e-6
        elif task == "pointing":
            assert np.abs(actual[:3, 2] - pose.rotation[:, 2]).max() < 1e-6


@pytest.mark.parametrize("limit", [0, -5])
def test_bad_limits_and_tolerances_are_refused(limit: int) -> None:
    with pytest.raises(sm.errors.ProblemError, match="max_evaluations"):
        sm.plan(sm.sample_problem(), max_evaluations=limit)
    with pytest.raises(sm.errors.ProblemError, match="tolerance: position"):
        sm.Tolerance(limit, 1.0)


def test_breakdown_names_the_time(planar: sm.RobotModel) -> None:
    """Nearly stretched: what is left of the path is not worth a plan."""
    start = planar.inverse_kinematics(planar.pose([0.0, 0.05, 0.05]), "planar")
    pose = planar.pose(start)
    end = pose.copy()
    end.translation = pose.translation * 1.5
    line = sm.paths.Line(pose, end, 1.0, time_law="constant")
    with pytest.raises(sm.errors.BreakdownError, match="the pose is out of reach") as caught:
        sm.plan(sm.Problem(planar, line, "planar", start))
    assert 0.0 < caught.value.time < 0.01


def test_interruption_returns_the_best_so_far() -> None:
    def interrupt(step: sm.optimise.Iteration) -> None:
        if step.evaluations >= 3:
            raise KeyboardInterrupt

    plan = sm.plan(sm.sample_problem(), callback=interrupt)
    assert plan.report.status is sm.optimise.Status.INTERRUPTED
    assert plan.report.cost < plan.report.initial_cost
    assert plan.certificate.position_error.value < 1e-6


def test_plans_repeat_bit_for_bit(sample: sm.Plan) -> None:
    again = sm.plan(sm.sample_problem())
    np.testing.assert_array_equal(again.trajectory.q, sample.trajectory.q)
    np.testing.assert_array_equal(again.coefficients, sample.coefficients)


def test_a_free_start_is_no_dearer_than_a_good_given_one() -> None:
    """The dexterous start lies on one of the self-motions that a free start looks along."""
    robot = sm.load_robot("panda")
    start = robot.dexterous_configuration()
    for task, normal in (("pose", (1.0, 0.0, 0.0)), ("position", (0.0, 0.0, 1.0))):
        path = sm.paths.Circle.around(robot.pose(start), 0.1, 4.0, normal=normal)
        given = sm.plan(sm.Problem(robot, path, task, start=start))
        free = sm.plan(sm.Problem(robot, path, task))
        assert free.certificate.verified
        # Rough optima that differ by less are not told apart.
        assert free.report.cost <= 1.01 * given.report.cost


def test_what_is_verified_is_not_said_to_contradict(
    panda_circle: Callable[[str], sm.Problem], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where nodes lead nowhere the motion at x = 0 stands, and may keep all."""
    monkeypatch.setattr(LocalSearch, "near", lambda *_: None)
    report = sm.plan(panda_circle("position")).require().report
    assert report.status is Status.PRECISION
    assert report.message == Status.PRECISION.message


@pytest.mark.parametrize("task", ["pose", "position", "pointing"])
def test_little_is_left_to_save_and_that_is_said(
    panda_circle: Callable[..., sm.Problem], task: str
) -> None:
    """Against a spline of 48 intervals by the published method, which shares no code with nodes."""
    problem = panda_circle(task, constraints=(), rest=False)
    plan = sm.plan(problem)
    spline = sm.plan(
        dataclasses.replace(problem, null_motion=sm.motion.BSplineNullMotion(48)), warm_start=plan
    )
    assert plan.report.remaining is not None
    assert plan.report.remaining <= LEFT * plan.report.cost
    saved = plan.report.cost - spline.report.cost
    assert saved <= plan.report.remaining + 1e-6 * plan.report.cost
    assert spline.report.remaining is None


def short_line(**given: Any) -> sm.Problem:
    arm, start = robot_named("planar_3r"), np.array([0.1, 0.9, 0.9])
    path = sm.paths.Line(arm.pose(start), arm.pose(start + 0.1), 1.0)
    return sm.Problem(arm, path, "planar", start, **given)


def test_an_optimiser_that_is_given_is_used_whatever_its_settings() -> None:
    """Also where these are the usual ones, or where it counts as empty."""

    class Empty(sm.QuasiNewton):
        def __len__(self) -> int:
            return 0

    for own in (sm.QuasiNewton(), Empty()):
        plan = sm.plan(short_line(), optimizer=own)
        assert isinstance(plan.report.null_motion, sm.PolynomialNullMotion)


def test_what_falls_short_is_told_with_its_unit_and_what_was_allowed() -> None:
    plan = sm.plan(short_line(constraints=[sm.constraints.JointVelocityLimits(0.01)]))
    told = r"speed of joint 'joint\d' is \S+ rad/s at t = \S+ s, limit -?0\.01 rad/s"
    assert re.search(told, plan.report.message)

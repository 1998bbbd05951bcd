"""Paths many times as long as the arm: a loop costs what it costs, however many there are."""

import dataclasses

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Counts, silent
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.planner.effort import Effort
from selfmotion.planning.planner.grids import first_nodes
from selfmotion.planning.planner.planner import Planner
from selfmotion.planning.planner.proposals import VERY_LONG_PATH, is_long
from selfmotion.planning.planner.setup import Setup
from support.arms import PANDA_HOME, robot_named

NAME = "posture of a stretch"
# What a motion beside a long wait costs more, and how fast an arm at rest accelerates [rad/s²]:
# the certificate grants a thousand times that.
STARTING, RESTS = 1.05, 1e-6
# The first and the last loop cost less than those between them; and what a given start costs more,
# from which the arm goes to the better posture.
ENDS, GIVEN = 0.02, 0.05
ELBOW = np.array([-0.8, 1.0, 1.0])
RADIUS, PERIOD, WAYPOINTS = 0.6, 4.0, 24
# So many loops are many times as long as the arm.
LOOPS = 25


def loops(planar: sm.RobotModel, count: int, start: bool = False) -> sm.Problem:
    """Return so many circles, one after the other, with limits of joint angles and speeds."""
    angle = np.linspace(0.0, 2.0 * np.pi * count, WAYPOINTS * count + 1)
    flat = np.zeros_like(angle)
    points = np.stack([2.2 + RADIUS * np.cos(angle), RADIUS * np.sin(angle), flat], axis=1)
    path = sm.paths.Waypoints(np.linspace(0.0, PERIOD * count, len(angle)), points)
    first = planar.inverse_kinematics(path.pose(0.0), "planar", seed=ELBOW) if start else None
    limits = [
        sm.constraints.JointPositionLimits(np.full(3, -2.8), np.full(3, 2.8)),
        sm.constraints.JointVelocityLimits(),
    ]
    return sm.Problem(planar, path, "planar", first, constraints=limits, rest=False)


def planner_of(problem: sm.Problem, optimizer: sm.QuasiNewton | None = None) -> Planner:
    effort = Effort(optimizer, None, None, Counts())
    setup = Setup(Formulation.of(problem), sm.Search(), sm.Tolerance(), silent)
    return Planner(setup, effort)


@pytest.fixture(scope="module")
def free() -> sm.Plan:
    """Loops from whatever start is best."""
    return sm.plan(loops(robot_named("planar_3r"), LOOPS)).require()


@pytest.mark.parametrize("count", [2, 30])
def test_the_way_is_measured_however_many_loops_there_are(
    planar: sm.RobotModel, count: int
) -> None:
    problem = loops(planar, count)
    way = 2.0 * np.pi * RADIUS * count / planar.reach
    assert Formulation.of(problem).length_in_reaches == pytest.approx(way, rel=0.03)


def test_a_loop_costs_the_same_however_many_there_are(planar: sm.RobotModel, free: sm.Plan) -> None:
    plans = {LOOPS: free, 2 * LOOPS: sm.plan(loops(planar, 2 * LOOPS)).require()}
    for plan in plans.values():
        assert Formulation.of(plan.problem).length_in_reaches > VERY_LONG_PATH
        assert plan.report.attempts[1].name == NAME
        assert plan.report.attempts[1].outcome == "all constraints are met"
    each = [plan.report.cost / count for count, plan in plans.items()]
    assert each[1] == pytest.approx(each[0], rel=ENDS)


def test_a_given_start_is_kept_and_left_for_the_better_posture(
    planar: sm.RobotModel, free: sm.Plan
) -> None:
    problem = loops(planar, LOOPS, start=True)
    plan = sm.plan(problem).require()
    assert plan.report.attempts[0].name == NAME
    np.testing.assert_allclose(plan.trajectory.q[0], problem.given_start, atol=1e-12)
    assert free.report.cost <= plan.report.cost <= free.report.cost * (1.0 + GIVEN)


def test_short_paths_and_the_published_method_go_the_usual_way(planar: sm.RobotModel) -> None:
    few, many = loops(planar, 2), loops(planar, 15)
    assert not is_long(planner_of(few))
    assert is_long(planner_of(many))
    assert not is_long(planner_of(many, sm.QuasiNewton()))


@pytest.mark.parametrize(
    ("stage", "whole"), [("optimising start", False), ("posture", False), ("refining", True)]
)
def test_an_interruption_is_obeyed_on_the_stretch_too(
    planar: sm.RobotModel, stage: str, whole: bool
) -> None:
    def progress(now: str, done: int, total: int) -> None:
        if now == stage:
            raise KeyboardInterrupt

    if not whole:
        with pytest.raises(KeyboardInterrupt):
            sm.plan(loops(planar, 25), progress=progress)
        return
    plan = sm.plan(loops(planar, 25), progress=progress)
    assert plan.report.status.value == "interrupted"
    assert plan.certificate.on_path


def test_a_callback_that_stops_ends_it(planar: sm.RobotModel) -> None:
    told: list[float] = []

    def stop(iteration: sm.optimise.Iteration) -> bool:
        told.append(iteration.cost)
        return True

    plan = sm.plan(loops(planar, 25), callback=stop)
    assert plan.report.status.value == "stopped"
    assert plan.certificate.on_path
    assert len(told) <= 4


def test_an_interruption_of_newtons_method_keeps_the_best_so_far(planar: sm.RobotModel) -> None:
    """It comes with the second iteration along the whole path."""
    whole: list[float] = []
    stages: list[str] = []

    def interrupt(iteration: sm.optimise.Iteration) -> bool:
        if stages[-1] == "posture":
            whole.append(iteration.cost)
        if len(whole) == 2:
            whole.append(np.inf)
            raise KeyboardInterrupt
        return False

    def progress(stage: str, done: int, total: int) -> None:
        stages.append(stage)

    plan = sm.plan(loops(planar, 25), callback=interrupt, progress=progress)
    assert plan.report.status.value == "interrupted"
    assert plan.certificate.verified
    assert plan.report.cost <= whole[0] * (1.0 + ENDS)


@pytest.mark.parametrize("stops", [False, True])
def test_who_wants_no_more_among_the_postures_of_a_stretch_waits_for_nothing(
    planar: sm.RobotModel, stops: bool
) -> None:
    """Also where the motion in such a posture is worse than what there is."""
    problem = loops(planar, 8, start=True)
    slow = [problem.constraints[0], sm.constraints.JointVelocityLimits(0.3)]
    problem = dataclasses.replace(problem, constraints=slow)
    stages: list[str] = []
    asked: list[str] = []

    def progress(stage: str, done: int, total: int) -> None:
        stages.append(stage)
        if stage == "optimising start" and not stops:
            raise KeyboardInterrupt

    def stop(_: sm.optimise.Iteration) -> bool:
        asked.append(stages[-1] if stages else "")
        return asked[-1] == "optimising start"

    found = sm.plan(problem, progress=progress, callback=stop)
    assert found.report.status is (
        sm.optimise.Status.STOPPED if stops else sm.optimise.Status.INTERRUPTED
    )
    assert asked.count("optimising start") == stops
    assert asked[-1] == ("optimising start" if stops else "")
    assert stages[-1] == "checking"


@pytest.mark.parametrize(
    ("seconds", "before", "after"),
    [(0.5, 0.0, 600.0), (1.0, 0.0, 1800.0), (0.5, 300.0, 300.0), (2.0, 900.0, 900.0)],
)
def test_a_short_motion_beside_a_long_wait(
    panda: sm.RobotModel, seconds: float, before: float, after: float
) -> None:
    a, b = panda.pose(PANDA_HOME), panda.pose(PANDA_HOME)
    b.translation += [0.05, 0.1, -0.05]
    line = sm.paths.Line(a, b, seconds)
    alone = sm.plan(sm.Problem(panda, line, start=PANDA_HOME))
    path = line + sm.paths.Dwell(b, after)
    if before:
        path = sm.paths.Dwell(a, before) + path
    plan = sm.plan(sm.Problem(panda, path, start=PANDA_HOME))
    assert plan.certificate.verified, plan.certificate.verdict
    # What starting and stopping a self-motion costs goes with the duration.
    assert plan.report.cost <= STARTING * alone.report.cost
    # It rests as the line alone does: with accelerations as well.
    assert plan.problem.rest_orders == alone.problem.rest_orders == (2, 2)
    assert np.abs(plan.trajectory.qdd[[0, -1]]).max() <= RESTS


def test_a_motion_beside_a_long_wait_has_as_many_nodes_as_its_way_is_long(
    planar: sm.RobotModel,
) -> None:
    """With limits of acceleration that leave room, it costs no more than what is known of it."""
    start = np.array([0.5, 0.8, 0.6])
    a, b = planar.pose(start), planar.pose(start)
    b.translation += [-0.15, 0.08, 0.0]
    line = sm.paths.Line(a, b, 0.5)
    alone = sm.plan(sm.Problem(planar, line, "planar", start, clearance=None))
    fastest = np.abs(alone.trajectory(np.linspace(0.0, 0.5, 501), 2)).max()
    limits = [
        sm.constraints.JointVelocityLimits(),
        sm.constraints.JointAccelerationLimits(2.0 * fastest),
    ]
    path = sm.paths.Dwell(a, 2500.0) + line + sm.paths.Dwell(b, 2500.0)
    problem = sm.Problem(planar, path, "planar", start, constraints=limits, clearance=None)
    times = first_nodes(Formulation.of(problem))
    assert np.sum((times >= 2500.0) & (times <= 2500.5)) > 16
    plan = sm.plan(problem)
    assert plan.certificate.verified, plan.certificate.verdict
    assert plan.report.cost < alone.report.cost
    # Where nothing waits, there are no more than there were.
    assert len(first_nodes(Formulation.of(alone.problem))) == 21

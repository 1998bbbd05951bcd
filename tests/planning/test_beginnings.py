"""Where a motion cannot be optimised from x = 0: what it is begun from instead."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Counts
from selfmotion.planning.nodes import NodeMotion, Optimum, Step, centred, minimise
from selfmotion.planning.planner import local_search
from selfmotion.planning.planner.effort import Effort
from selfmotion.planning.planner.outcomes import on_the_way
from support.arms import PANDA_HOME
from support.nodes import nodes_of, problem_of
from support.places import DATA


def test_a_ball_behind_the_elbow_is_passed_on_the_other_side(panda: sm.RobotModel) -> None:
    """From x = 0, from the free optimum and from the middle of the limits no step leads there."""
    start = np.array([-0.252, -0.844, 0.061, -2.569, -0.231, 1.467, 0.556])
    circle = sm.paths.Circle.around(panda.pose(start), 0.112, 4.0, normal=[-0.023, 0.138, -0.99])
    ball = sm.obstacles.Sphere("ball", [-0.363, 0.168, 0.281], 0.08)
    free = sm.Problem(panda, circle, start=start)
    asked = replace(free, clearance=sm.constraints.Clearance((ball,)))
    assert sm.plan(asked).certificate.verified
    # Where nothing stands there, the arm does not give way.
    assert sm.obstacles.CollisionModel(panda, (ball,)).worst(sm.plan(free).trajectory.q).value < 0.0


def test_a_motion_that_breaks_nothing_is_begun_with() -> None:
    """Where the one at x = 0 passes a limit, which costs less: all that counts keeps all limits."""
    robot = sm.load_robot("panda", tool="panda_hand")
    path = sm.paths.Waypoints.from_csv(DATA / "panda__1cube" / "path.csv")
    start = robot.inverse_kinematics(path.pose(0.0), seed=[0, -0.5, 0, -2, 0, 1.6, 0.8])
    plan = sm.plan(sm.Problem(robot, path, start=start))
    assert plan.certificate.verified
    minimum_norm = plan.initial_trajectory.q
    assert ((minimum_norm < robot.lower) | (minimum_norm > robot.upper)).any()
    first = plan.report.history[0]
    assert plan.report.initial_cost < first.cost
    # From x = 0 it takes several times as many.
    assert len(plan.report.history) <= 15


def limited_circle(panda: sm.RobotModel) -> sm.Problem:
    """Return a circle with limits of position that the cheapest motion breaks."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    case = panda, "position", np.array(PANDA_HOME), path
    q = minimise(nodes_of(problem_of(case)), lambda _: False).motion.place.q
    upper = np.where(q.max(axis=0) > PANDA_HOME + 0.1, q.max(axis=0) - 0.02, panda.upper)
    return problem_of(case, constraints=[sm.constraints.JointPositionLimits(upper=upper)])


def test_what_keeps_everything_is_not_given_up_for_what_costs_less(
    panda: sm.RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever Newton's method makes of it."""
    problem = limited_circle(panda)
    kept = minimise(nodes_of(problem), lambda _: False).motion
    assert kept.violation <= 0.0

    def astray(begin: NodeMotion, callback: Callable[[Step], bool], *_, **__) -> Optimum:
        callback(Step(begin, 1.0, 0.0))
        alone = minimise(begin.grid.without_rows().at(centred(begin)), lambda _: False)
        gone = begin.grid.at(centred(alone.motion))
        return replace(alone, motion=gone, multipliers=np.zeros(len(gone.h)))

    monkeypatch.setattr(local_search, "minimise", astray)
    effort = Effort(None, None, None, Counts())
    conditions = kept.grid.conditions
    search = local_search.LocalSearch(kept.grid.formulation, effort, conditions, free=False)
    assert astray(kept, lambda _: False).motion.violation > 0.0
    found = search.best_near(kept)
    assert found is not None
    assert found.violations == ()
    assert found.cost == kept.cost


def test_where_a_motion_breaks_most_is_told(panda: sm.RobotModel) -> None:
    problem = limited_circle(panda)
    begin = nodes_of(replace(problem, constraints=()))
    (limits,) = problem.constraints
    broken = on_the_way(nodes_of(problem).grid.at(centred(begin)))
    beyond = (begin.place.q - limits.upper).max(axis=1)
    assert beyond.max() > 0.0
    assert broken.breaks_at == begin.grid.t[np.argmax(beyond)]
    kept = on_the_way(minimise(nodes_of(problem), lambda _: False).motion)
    assert kept.breaks_at is None

"""Rough motions on nodes: the best first, about as dear as what becomes of them."""

from dataclasses import replace

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.engine import Counts
from selfmotion.optimise import QuasiNewton
from selfmotion.planning import rough as rough_motions
from selfmotion.planning.effort import Effort
from selfmotion.planning.rough import OnNodes
from selfmotion.search import start_candidates
from support.arms import robot_named
from support.paths import line_of

# On twelve intervals a cost is right to this share; and Newton's method ends within a tenth of it.
ROUGH = 2e-2
ARMS = (("xarm7", "pose"), ("xarm7", "position"), ("ur5", "pointing"))


def effort() -> Effort:
    return Effort(QuasiNewton(), None, None, Counts())


def told(stage: str, done: int, total: int) -> None:
    pass


def problem_of(arm: str, task: str) -> sm.Problem:
    robot = robot_named(arm)
    return sm.Problem(robot, line_of(robot, task), task, collision=None)


def starts_of(problem: sm.Problem, count: int = 12) -> list[Array]:
    return start_candidates(problem.follows, count, np.random.default_rng(0))


@pytest.mark.parametrize(("arm", "task"), ARMS)
def test_ranked_motions_are_on_the_path_and_about_as_dear_as_their_optima(
    arm: str, task: str
) -> None:
    problem = problem_of(arm, task)
    starts = starts_of(problem)
    ranking = OnNodes(problem, effort(), told)
    assert OnNodes.takes(problem, effort(), starts[0])
    assert ranking.ranked == []
    assert ranking.run(starts, 3)
    costs = [motion.cost for motion in ranking.ranked]
    assert 1 <= len(costs) <= 3
    best = ranking.ranked[0].trajectory
    for t, q in zip(best.t, best.q, strict=True):
        miss = problem.follows.items[0].task.miss(
            problem.path.pose(float(t)), problem.robot.pose(q)
        )
        assert max(miss) < 1e-9
    optimum = sm.plan(replace(problem, start=best.q[0], rest=problem.rest))
    assert optimum.report.cost <= costs[0] * (1.0 + ROUGH)
    free = sm.plan(problem, search=sm.Search(starts=12))
    assert free.report.cost == pytest.approx(costs[0], rel=ROUGH)


def test_what_nodes_do_not_take_is_ranked_by_heats() -> None:
    problem = problem_of("panda", "pose")
    start = starts_of(problem)[0]
    circle = sm.Circle.around(problem.path.pose(0.0), 0.05, 2.0)
    for other in (
        replace(problem, null_motion=sm.PolynomialNullMotion()),
        replace(problem, path=circle, constraints=[sm.ClosedPath()]),
    ):
        assert not OnNodes.takes(other, effort(), start)


def test_where_the_cheapest_break_conditions_nothing_is_ranked() -> None:
    """They may become better or worse than what keeps them: heats see to conditions."""
    problem = problem_of("xarm7", "pose")
    starts = starts_of(problem)
    ranking = OnNodes(problem, effort(), told)
    ranking.run(starts, 3)
    speeds = np.abs(ranking.ranked[0].trajectory.qd).max(axis=0)
    slow = replace(
        problem, constraints=[sm.JointPositionLimits(), sm.JointVelocityLimits(0.7 * speeds)]
    )
    other = OnNodes(slow, effort(), told)
    assert not other.run(starts, 3)
    # Whoever interrupts gets the cheapest all the same.
    assert len(other.ranked) == 1
    # Also bodies that constraints name: where the cheapest motion goes, and far from there.
    middle = ranking.ranked[0].trajectory
    place = tuple(problem.robot.pose(middle.q[len(middle.q) // 2]).translation)
    for center, is_ranked in ((place, False), ((2.0, 2.0, 2.0), True)):
        ball = sm.Clearance([sm.Sphere("ball", center, 0.1)])
        among = OnNodes(replace(problem, constraints=[ball]), effort(), told)
        assert among.run(starts, 3) is is_ranked


def test_starts_of_which_none_follows_the_path_at_x_0_are_left_to_heats(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem = problem_of("panda", "pose")

    def nowhere(follows, starts: Array, t: Array):
        return np.tile(starts[:, None], (1, len(t), 1)), np.zeros(len(starts), dtype=bool)

    monkeypatch.setattr(rough_motions, "carried", nowhere)
    ranking = OnNodes(problem, effort(), told)
    assert not ranking.run(starts_of(problem), 3)
    assert ranking.ranked == []
    found = sm.plan(problem, search=sm.Search(starts=12))
    assert found.certificate.verified

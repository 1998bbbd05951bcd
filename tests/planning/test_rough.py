"""Rough motions on nodes: the best first, about as dear as what becomes of them."""

from dataclasses import replace

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array, Counts
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.planner import screening as rough_motions
from selfmotion.planning.planner.effort import Effort
from selfmotion.planning.planner.screening import Ranking
from selfmotion.planning.search import start_candidates
from support.arms import robot_named
from support.paths import line_of

# On twelve intervals a cost is right to this share; and Newton's method ends within a tenth of it.
ROUGH = 2e-2
ARMS = (("xarm7", "pose"), ("xarm7", "position"), ("ur5", "pointing"))


def effort() -> Effort:
    return Effort(None, None, None, Counts())


def told(stage: str, done: int, total: int) -> None:
    pass


def problem_of(arm: str, task: str) -> sm.Problem:
    robot = robot_named(arm)
    return sm.Problem(robot, line_of(robot, task), task, clearance=None)


def starts_of(problem: sm.Problem, count: int = 12) -> list[Array]:
    return start_candidates(problem.follows, count, np.random.default_rng(0))


@pytest.mark.parametrize(("arm", "task"), ARMS)
def test_ranked_motions_are_on_the_path_and_about_as_dear_as_their_optima(
    arm: str, task: str
) -> None:
    problem = problem_of(arm, task)
    starts = starts_of(problem)
    ranking = Ranking(Formulation.of(problem), effort(), told)
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


def test_costs_of_accelerations_and_conditions_on_ends_are_ranked_one_by_one() -> None:
    """Few nodes say little of the first, and motions side by side nothing of the second."""
    problem = problem_of("panda", "pose")
    circle = sm.paths.Circle.around(problem.path.pose(0.0), 0.05, 2.0)
    for other in (
        replace(problem, costs=[sm.costs.JointAcceleration()]),
        replace(problem, path=circle, constraints=[sm.constraints.ClosedPath()]),
    ):
        told_of: list[str] = []
        ranking = Ranking(
            Formulation.of(other), effort(), lambda stage, done, total, to=told_of: to.append(stage)
        )
        assert ranking.run(starts_of(other), 3)
        assert set(told_of) == {"start"}
        assert 1 <= len(ranking.ranked) <= 3


def test_where_the_cheapest_break_conditions_those_come_first_that_keep_them() -> None:
    """They may become better or worse than what keeps them: a few steps with conditions tell."""
    problem = problem_of("xarm7", "pose")
    starts = starts_of(problem)
    free = Ranking(Formulation.of(problem), effort(), told)
    free.run(starts, 3)
    speeds = np.abs(free.ranked[0].trajectory.qd).max(axis=0)
    limits = np.where(np.arange(7) == 3, 0.9 * speeds, np.inf)
    slow = replace(
        problem,
        constraints=[
            sm.constraints.JointPositionLimits(),
            sm.constraints.JointVelocityLimits(limits),
        ],
    )
    other = Ranking(Formulation.of(slow), effort(), told)
    assert other.run(starts, 3)
    kept = [motion.violation <= 0.0 for motion in other.ranked]
    assert kept == sorted(kept, reverse=True)
    assert kept[0]
    assert other.ranked[0].cost > free.ranked[0].cost
    # Also bodies that constraints name: where the cheapest motion goes, and far from there.
    middle = free.ranked[0].trajectory
    place = tuple(problem.robot.pose(middle.q[len(middle.q) // 2]).translation)
    for center, is_best in ((place, False), ((2.0, 2.0, 2.0), True)):
        ball = sm.constraints.Clearance([sm.obstacles.Sphere("ball", center, 0.1)])
        among = Ranking(
            Formulation.of(replace(problem, constraints=[], clearance=ball)), effort(), told
        )
        assert among.run(starts, 3)
        same = among.ranked[0].cost == pytest.approx(free.ranked[0].cost, rel=1e-6)
        assert same is is_best


def test_whoever_interrupts_gets_the_cheapest() -> None:
    problem = problem_of("xarm7", "pose")
    speeds = [sm.constraints.JointVelocityLimits(0.05)]

    def interrupt(stage: str, done: int, total: int) -> None:
        if stage == "start":
            raise KeyboardInterrupt

    ranking = Ranking(Formulation.of(replace(problem, constraints=speeds)), effort(), interrupt)
    with pytest.raises(KeyboardInterrupt):
        ranking.run(starts_of(problem), 3)
    assert len(ranking.ranked) == 1


def test_starts_of_which_none_follows_the_path_at_x_0_are_all_optimised(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem = problem_of("panda", "pose")

    def nowhere(follows, starts: Array, t: Array, at: int):
        return np.tile(starts[:, None], (1, len(t), 1)), np.zeros(len(starts), dtype=bool)

    monkeypatch.setattr(rough_motions, "carried", nowhere)
    ranking = Ranking(Formulation.of(problem), effort(), told)
    assert not ranking.run(starts_of(problem), 3)
    assert ranking.ranked == []
    found = sm.plan(problem, search=sm.Search(starts=12))
    assert found.certificate.verified


def test_costs_of_accelerations_are_ranked_by_what_becomes_of_them() -> None:
    """A few steps from where there is no self-motion tell nothing: they took a start at 7."""
    arm = sm.load_robot("ur5")
    place = np.array([0.844, -0.204, -0.206])
    way = np.array(
        [
            [0.0, 0.0, 0.0],
            [-0.005, -0.006, 0.018],
            [-0.076, 0.01, -0.02],
            [-0.054, 0.052, -0.053],
            [-0.09, 0.047, -0.076],
            [-0.144, 0.036, -0.026],
        ]
    )
    path = sm.paths.Waypoints(np.linspace(0.0, 2.0, len(way)), place + way)
    limits = [sm.constraints.JointVelocityLimits(), sm.constraints.JointAccelerationLimits(3.78)]
    costs = [sm.costs.JointAcceleration()]
    plan = sm.plan(sm.Problem(arm, path, "position", costs=costs, constraints=limits)).require()
    assert plan.report.cost < 2.0

"""A plan by a deadline: the best so far, judged, and never worse than what it began with."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.planning.planner import effort as module


class Clock:
    """A second passes whenever one looks."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def __call__(self) -> float:
        self.seconds += 1.0
        return self.seconds


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    ticking = Clock()
    monkeypatch.setattr(module.time, "perf_counter", ticking)
    return ticking


@pytest.fixture
def problem(panda: sm.RobotModel) -> sm.Problem:
    start = np.array(sm.NAMED_ARMS["panda"].home)
    path = sm.paths.Circle.around(panda.pose(start), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    return sm.Problem(panda, path, "position", start, clearance=None)


@pytest.mark.parametrize("seconds", [1.0, 3.0, 5.0, 7.0])
def test_the_best_so_far_is_returned_and_judged(
    problem: sm.Problem, clock: Clock, seconds: float
) -> None:
    found = sm.plan(problem, deadline=seconds)
    assert found.report.status is sm.optimise.Status.DEADLINE
    assert "deadline" in found.report.message
    assert found.report.cost <= found.report.initial_cost
    assert found.certificate.on_path


def test_more_time_is_no_worse(problem: sm.Problem, clock: Clock) -> None:
    costs = [sm.plan(problem, deadline=seconds).report.cost for seconds in (2.0, 8.0, 20.0)]
    # On different grids the same motion costs the same to the agreement that plans ask of grids.
    assert costs[1] <= costs[0] * (1.0 + 1e-4)
    assert costs[2] <= costs[1] * (1.0 + 1e-4)


def test_time_enough_changes_nothing(problem: sm.Problem) -> None:
    with_one, without = sm.plan(problem, deadline=1e6), sm.plan(problem)
    assert with_one.report.status is without.report.status
    assert np.array_equal(with_one.coefficients, without.coefficients)


def test_too_early_for_any_motion_is_said(panda: sm.RobotModel, clock: Clock) -> None:
    pose = panda.pose(np.array(sm.NAMED_ARMS["panda"].home))
    path = sm.paths.Circle.around(pose, 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    with pytest.raises(sm.errors.PlanError, match="deadline of 1"):
        sm.plan(sm.Problem(panda, path, "position"), deadline=1.0)


def test_a_deadline_is_a_positive_time(problem: sm.Problem) -> None:
    with pytest.raises(sm.errors.ProblemError, match="deadline"):
        sm.plan(problem, deadline=0.0)

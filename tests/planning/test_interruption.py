"""Ctrl-C, a callback that stops, and what is told on the way."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.planning.rollout import Rollout
from support.arms import PANDA_HOME

# All stages of a plan from a free start, compared with the global search.
STAGES = (
    "screening start",
    "optimising start",
    "search: self-motions at waypoint",
    "search: sampling waypoint",
    "search: optimising sequence",
    "search: optimising finalist",
    "refining sequence",
    "refining",
    "checking",
)


def level(x: float, y: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([x, y, 0.0]))


@pytest.fixture
def problem(planar: sm.RobotModel) -> sm.Problem:
    times = np.linspace(0.0, 1.0, 6)
    line = sm.paths.Line(level(1.0, 0.5), level(1.3, 0.3), 1.0)
    path = sm.paths.Waypoints.from_poses(times, [line.pose(float(t)) for t in times])
    # Of path length there is more than one good sequence here.
    return sm.Problem(planar, path, "planar", costs=[sm.costs.PathLength()])


SEARCH = sm.Search(starts=6, finalists=3, compare=True)


GLOBAL = dataclasses.replace(SEARCH, mode="global")


def plan(problem: sm.Problem, **options: object) -> sm.Plan:
    options.setdefault("search", SEARCH)
    return sm.plan(problem, **options)


def interrupt_at(stage: str, number: int) -> Callable[[str, int, int], None]:
    def progress(now: str, done: int, total: int) -> None:
        if (now, done) == (stage, number):
            raise KeyboardInterrupt

    return progress


def test_each_stage_is_told_in_order(problem: sm.Problem) -> None:
    told: list[tuple[str, int, int]] = []
    plan(problem, progress=lambda *now: told.append(now))
    assert tuple(dict.fromkeys(stage for stage, _, _ in told)) == STAGES
    for stage in STAGES[2:-2]:
        numbers = [(done, total) for name, done, total in told if name == stage]
        total = numbers[0][1]
        assert numbers == [(k, total) for k in range(1, total + 1)]


def published(problem: sm.Problem) -> sm.Problem:
    return dataclasses.replace(problem, null_motion=sm.PolynomialNullMotion())


def test_an_interruption_of_the_published_method_yields_the_best_so_far(
    problem: sm.Problem,
) -> None:
    for stage in ("optimising start", "refining", "checking"):
        found = plan(published(problem), progress=interrupt_at(stage, 1))
        assert found.report.status is sm.optimise.Status.INTERRUPTED
        assert found.certificate.position_error.value < 1e-3


@pytest.mark.parametrize("stage", STAGES)
def test_an_interruption_at_any_stage_yields_the_best_so_far(
    problem: sm.Problem, stage: str
) -> None:
    # The first start may be the only one that is worth optimising.
    alone = ("optimising start", "refining", "checking")
    number = 1 if stage in alone else 2
    found = plan(problem, progress=interrupt_at(stage, number))
    assert found.report.status is sm.optimise.Status.INTERRUPTED
    assert "interrupted" in found.report.message
    assert found.certificate.position_error.value < 1e-3


def test_without_a_motion_an_interruption_is_one(problem: sm.Problem) -> None:
    with pytest.raises(KeyboardInterrupt):
        plan(problem, progress=interrupt_at("screening start", 1))
    for stage in STAGES[2:6]:
        with pytest.raises(KeyboardInterrupt):
            plan(problem, search=GLOBAL, progress=interrupt_at(stage, 1))


def test_an_interruption_among_guides_keeps_the_first_one(problem: sm.Problem) -> None:
    whole = plan(problem, search=GLOBAL)
    assert whole.report.gap is not None
    assert whole.report.gap.sequences > 1
    found = plan(problem, search=GLOBAL, progress=interrupt_at("refining sequence", 2))
    assert found.report.status is sm.optimise.Status.INTERRUPTED
    assert found.certificate.verified


def test_an_interruption_within_any_rollout(
    problem: sm.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls, at = [0], [0]
    run = Rollout.run

    def counted(self: Rollout, *arguments: Array) -> float | None:
        calls[0] += 1
        broken = run(self, *arguments)
        if calls[0] == at[0]:
            # As from the keyboard: after the work, before its outcome is noted.
            raise KeyboardInterrupt
        return broken

    monkeypatch.setattr(Rollout, "run", counted)
    plan(problem)
    total = calls[0]
    for at[0] in np.unique(np.linspace(1, total, 25).astype(int)):
        calls[0] = 0
        found = plan(problem)
        assert found.report.status is sm.optimise.Status.INTERRUPTED
        assert np.isfinite(found.report.cost)
        assert found.certificate.position_error.value < 1e-3


def test_a_callback_stops_all_starts(problem: sm.Problem) -> None:
    costs: list[float] = []

    def stop(iteration: sm.optimise.Iteration) -> bool:
        costs.append(iteration.cost)
        return len(costs) == 2

    found = plan(problem, callback=stop)
    assert found.report.status is sm.optimise.Status.STOPPED
    assert len(costs) == 2
    # On few nodes the cost is a little less than that of the arm's own motion through these.
    assert found.report.cost < costs[0]


@pytest.mark.parametrize("asked", ["length", "acceleration", "too slow"])
def test_a_callback_that_stops_is_asked_no_more_and_is_told_of(
    problem: sm.Problem, asked: str
) -> None:
    """Wherever it stops: also where what is found then is worse than what there was."""
    if asked == "acceleration":
        problem = dataclasses.replace(problem, costs=[sm.costs.JointAcceleration()])
    elif asked == "too slow":
        start = problem.robot.inverse_kinematics(problem.path.pose(0.0), "planar", rng=0)
        limits = [sm.constraints.JointVelocityLimits(0.2)]
        problem = dataclasses.replace(problem, start=start, constraints=limits)
    search = None if problem.given_start is not None else sm.Search(starts=6, finalists=3)

    def stopped_at(most: float) -> tuple[sm.Plan, int]:
        calls = 0

        def stop(_: sm.optimise.Iteration) -> bool:
            nonlocal calls
            calls += 1
            return calls >= most

        return sm.plan(problem, search=search, callback=stop), calls

    _, total = stopped_at(np.inf)
    for most in np.unique(np.linspace(1, total, 20).astype(int)):
        found, calls = stopped_at(most)
        assert calls == most
        assert found.report.status is sm.optimise.Status.STOPPED
        assert found.certificate.position_error.value < 1e-3


@pytest.mark.parametrize("most", [3, 5, 10])
def test_a_stop_leaves_a_verified_motion_where_there_was_one(
    panda: sm.RobotModel, most: int
) -> None:
    """On the way to an optimum tolerances may be broken between nodes, or at them."""
    circle = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.12, 4.0, normal=(1.0, 0.0, 0.0))
    tolerances = [
        sm.Relaxation(("rx", "ry"), 0.17),
        sm.Relaxation("z", 2e-3, axes="tool"),
        sm.Relaxation("rz", during=(1.0, 2.5)),
    ]
    calls = 0

    def stop(_: sm.optimise.Iteration) -> bool:
        nonlocal calls
        calls += 1
        return calls >= most

    found = sm.plan(sm.Problem(panda, circle, relaxations=tolerances), callback=stop)
    assert found.report.status is sm.optimise.Status.STOPPED
    assert found.certificate.verified, found.certificate.verdict


def test_an_interruption_of_a_given_start(problem: sm.Problem) -> None:
    start = problem.robot.inverse_kinematics(problem.path.pose(0.0), "planar", rng=0)
    given = dataclasses.replace(problem, start=start)
    for stage in STAGES[2:]:
        found = plan(given, progress=interrupt_at(stage, 1))
        assert found.report.status is sm.optimise.Status.INTERRUPTED
        np.testing.assert_allclose(found.trajectory.q[0], start, atol=1e-9)

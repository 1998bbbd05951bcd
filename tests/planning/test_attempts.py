"""What was tried is reported, in the order of one list that the documentation shows."""

import dataclasses
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import BreakdownError, Counts
from selfmotion.planning.formulation import Formulation, keeps_off_itself
from selfmotion.planning.planner import planner, verdicts
from selfmotion.planning.planner.effort import Effort
from selfmotion.planning.planner.grids import first_nodes
from selfmotion.planning.planner.guess import Guess
from selfmotion.planning.planner.judging import Judged
from selfmotion.planning.planner.local_search import LocalSearch
from selfmotion.planning.planner.solve import solve
from selfmotion.planning.planner.steps import STEPS

Circle = Callable[..., sm.Problem]
NAMES = [name for name, _ in STEPS]
PAGE = Path(__file__).parents[2] / "docs" / "pages" / "tried.md"


def names_of(plan: sm.Plan) -> list[str]:
    return [item.name for item in plan.report.attempts]


def test_the_page_shows_the_list() -> None:
    shown = re.findall(r"^\| `([^`]+)` \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert shown[1:] == NAMES
    assert shown[0] == "name"


def test_a_given_start_is_the_only_one_tried(panda_circle: Circle) -> None:
    plan = sm.plan(panda_circle())
    assert names_of(plan) == ["given start", "finer grids and proof"]
    first, last = plan.report.attempts
    assert first.outcome == "all constraints are met"
    assert first.cost == pytest.approx(plan.report.cost, rel=1e-2)
    assert last.outcome == plan.certificate.verdict
    assert last.cost == plan.report.cost
    assert first.seconds + last.seconds <= plan.report.seconds


@pytest.mark.parametrize("mode", ["auto", "local", "global"])
def test_attempts_come_in_order(planar: sm.RobotModel, mode: str) -> None:
    start = planar.inverse_kinematics(pin.SE3(np.eye(3), np.array([2.0, 1.0, 0.0])), "planar")
    line = sm.paths.Line(planar.pose(start), pin.SE3(np.eye(3), np.array([2.2, 0.7, 0.0])), 1.0)
    plan = sm.plan(sm.Problem(planar, line, "planar"), search=sm.Search(mode=mode, starts=6))
    tried = names_of(plan)
    assert tried == sorted(tried, key=NAMES.index)
    assert ("starts" in tried) == (mode != "global")
    assert ("global search" in tried) == (mode == "global")


def test_a_part_is_an_attempt_with_a_reason(planar: sm.RobotModel) -> None:
    start = planar.inverse_kinematics(pin.SE3(np.eye(3), np.array([2.0, 1.0, 0.0])), "planar")
    line = sm.paths.Line(planar.pose(start), pin.SE3(np.eye(3), np.array([9.0, 1.0, 0.0])), 2.0)
    plan = sm.plan(sm.Problem(planar, line, "planar", start))
    assert plan.report.ending
    last = plan.report.attempts[-1]
    assert last.name.startswith("largest part")
    assert last.outcome.startswith(plan.report.ending)


def test_what_is_interrupted_is_an_attempt(panda_circle: Circle) -> None:
    def progress(stage: str, done: int, total: int) -> None:
        if stage == "refining":
            raise KeyboardInterrupt

    plan = sm.plan(panda_circle(), progress=progress)
    assert plan.report.status is sm.optimise.Status.INTERRUPTED
    assert names_of(plan) == ["given start", "finer grids and proof"]


def test_attempts_are_saved(panda_circle: Circle, tmp_path: Path) -> None:
    plan = sm.plan(panda_circle())
    plan.save(tmp_path / "plan.npz")
    assert sm.load_plan(tmp_path / "plan.npz").report.attempts == plan.report.attempts
    none = dataclasses.replace(plan.report, attempts=())
    dataclasses.replace(plan, report=none).save(tmp_path / "none.npz")
    assert sm.load_plan(tmp_path / "none.npz").report.attempts == ()


@pytest.mark.parametrize("dearer", [True, False])
def test_what_costs_more_freely_is_not_optimised_with_limits(
    panda_circle: Circle, dearer: bool
) -> None:
    free = sm.plan(panda_circle("position"))
    fastest = np.abs(free.trajectory.qd).max()
    limits = [sm.constraints.JointVelocityLimits(0.9 * fastest)]
    problem = dataclasses.replace(panda_circle("position"), constraints=limits)
    effort = Effort(None, None, None, Counts())
    assert problem.given_start is not None
    guess = Guess.of(Formulation.of(problem), effort, problem.given_start, free=False)
    solution = solve(guess, cost_to_beat=free.report.cost * (0.5 if dearer else 2.0))
    assert solution.is_hopeless == dearer
    assert dearer or not solution.violations


def test_what_conditions_did_not_count_for_is_none_that_keeps_them(panda_circle: Circle) -> None:
    """Who stops on the way to the free optimum is left no motion: it may break limits."""
    free = sm.plan(panda_circle("position"))
    fastest = np.abs(free.trajectory.qd).max()
    limits = [sm.constraints.JointVelocityLimits(0.9 * fastest)]
    problem = dataclasses.replace(panda_circle("position"), constraints=limits)
    start = np.array(problem.given_start)
    formulation = Formulation.of(problem)
    bound = formulation.conditions(start, start)
    effort = Effort(None, lambda iteration: True, None, Counts())
    search = LocalSearch(formulation, effort, bound, free=False)
    found = search.near(
        [free.trajectory], first_nodes(formulation), cost_to_beat=10.0 * free.report.cost
    )
    assert search.recorder.history
    assert found is not None
    assert found.violations
    assert search.recorder.latest is None
    # One that does is kept.
    easy = dataclasses.replace(
        problem, constraints=[sm.constraints.JointVelocityLimits(2.0 * fastest)]
    )
    formulation = Formulation.of(easy)
    bound = formulation.conditions(start, start)
    search = LocalSearch(formulation, effort, bound, free=False)
    search.near([free.trajectory], first_nodes(formulation))
    assert search.recorder.latest is not None


def test_an_optimum_that_takes_the_arm_into_itself_goes_on_at_once(panda: sm.RobotModel) -> None:
    """With its bodies kept apart, and nothing is tried again."""
    rng = np.random.default_rng(1000)
    lower, upper = panda.finite_limits()
    start = lower + (upper - lower) * rng.uniform(0.1, 0.9, panda.dof)
    moves = np.cumsum(rng.uniform(-0.5, 0.5, (3, panda.dof)), axis=0)
    poses = [panda.pose(q) for q in (start, *np.clip(start + moves, lower, upper))]
    problem = sm.Problem(
        panda, sm.paths.Waypoints.from_poses(np.linspace(0, 4, 4), poses), start=start
    )
    careless = sm.plan(dataclasses.replace(problem, clearance=None))
    assert not keeps_off_itself(Formulation.of(problem), careless.trajectory.q)
    plan = sm.plan(problem)
    assert plan.certificate.verified, plan.certificate.verdict
    assert names_of(plan) == ["given start", "finer grids and proof"]
    assert plan.report.cost > careless.report.cost


@pytest.mark.parametrize("again", [False, True])
def test_where_a_proof_fails_starts_are_drawn(
    again: bool, panda_circle: Circle, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is verified then is the plan; where nothing is, the first motion stays."""
    problem = dataclasses.replace(panda_circle(), start=None)
    judged = verdicts.judge
    costs: list[float] = []

    def failing(*given) -> Judged:
        found = judged(*given)
        costs.append(found.motion.cost)
        if len(costs) > 1 and not again:
            return found
        first, *others = found.certificate.findings
        wrong = dataclasses.replace(first, satisfied=False, time=2.0, text="by order")
        refused = dataclasses.replace(
            found.certificate, findings=(wrong, *others), failures=("by order",)
        )
        return dataclasses.replace(found, certificate=refused)

    monkeypatch.setattr(verdicts, "judge", failing)
    plan = sm.plan(problem, search=sm.Search(mode="local", starts=6, finalists=2))
    # A motion that is not verified is looked at once more.
    expected = ["starts where the proof fails", *(["what stops it"] if again else [])]
    assert names_of(plan)[-len(expected) :] == expected
    assert len(costs) > 1
    assert plan.certificate.verified != again
    assert plan.report.cost == (costs[0] if again else costs[-1])


def test_where_no_motion_goes_on_others_begin(
    panda_circle: Circle, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All that begin at the start of the path break down on the way."""
    begin = planner.Planner.guess

    def failing(self: planner.Planner, start, **given):
        if any(item.name == "starts" for item in self.attempts):
            return begin(self, start, **given)
        self.failure = BreakdownError("by order", time=2.0)
        return None

    monkeypatch.setattr(planner.Planner, "guess", failing)
    problem = dataclasses.replace(panda_circle(), start=None)
    plan = sm.plan(problem, search=sm.Search(mode="local", starts=6, finalists=2))
    assert "starts where it breaks" in names_of(plan)
    assert plan.certificate.verified

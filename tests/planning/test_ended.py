"""What ended a plan is told, wherever it ended and whichever motion is taken."""

import dataclasses
from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.certificate import Tolerance
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.nodes import NodeMotion
from selfmotion.planning.optimise import Status
from selfmotion.planning.planner import Deadline, Search, judging, outcomes, steps, verdicts
from selfmotion.planning.planner.effort import Effort
from selfmotion.planning.planner.guess import Guess, on_start
from selfmotion.planning.planner.judging import Judged
from selfmotion.planning.planner.largest_part import Part
from selfmotion.planning.planner.local_search import LocalSearch
from selfmotion.planning.planner.outcomes import NodeOutcome
from selfmotion.planning.planner.planner import Planner
from selfmotion.planning.planner.setup import Setup
from selfmotion.planning.planner.solution import Solution
from selfmotion.planning.planner.solve import solve
from support.arms import PANDA_HOME


@pytest.fixture
def problem(panda: sm.RobotModel) -> sm.Problem:
    circle = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    return sm.Problem(panda, circle, "position", PANDA_HOME)


def effort() -> Effort:
    return Effort(None, None, None, Deadline())


class Once:
    """Raises an interruption when it is called first."""

    def __init__(self) -> None:
        self.raised = False

    def __call__(self) -> None:
        if not self.raised:
            self.raised = True
            raise KeyboardInterrupt


def test_an_interruption_in_a_proof_that_fails_ends_the_plan(
    problem: sm.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    band = sm.constraints.Band(sm.robot.JointCoordinate("panda_joint1"), -2.0, 0.3)
    formulation = Formulation.of(dataclasses.replace(problem, constraints=[band]))
    once = Once()

    def progress(stage: str, done: int, total: int) -> None:
        if stage == "checking":
            once()

    planner = Planner(Setup(formulation, Search(), Tolerance(), progress), effort())
    guess = planner.guess(on_start(formulation, PANDA_HOME), free=True)
    assert guess is not None
    planner.consider(Solution.of(guess))

    def by_meshes(of: Planner) -> Iterator[Solution]:
        assert of.incumbent is not None
        yield of.incumbent

    monkeypatch.setattr(steps, "free_by_meshes", by_meshes)
    assert steps._judge_on_meshes(planner)
    assert once.raised
    assert planner.is_over
    assert not planner.is_sought


def test_an_interruption_while_the_arm_is_kept_off_itself_is_told(
    problem: sm.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[bool] = []

    def interrupted(self: LocalSearch, known: NodeOutcome) -> None:
        tried.append(True)
        raise KeyboardInterrupt

    monkeypatch.setattr(judging, "_meets_itself", lambda *_: len(tried) < 3)
    monkeypatch.setattr(LocalSearch, "with_more", interrupted)
    plan = sm.plan(problem)
    assert tried == [True]
    assert plan.report.status is Status.INTERRUPTED


def test_an_interruption_after_an_optimum_keeps_it(
    problem: sm.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, once = sm.plan(problem), Once()
    real = outcomes.NodeOutcome.keeps_off_itself.func

    def keeps_off_itself(self: NodeOutcome) -> bool:
        once()
        return bool(real(self))

    monkeypatch.setattr(outcomes.NodeOutcome, "keeps_off_itself", property(keeps_off_itself))
    plan = sm.plan(problem)
    assert once.raised
    assert plan.report.status is Status.INTERRUPTED
    assert plan.report.iterations > 0
    # It is the optimum on the first nodes: more of them change some millionths.
    assert plan.report.cost == pytest.approx(whole.report.cost, rel=1e-3)
    assert plan.report.cost < 0.99 * plan.report.initial_cost


def test_a_motion_that_is_judged_is_kept_until_its_part_is(
    problem: sm.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Poses are said to be out of reach, and the part's proof is interrupted, again and again."""
    check, parts = judging._check, list[int]()

    def checked(formulation: Formulation, part: Part, tolerance: Tolerance) -> Judged:
        if parts:
            raise KeyboardInterrupt
        found = check(formulation, part, tolerance)
        error = dataclasses.replace(found.certificate.position_error, value=1.0)
        wrong = dataclasses.replace(found.certificate, position_error=error)
        return dataclasses.replace(found, certificate=wrong)

    judge_part = verdicts.judge_part

    def counted(planner: Planner, suspect: float = 0.0) -> bool:
        parts.append(1)
        return judge_part(planner, suspect)

    def reach(self: Planner, suspect: float = 0.0) -> SimpleNamespace:
        starts = [self.formulation.given_start]
        return SimpleNamespace(reason="said to be out of reach", time=2.0, starts=starts)

    monkeypatch.setattr(judging, "_check", checked)
    monkeypatch.setattr(Planner, "reach", reach)
    monkeypatch.setattr(steps, "judge_part", counted)
    plan = sm.plan(problem)
    assert parts == [1]
    assert plan.report.status is Status.INTERRUPTED
    assert plan.trajectory.duration == problem.path.duration


def test_a_part_that_was_cut_short_is_the_last_one(monkeypatch: pytest.MonkeyPatch) -> None:
    @dataclasses.dataclass(frozen=True)
    class Short:
        number: int
        status: Status = Status.CONVERGED

        @property
        def cut_short(self) -> bool:
            return self.status.is_cut_short

        def ended_by(self, status: Status) -> "Short":
            return dataclasses.replace(self, status=status)

    @dataclasses.dataclass(frozen=True)
    class OfPart:
        solution: Short

    @dataclasses.dataclass(frozen=True)
    class Refused:
        part: OfPart
        certificate: SimpleNamespace

    def settle(solution: Short) -> Short:
        if solution.number == 1:
            raise KeyboardInterrupt
        return solution

    sought: list[int] = []

    def shorter(formulation: object, part: OfPart, effort: object) -> OfPart:
        sought.append(part.solution.number)
        return OfPart(Short(part.solution.number + 1))

    faults = SimpleNamespace(failures=("one", "two"), verified=False)
    monkeypatch.setattr(judging, "settle", settle)
    monkeypatch.setattr(verdicts, "largest_part", lambda *_: OfPart(Short(0)))
    monkeypatch.setattr(verdicts, "shorter_part", shorter)
    monkeypatch.setattr(verdicts, "judge", lambda _, part, *rest: Refused(part, faults))
    setup = SimpleNamespace(
        formulation=None, progress=lambda *_: None, tolerance=None, is_free=False
    )
    planner = SimpleNamespace(
        setup=setup,
        effort=SimpleNamespace(max_evaluations=1),
        reach=lambda _: None,
        judged=None,
    )
    verdicts.judge_part(planner)  # type: ignore[arg-type]
    assert sought == [0]
    assert planner.judged.part.solution.number == 0
    assert planner.judged.part.solution.status is Status.INTERRUPTED


def test_the_history_is_told_of_a_plan_that_goes_back_to_its_beginning(
    problem: sm.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    judge, refused = verdicts.judge, list[int]()

    def judged(*arguments: object) -> Judged:
        found = judge(*arguments)  # type: ignore[arg-type]
        if not refused:
            refused.append(1)
            error = dataclasses.replace(found.certificate.position_error, value=1.0)
            wrong = dataclasses.replace(found.certificate, position_error=error)
            return dataclasses.replace(found, certificate=wrong)
        return found

    monkeypatch.setattr(verdicts, "judge", judged)
    plan = sm.plan(problem, callback=lambda iteration: iteration.step > 0)
    assert refused == [1]
    assert plan.report.status is Status.STOPPED
    assert plan.report.iterations == 1


def test_multipliers_stay_with_their_conditions_where_one_is_added(
    panda: sm.RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    start = panda.dexterous_configuration()
    circle = sm.paths.Circle.around(panda.pose(start), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    cone = sm.Relaxation(("rx", "ry"), 0.02)
    formulation = Formulation.of(sm.Problem(panda, circle, start=start, relaxations=[cone]))
    assert formulation.given_start is not None
    guess = Guess.of(formulation, effort(), formulation.given_start, free=False)
    found = solve(guess).outcome
    assert isinstance(found, NodeOutcome)

    def by_name(motion: NodeMotion, multipliers: Array) -> dict[str, float]:
        rows = motion.grid.rows
        pairs = zip(rows.families, rows.split(multipliers), strict=True)
        return {item.item.name: float(np.abs(own).sum()) for item, own in pairs}

    begun: dict[str, float] = {}

    def best_near(
        self: LocalSearch, motion: NodeMotion, *, multipliers: Array, **_: object
    ) -> None:
        begun.update(by_name(motion, multipliers))

    monkeypatch.setattr(LocalSearch, "best_near", best_near)
    LocalSearch.of(guess.kept_apart()).with_more(found)
    before = by_name(found.motion, found.multipliers)
    assert max(before.values()) > 0.0
    assert begun == {**before, "clearance": 0.0}

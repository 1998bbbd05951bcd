"""Bought margins: they are there, by a judge of their own, and they have a price."""

import dataclasses

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.work.margins import Shortfall, Shortfalls
from selfmotion.work.placement import with_margin
from support.arms import robot_named
from support.displaced import MISSED, Judge, random_displacement
from support.shell import invoke

LIMITS = [sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()]
WANTED = sm.Margin(0.03, 0.02)


def beside_the_elbow() -> sm.Problem:
    """A seam, and a ball that the elbow of the motion that is best without it comes near to."""
    robot = robot_named("panda")
    pose = robot.pose(sm.NAMED_ARMS["panda"].home)
    end = pose.copy()
    end.translation = pose.translation + np.array([0.0, 0.2, 0.0])
    problem = sm.Problem(robot, sm.paths.Line(pose, end, 3.0), constraints=LIMITS)
    motion = sm.plan(problem).trajectory
    first, last = robot.joint_poses(motion(np.array([0.0, 3.0])))[:, 3, :3]
    ahead = (last - first) / np.linalg.norm(last - first)
    ball = sm.obstacles.Sphere("ball", last + 0.16 * ahead, 0.05)
    clear = sm.constraints.Clearance([ball], 5e-3)
    return problem.changed(start=motion.q[0], constraints=LIMITS, clearance=clear)


@pytest.fixture(scope="module")
def problem() -> sm.Problem:
    return beside_the_elbow()


@pytest.fixture(scope="module")
def found(problem: sm.Problem) -> sm.placement.PlanWithMargin:
    return sm.plan_with_margin(problem, WANTED, of=("part", "base"))


def lacks(plan: sm.Plan, rng: np.random.Generator) -> int:
    """Return how many displacements of the wanted size bring bodies together."""
    judge, margins = Judge(plan), sm.margin(plan)
    t = np.linspace(0.0, plan.trajectory.duration, 40)
    failed = 0
    for subject in (margins.part, margins.base):
        found = subject.both
        # Straight at what is met first, and anywhere.
        straight = WANTED.position * np.asarray(found.direction), np.zeros(3)
        moves = [random_displacement(rng, WANTED.position, WANTED.rotation) for _ in range(20)]
        for shift, turn in [straight, *moves]:
            failed += judge.least(judge.moved_by(subject, shift, turn), t) < -MISSED
    return failed


def test_the_margin_is_there_and_was_not_before(
    problem: sm.Problem, found: sm.placement.PlanWithMargin
) -> None:
    assert found.reached, str(found)
    assert found.kept_apart
    rng = np.random.default_rng(0)
    assert lacks(found.plan, rng) == 0
    assert lacks(sm.plan(problem), rng) > 0


def test_the_plan_is_of_the_problem_that_was_asked(
    problem: sm.Problem, found: sm.placement.PlanWithMargin
) -> None:
    assert found.plan.problem is problem
    assert found.plan.certificate.verified
    assert found.plan.check().verified
    without = sm.plan(problem)
    assert found.cost_without == pytest.approx(without.report.cost, rel=1e-6)
    assert found.extra_cost > 0.0
    assert "proved" in str(found)


def test_a_margin_that_is_there_costs_nothing(problem: sm.Problem) -> None:
    """Of all that may be displaced together, too."""
    small = sm.plan_with_margin(problem, sm.Margin(1e-4), of=("part", "tool", "base"))
    assert small.reached
    assert not small.kept_apart
    assert small.extra_cost == 0.0


def test_other_routes_are_looked_for_once_and_none_where_the_margin_is_there(
    problem: sm.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each round goes on from the plan before; past bodies, the first begins anew as well."""
    whole = with_margin.plan
    begun: list[bool] = []

    def noted(asked: sm.Problem, **options: object) -> sm.Plan:
        begun.append("warm_start" in options)
        return whole(asked, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(with_margin, "plan", noted)
    assert sm.plan_with_margin(problem, sm.Margin(1e-4)).reached
    assert begun == [False]
    begun.clear()
    assert sm.plan_with_margin(problem, WANTED, of=("part", "base")).reached
    assert begun[:3] == [False, True, False]
    assert all(begun[3:])


def test_a_margin_that_no_motion_has_is_not_claimed(problem: sm.Problem) -> None:
    large = sm.plan_with_margin(problem, sm.Margin(0.5), of="part", deadline=1.0)
    assert not large.reached
    assert large.shortfalls[0].scale < 1.0
    assert "no margin of" in str(large)
    # What is there is verified all the same.
    assert large.plan.certificate.verified


def test_bands_give_what_a_displacement_uses(problem: sm.Problem) -> None:
    asked = problem.changed(start="free", relaxations=(sm.Relaxation("z", 0.06),))
    given = with_margin._narrowed(asked, sm.Margin(0.01, 0.02), 0.5)
    assert given[0].band == pytest.approx(0.06 - 0.01 - 0.5 * 0.02)
    with pytest.raises(sm.errors.ProblemError, match=r"the band of z is 0\.06"):
        with_margin._narrowed(asked, sm.Margin(0.05, 0.02), 0.5)
    turned = dataclasses.replace(asked, relaxations=(sm.Relaxation("rz", 0.1),))
    assert with_margin._narrowed(turned, sm.Margin(0.01, 0.02), 0.5)[0].band == pytest.approx(0.08)


def test_a_pair_that_two_displacements_lack_is_raised_once() -> None:
    """By the displacement that lacks more, in whatever order they come."""
    pair = ("clamp", "hand")
    part, base = (
        Shortfall(of, pair, 1.0, scale, 0.01) for of, scale in (("part", 0.4), ("base", 0.7))
    )
    for known in ({}, {pair: 0.012}):
        alone = with_margin._adjusted(known, Shortfalls((part,), 0.5), 0.0)
        for both in ((part, base), (base, part)):
            assert with_margin._adjusted(known, Shortfalls(both, 0.5), 0.0) == alone


def test_clearances_change_by_what_displacements_take_of_them() -> None:
    """To first order, a distance above the clearance in proportion to the displacement."""
    pair, other = ("a", "b"), ("c", "d")
    distance, clearance, used = 0.05, 0.01, 0.03

    def adjusted(
        scale: float, before: dict[tuple[str, str], float]
    ) -> dict[tuple[str, str], float]:
        lack = Shortfall("part", ("b", "a"), 0.0, scale, used)
        return with_margin._adjusted(before, Shortfalls((lack,), 0.0), clearance)

    # Of more than is wanted by a quarter, a quarter is given back, and of nothing nothing.
    given = adjusted(1.25, {pair: distance, other: clearance})
    assert given[pair] == pytest.approx(distance - 0.25 * (distance - clearance))
    assert given[other] == clearance
    # What is lacking is added, with a little more; a new pair gets all that is used.
    added = adjusted(0.4, {pair: distance})[pair] - distance
    assert 0.6 * used < added < 0.6 * used + 1e-4
    assert used < adjusted(0.4, {})[pair] - clearance < 1.1 * used


def test_margins_are_told_in_millimetres_and_degrees(found: sm.placement.PlanWithMargin) -> None:
    told = dataclasses.replace(found, wanted=sm.Margin(1e-3, np.radians(1.0)))
    assert str(told).startswith("margin of 1 mm and 1° of part, base, proved; cost ")
    # Of what costs nothing there is no share.
    assert dataclasses.replace(found, cost_without=0.0).extra_cost == 0.0


def test_what_cannot_be_bought_is_refused(problem: sm.Problem) -> None:
    for given, said in (
        ({"margin": 0.01}, "expected a Margin"),
        ({"of": "cell"}, "of is 'cell'"),
        ({"clearance": -1}, "clearance"),
    ):
        with pytest.raises(sm.errors.ProblemError, match=said):
            sm.plan_with_margin(problem, **{"margin": WANTED, **given})  # type: ignore[arg-type]
    with pytest.raises(sm.errors.ProblemError, match="position and rotation are 0"):
        sm.Margin()
    with pytest.raises(sm.errors.ProblemError, match="margin: position"):
        sm.Margin(-1.0)


def test_margins_bought_in_the_shell(problem: sm.Problem, tmp_path) -> None:  # type: ignore[no-untyped-def]
    file, out = tmp_path / "cell.toml", tmp_path / "plan.npz"
    sm.files.write_problem(problem, file)
    code, told = invoke("plan-margin", file, "--position", "0.01", "--out", out)
    assert code == 0, told
    assert "margin of 10 mm" in told
    assert sm.load_plan(out).certificate.verified


def test_what_is_told_is_of_the_plan_that_is_returned(
    problem: sm.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A round that fails leaves the plan of before, and its distances with it."""
    whole, kept = with_margin.plan, []

    def failing(asked: sm.Problem, **options: object) -> sm.Plan:
        made = whole(asked, **options)  # type: ignore[arg-type]
        if len(asked.clearances) > len(problem.clearances):
            kept.append(asked.clearances[0])
            wrong = dataclasses.replace(made.certificate, failures=("it was made to fail",))
            # Nearer it is not: it is the motion of before.
            made = dataclasses.replace(first, certificate=wrong)
        return made

    first = whole(problem)
    monkeypatch.setattr(with_margin, "plan", failing)
    found = sm.plan_with_margin(problem, WANTED, of=("part", "base"))
    assert kept
    assert not found.reached
    assert "no more was found: " in str(found)
    assert found.kept_apart == {}
    assert found.cost == first.report.cost


def test_rounds_that_run_out_are_the_reason(
    problem: sm.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each round is verified, and none has the margin: what ended them is said all the same."""
    first = with_margin.plan(problem)
    monkeypatch.setattr(with_margin, "plan", lambda asked, **options: first)
    monkeypatch.setattr(with_margin, "_ROUNDS", 2)
    found = sm.plan_with_margin(problem, WANTED, of=("part", "base"))
    assert not found.reached
    assert found.refused == "2 rounds were not enough"
    assert "no more was found: 2 rounds were not enough" in str(found)


def test_cheaper_motions_that_are_met_are_ones_without_a_margin(
    problem: sm.Problem, found: sm.placement.PlanWithMargin, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the first plan is a poor one, a margin has no price below none."""
    whole, poor = with_margin.plan, []

    def worse(asked: sm.Problem, **options: object) -> sm.Plan:
        made = whole(asked, **options)  # type: ignore[arg-type]
        if not poor:
            report = dataclasses.replace(made.report, cost=2.0 * found.cost)
            made = dataclasses.replace(made, report=report)
            poor.append(made)
        return made

    monkeypatch.setattr(with_margin, "plan", worse)
    again = sm.plan_with_margin(problem, WANTED, of=("part", "base"))
    assert again.reached
    assert again.cost_without <= again.cost
    assert again.extra_cost >= 0.0


@pytest.mark.parametrize("stopped", [0, 1])
def test_ctrl_c_ends_all_rounds(
    problem: sm.Problem, stopped: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, made = with_margin.plan, []

    def plan(asked: sm.Problem, **options: object) -> sm.Plan:
        each = whole(asked, **options)  # type: ignore[arg-type]
        if len(made) == stopped:
            report = dataclasses.replace(each.report, status=sm.optimise.Status.INTERRUPTED)
            each = dataclasses.replace(each, report=report)
        made.append(each)
        return each

    monkeypatch.setattr(with_margin, "plan", plan)
    found = sm.plan_with_margin(problem, WANTED, of=("part", "base"))
    assert len(made) == stopped + 1
    assert found.reached or "it was interrupted" in str(found)


def test_a_plan_to_begin_with_is_taken(
    problem: sm.Problem, found: sm.placement.PlanWithMargin
) -> None:
    again = sm.plan_with_margin(problem, WANTED, of=("part", "base"), warm_start=found.plan)
    assert again.reached

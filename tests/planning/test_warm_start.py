"""Planning from a plan: nothing is lost, and what is not ours is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.planning.planner.guess import lasting
from support.arms import PANDA_HOME
from support.shell import invoke

# Costs on a grid and on the halved one agree to this before a plan stands.
AGREEMENT = 1e-4


# x = 0, the same and the plan's motion on nodes, a step on each of two grids, and the finer grid's
# beginning; nothing to search for.
FEW = 6


@pytest.fixture(scope="module")
def problems() -> dict[str, sm.Problem]:
    panda = sm.load_robot("panda")
    start = panda.dexterous_configuration()
    circle = sm.paths.Circle.around(panda.pose(start), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    closed = (
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
        sm.constraints.ClosedPath(),
    )
    return {
        "paper": sm.sample_problem(),
        "pose": sm.Problem(panda, circle, "pose", start),
        "position": sm.Problem(panda, circle, "position", start),
        "free start": sm.Problem(panda, circle, "position"),
        "closed": sm.Problem(panda, circle, "pose", start, constraints=closed),
    }


@pytest.fixture(scope="module")
def plans(problems: dict[str, sm.Problem]) -> dict[str, sm.Plan]:
    return {name: sm.plan(problem) for name, problem in problems.items()}


NAMES = ("paper", "pose", "position", "free start", "closed")


@pytest.mark.parametrize("name", NAMES)
def test_a_plan_planned_anew_is_itself(name: str, plans: dict[str, sm.Plan]) -> None:
    plan = plans[name]
    again = sm.plan(plan.problem, warm_start=plan)
    assert again.certificate.verified
    # One on each grid of nodes.
    assert again.report.iterations <= 2
    assert again.report.cost == pytest.approx(plan.report.cost, rel=AGREEMENT)
    assert again.report.evaluations <= plan.report.evaluations
    if name != "closed":  # which takes Newton steps to end as it began, on each grid
        # The published method looks at x = 0 on its own grid.
        assert again.report.evaluations <= FEW + (name == "paper")
    assert type(again.report.null_motion) is type(plan.report.null_motion)
    miss = again.trajectory(plan.trajectory.t) - plan.trajectory.q
    assert np.abs(miss).max() < 1e-3


def test_the_paper_s_null_motion_begins_so_too() -> None:
    cubic = sm.PolynomialNullMotion(space="joint", basis="monomial")
    problem = replace(sm.sample_problem(), null_motion=cubic)
    plan = sm.plan(problem)
    again = sm.plan(problem, warm_start=plan)
    assert again.report.iterations <= 3
    assert again.report.cost == pytest.approx(plan.report.cost, rel=AGREEMENT)


def test_a_slower_path_begins_at_the_same_shape(plans: dict[str, sm.Plan]) -> None:
    plan = plans["pose"]
    path = replace(plan.path, duration=2.0 * plan.path.duration)
    problem = replace(plan.problem, path=path)
    warm, cold = sm.plan(problem, warm_start=plan), sm.plan(problem)
    # ∫ ½ q̇ᵀq̇ dt of the same curve in twice the time is half of it.
    assert warm.report.history[0].cost == pytest.approx(0.5 * plan.report.cost, rel=1e-3)
    assert warm.report.iterations < cold.report.iterations
    assert warm.report.cost == pytest.approx(cold.report.cost, rel=1e-3)


def test_x_0_is_begun_with_where_it_is_better(plans: dict[str, sm.Plan]) -> None:
    plan = plans["position"]
    backwards = replace(plan, trajectory=_mirrored(plan.trajectory))
    again = sm.plan(plan.problem, warm_start=backwards)
    assert again.report.history[0].cost <= plan.report.initial_cost * (1.0 + 1e-3)
    assert again.report.cost == pytest.approx(plan.report.cost, rel=1e-3)


def _mirrored(motion: sm.Trajectory) -> sm.Trajectory:
    """Return a motion whose velocities all have the other sign and ten times the size."""
    return replace(motion, qd=-10.0 * motion.qd)


def test_a_given_start_is_kept_where_the_plan_begins_elsewhere(
    problems: dict[str, sm.Problem], plans: dict[str, sm.Plan]
) -> None:
    asked, known = problems["position"], plans["free start"]
    assert np.abs(known.trajectory.q[0] - asked.start).max() > 0.1
    found = sm.plan(asked, warm_start=known).require()
    np.testing.assert_allclose(found.trajectory.q[0], asked.start, atol=1e-9)
    assert found.report.cost <= found.report.initial_cost


def test_what_is_no_plan_of_the_arm_is_refused(plans: dict[str, sm.Plan]) -> None:
    plan = plans["pose"]
    with pytest.raises(sm.errors.ProblemError, match=r"warm_start is 'plan.npz', expected a Plan"):
        sm.plan(plan.problem, warm_start="plan.npz")  # type: ignore[arg-type]
    with pytest.raises(
        sm.errors.ProblemError, match="its joints are joint1, joint2, joint3, expected"
    ):
        sm.plan(plan.problem, warm_start=plans["paper"])


def test_a_problem_file_begins_from_a_plan(tmp_path: Path) -> None:
    file, first, second = tmp_path / "panda.toml", tmp_path / "1.npz", tmp_path / "2.npz"
    assert invoke("init", "panda", "--out", file)[0] == 0
    assert invoke("plan", file, "--out", first)[0] == 0
    assert invoke("plan", file, "--from", first, "--out", second)[0] == 0
    cold, warm = sm.load_plan(first).report, sm.load_plan(second).report
    # It begins where the other one ended: nine tenths of what there is to save are saved.
    saved = cold.initial_cost - cold.cost
    assert warm.history[0].cost < cold.cost + 0.1 * saved
    assert len(warm.history) <= len(cold.history)
    assert warm.cost == pytest.approx(cold.cost, rel=AGREEMENT)


def test_a_motion_that_keeps_the_limits_is_not_given_up_for_one_that_costs_less() -> None:
    """Turned round, a motion keeps tight limits on the way back; from elsewhere none is found."""
    panda = sm.load_robot("panda")
    start = PANDA_HOME + np.array([0.1893, 0.0539, -0.0793, 0.0733, -0.0608, 0.2043, -0.1986])
    first = panda.pose(start)
    turned = pin.exp3(np.array([0.0674, 0.765, 0.4496])) @ first.rotation
    last = pin.SE3(turned, first.translation + np.array([0.0081, -0.0066, 0.0326]))
    line = sm.paths.Line(first, last, 0.8365)
    free = sm.plan(sm.Problem(panda, line, "pose", start, clearance=None))
    t = np.linspace(0.0, line.duration, 2001)
    speed, acceleration, jerk = (np.abs(free.trajectory(t, order)).max() for order in (1, 2, 3))
    limits = (
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(0.95 * speed),
        sm.constraints.JointAccelerationLimits(0.9 * acceleration),
        sm.constraints.JointJerkLimits(1.5 * jerk),
    )

    def tight(path: sm.paths.Path, begin: np.ndarray, end: np.ndarray) -> sm.Problem:
        asked = (*limits, sm.constraints.EndConfiguration(end))
        return sm.Problem(panda, path, "pose", begin, constraints=asked, clearance=None)

    end = free.trajectory.q[-1]
    there = sm.plan(tight(line, start, end)).require()
    motion = there.trajectory
    back = replace(
        motion,
        t=motion.t[-1] - motion.t[::-1],
        q=motion.q[::-1].copy(),
        qd=-motion.qd[::-1],
        qdd=motion.qdd[::-1].copy(),
    )
    problem = tight(sm.paths.Reversed(line), end, start)
    assert problem.certify(back).verified
    found = sm.plan(problem, warm_start=replace(there, trajectory=back))
    assert found.certificate.verified, found.certificate.verdict
    assert found.report.cost <= there.report.cost * (1.0 + 1e-3)


def test_a_motion_that_is_as_fast_as_another_path_ends_when_that_does() -> None:
    """Exactly: of one duration in ten the rounded one is another number."""
    rng = np.random.default_rng(0)
    for own, asked in rng.uniform(0.1, 5.0, (200, 2)):
        still = np.zeros((5, 1))
        found = lasting(sm.Trajectory(np.linspace(0.0, own, 5), still, still, ("a",)), asked)
        assert found.t[-1] == asked
        assert np.all(np.diff(found.t) > 0.0)

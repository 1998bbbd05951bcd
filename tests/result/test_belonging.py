"""A report, margins and corrections are of the motion and the problem that they were made of."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from support.arms import PANDA_HOME, robot_named

# A cost is the same by two integrations of it [share].
INTEGRATED = 1e-6


@pytest.fixture(scope="module")
def plans() -> tuple[sm.Plan, sm.Plan]:
    """One problem with two motions, from starts in other configurations."""
    panda = robot_named("panda")
    circle = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.08, 4.0, normal=(1.0, 0.0, 0.0))
    problem = sm.Problem(panda, circle, start=PANDA_HOME, clearance=None)
    bent = sm.plan(replace(problem, costs=[sm.costs.JointAcceleration()])).require()
    return sm.plan(problem).require(), bent


def test_what_a_motion_costs_is_found_of_that_motion(
    plans: tuple[sm.Plan, sm.Plan], tmp_path: Path
) -> None:
    best, other = plans
    put = replace(best, trajectory=other.trajectory)
    assert not put.certificate.verified
    judged = replace(put, certificate=put.check())
    assert judged.certificate.verified
    (cost,) = best.problem.costs
    expected = best.evaluate(cost), judged.evaluate(cost)
    assert judged.report.cost == pytest.approx(expected[1], rel=INTEGRATED)
    assert judged.report.cost > best.report.cost
    assert judged.report.active == ()
    assert judged.report.remaining is None
    totals = sm.compare([best, judged]).costs["total cost"]
    np.testing.assert_allclose(totals, expected, rtol=INTEGRATED)
    judged.save(tmp_path / "plan.npz")
    assert sm.load_plan(tmp_path / "plan.npz").report.cost == judged.report.cost


def test_a_problem_with_other_costs_is_another_one(plans: tuple[sm.Plan, sm.Plan]) -> None:
    best, _ = plans
    heavy = sm.costs.JointVelocity(2.0)
    other = replace(best, problem=replace(best.problem, costs=[heavy]))
    assert other.report.cost == pytest.approx(other.evaluate(heavy), rel=INTEGRATED)
    assert other.report.cost != pytest.approx(best.report.cost, rel=INTEGRATED)


def test_a_function_of_the_same_name_is_another_cost(plans: tuple[sm.Plan, sm.Plan]) -> None:
    best, _ = plans
    first = sm.costs.FunctionCost(lambda q, qd, t: np.sum(qd**2, axis=1), name="own")
    plan = replace(best, problem=replace(best.problem, costs=[first]))
    other = sm.costs.FunctionCost(lambda q, qd, t: 9.0 * np.sum(qd**2, axis=1), name="own")
    again = replace(plan, problem=replace(plan.problem, costs=[other]))
    assert again.report.cost == pytest.approx(9.0 * plan.report.cost, rel=INTEGRATED)


def test_a_function_that_is_lost_leaves_a_cost_that_is_no_number(
    plans: tuple[sm.Plan, sm.Plan], tmp_path: Path
) -> None:
    best, other = plans
    own = sm.costs.FunctionCost(lambda q, qd, t: np.sum(qd**2, axis=1))
    plan = replace(best, problem=replace(best.problem, costs=[own]))
    replace(plan, certificate=plan.check()).save(tmp_path / "plan.npz")
    read = sm.load_plan(tmp_path / "plan.npz")
    assert np.isfinite(read.report.cost)
    assert np.isnan(replace(read, trajectory=other.trajectory).report.cost)


def test_the_report_of_a_retimed_plan_is_of_its_motion(plans: tuple[sm.Plan, sm.Plan]) -> None:
    faster = sm.retime(plans[0], acceleration=2.0)
    (cost,) = faster.problem.costs
    assert faster.report.cost == pytest.approx(faster.evaluate(cost), rel=INTEGRATED)


def test_margins_of_another_motion_are_refused(
    plans: tuple[sm.Plan, sm.Plan], tmp_path: Path
) -> None:
    best, other = plans
    allowed = sm.Tolerance(1e-3, 0.1)
    sm.files.write_sheet(best, tmp_path / "own.html", sm.margin(best, allowed))
    with pytest.raises(sm.errors.PlanError, match="the margins are of another motion or problem"):
        sm.files.write_sheet(best, tmp_path / "other.html", sm.margin(other, allowed))

"""A report, margins and corrections are of the motion and the problem that they were made of."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.planning.result.measured import cost_of
from support.arms import PANDA_HOME, robot_named

# A cost is the same by two integrations of it [share].
INTEGRATED = 1e-6
# A rolled-out motion is of minimum norm between its knots up to this [rad/s].
SMALL = 1e-5


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
    # Both are of the same costs, or the saving is none.
    still = cost_of(other.problem.follows, other.initial_trajectory, heavy)
    assert other.report.initial_cost == pytest.approx(still, rel=INTEGRATED)


def test_what_the_minimum_norm_motion_costs_is_of_the_one_beside_the_plan(
    plans: tuple[sm.Plan, sm.Plan], tmp_path: Path
) -> None:
    best, other = plans
    put = replace(best, initial_trajectory=other.trajectory)
    (cost,) = best.problem.costs
    expected = cost_of(best.problem.follows, other.trajectory, cost)
    assert put.report.initial_cost == pytest.approx(expected, rel=INTEGRATED)
    assert put.report.initial_cost > best.report.initial_cost
    assert (put.report.cost, put.report.message) == (best.report.cost, best.report.message)
    put.save(tmp_path / "plan.npz")
    assert sm.load_plan(tmp_path / "plan.npz").report.initial_cost == put.report.initial_cost


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
    # No address of a process is in a file.
    assert read.report.costs == {own.name: ""}
    assert np.isfinite(read.report.cost)
    assert np.isnan(replace(read, trajectory=other.trajectory).report.cost)


def test_the_report_of_a_retimed_plan_is_of_its_motion(plans: tuple[sm.Plan, sm.Plan]) -> None:
    faster = sm.retime(plans[0], acceleration=2.0)
    (cost,) = faster.problem.costs
    assert faster.report.cost == pytest.approx(faster.evaluate(cost), rel=INTEGRATED)
    # The other one is at this pace as well: of minimum norm, q̇ = J⁺J q̇, and so no cheaper than it.
    still = faster.initial_trajectory
    for when in np.linspace(0.0, still.duration, 12)[1:-1]:
        jacobian = faster.robot.jacobian(still(when))
        qd = still(when, 1)
        np.testing.assert_allclose(np.linalg.pinv(jacobian) @ (jacobian @ qd), qd, atol=SMALL)
    assert faster.report.initial_cost == pytest.approx(
        cost_of(faster.problem.follows, still, cost), rel=INTEGRATED
    )
    assert faster.report.cost <= faster.report.initial_cost


def test_margins_of_another_motion_are_refused(
    plans: tuple[sm.Plan, sm.Plan], tmp_path: Path
) -> None:
    best, other = plans
    allowed = sm.Tolerance(1e-3, 0.1)
    sm.files.write_sheet(best, tmp_path / "own.html", sm.margin(best, allowed))
    with pytest.raises(sm.errors.PlanError, match="the margins are of another motion or problem"):
        sm.files.write_sheet(best, tmp_path / "other.html", sm.margin(other, allowed))

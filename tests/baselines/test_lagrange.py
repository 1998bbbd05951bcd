"""The optimal control problem by its necessary conditions: the same optimum as ours."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.paper.baselines.lagrange import _Flow

Circle = Callable[..., sm.Problem]


# Optima of methods that share only the kinematics agree to four digits.
FOUR_DIGITS = 1e-4


@pytest.fixture(scope="module")
def lagrangian(ours: sm.Plan) -> sm.Plan:
    return sm.plan_by(sm.sample_problem(), sm.baselines.LagrangianOptimum(ours))


def test_lagrangian_optimum_agrees_with_ours(ours: sm.Plan, lagrangian: sm.Plan) -> None:
    assert lagrangian.certificate.verified
    assert lagrangian.report.cost == pytest.approx(ours.report.cost, rel=FOUR_DIGITS)
    # The reading notes' 32-term expansion.
    assert lagrangian.report.cost == pytest.approx(10.48496, abs=2e-5)


@pytest.mark.parametrize(("duration", "mu"), [(1.0, 1.0), (2.0, 0.05)])
def test_the_default_is_at_the_lagrangian_optimum(duration: float, mu: float) -> None:
    """Over all joint motions there are; its own solution is right to its tolerance."""
    problem = replace(
        sm.sample_problem(mu=mu, duration=duration), null_motion=sm.motion.FreeNullMotion()
    )
    plan = sm.plan(problem)
    best = sm.plan_by(problem, sm.baselines.LagrangianOptimum(plan, tolerance=1e-8))
    assert plan.report.cost == pytest.approx(best.report.cost, rel=1e-5)


def test_lagrangian_optimum_needs_no_guess(lagrangian: sm.Plan) -> None:
    alone = sm.plan_by(sm.sample_problem(), sm.baselines.LagrangianOptimum())
    assert alone.report.cost == pytest.approx(lagrangian.report.cost, rel=1e-6)


def test_cyclic_optimum_closes_and_costs_more() -> None:
    problem = sm.sample_problem(duration=2.0)
    free = sm.plan(problem)
    natural = sm.plan_by(problem, sm.baselines.LagrangianOptimum(free))
    closed = sm.plan_by(problem, sm.baselines.LagrangianOptimum(free, cyclic=True))
    assert natural.certificate.closure > 0.1
    assert closed.certificate.closure < 1e-6
    assert closed.certificate.verified
    assert natural.report.cost < free.report.cost
    assert natural.report.cost < closed.report.cost


@pytest.mark.parametrize("task", ["pose", "pointing", "position"])
def test_lagrangian_optimum_on_a_panda(panda_circle: Circle, task: str) -> None:
    """Redundancy 1, 2 and 4; ours has the cubic's cost, hence is a little above."""
    problem = panda_circle(task, rest=False)
    ours = sm.plan(problem)
    best = sm.plan_by(problem, sm.baselines.LagrangianOptimum(ours, tolerance=1e-5))
    assert best.certificate.verified
    assert best.report.cost <= ours.report.cost * (1.0 + 1e-6)
    assert best.report.cost == pytest.approx(ours.report.cost, rel=5e-3)


@pytest.mark.parametrize("task", ["pose", "pointing"])
def test_hamiltonian_flow(panda_circle: Circle, task: str) -> None:
    """ṗ = -∂H/∂q for H = ½q̇ᵀq̇ + V + pᵀq̇ - λᵀ(Jq̇ - ẋ), stationary in q̇ and λ: by differences."""
    problem = panda_circle(
        task, costs=(sm.costs.JointVelocity(), sm.costs.InverseManipulability(1e-2))
    )
    flow = _Flow(problem)
    rng = np.random.default_rng(3)
    t, p = 1.7, rng.normal(size=7)
    q = sm.plan(problem).trajectory(t)
    manipulability = problem.costs[1]

    def hamiltonian(q: np.ndarray) -> float:
        jacobian = problem.robot.task_jacobian(q, problem.task)
        rotation = problem.robot.pose(q).rotation
        command = problem.task.select(problem.path.twist(t)[:, None], rotation)[:, 0]
        y = np.linalg.solve(jacobian @ jacobian.T, command + jacobian @ p)
        qd = jacobian.T @ y - p
        determinant = np.linalg.det(jacobian @ jacobian.T)
        return float(0.5 * qd @ qd + manipulability.mu / determinant + p @ qd)

    step = 1e-6
    expected = np.array(
        [-(hamiltonian(q + s) - hamiltonian(q - s)) / (2 * step) for s in step * np.eye(7)]
    )
    found = flow.rates(np.array([t]), np.concatenate([q, p])[:, None])[7:, 0]
    # Central differences of a function of order one; the feedback adds its own, tiny on the path.
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5 * np.abs(expected).max())


def test_the_lagrangian_method_refuses_what_it_cannot_solve() -> None:
    def solve(*costs: sm.costs.Cost, cyclic: bool = False) -> None:
        base = sm.sample_problem()
        problem = sm.Problem(base.robot, base.path, base.task, base.start, costs=costs)
        sm.plan_by(problem, sm.baselines.LagrangianOptimum(cyclic=cyclic))

    with pytest.raises(sm.errors.ProblemError, match="'joint acceleration' is neither"):
        solve(sm.costs.JointVelocity(), sm.costs.JointAcceleration())
    with pytest.raises(sm.errors.ProblemError, match="no joint velocity cost"):
        solve(sm.costs.Manipulability())
    with pytest.raises(sm.errors.ProblemError, match="does not end where it begins"):
        solve(sm.costs.JointVelocity(), cyclic=True)
    problem, climb = (
        sm.sample_problem(),
        sm.baselines.GradientProjection(sm.costs.JointVelocity(), gain=1.0),
    )
    with pytest.raises(sm.errors.ProblemError, match="does not depend on the configuration"):
        sm.plan_by(problem, climb)

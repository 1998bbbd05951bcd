"""Other works' methods: each follows the path, the optimum is one, bad input is refused."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.baselines.lagrange import _Flow
from selfmotion.baselines.local import pose_gradient
from selfmotion.replay import write_replay

Circle = Callable[..., sm.Problem]

# Optima of methods that share only the kinematics agree to four digits.
FOUR_DIGITS = 1e-4


@pytest.fixture(scope="module")
def ours() -> sm.Plan:
    """Sixteen coefficients: within the four digits of the optimum over all motions."""
    return sm.plan(sm.sample_problem(null_motion=sm.PolynomialNullMotion(15)))


@pytest.fixture(scope="module")
def lagrangian(ours: sm.Plan) -> sm.Plan:
    return sm.plan_by(sm.sample_problem(), sm.LagrangianOptimum(ours))


def test_pseudo_inverse_is_x_0(ours: sm.Plan) -> None:
    """Two integrators, one of fixed steps and one of controlled error, on the same equation."""
    found = sm.plan_by(sm.sample_problem(), sm.PseudoInverse())
    assert found.certificate.verified
    assert found.report.cost == pytest.approx(ours.report.initial_cost, rel=1e-6)
    assert found.report.cost == pytest.approx(15.500547, abs=1e-5)


def test_lagrangian_optimum_agrees_with_ours(ours: sm.Plan, lagrangian: sm.Plan) -> None:
    assert lagrangian.certificate.verified
    assert lagrangian.report.cost == pytest.approx(ours.report.cost, rel=FOUR_DIGITS)
    # The reading notes' 32-term expansion.
    assert lagrangian.report.cost == pytest.approx(10.48496, abs=2e-5)


def test_lagrangian_optimum_needs_no_guess(lagrangian: sm.Plan) -> None:
    alone = sm.plan_by(sm.sample_problem(), sm.LagrangianOptimum())
    assert alone.report.cost == pytest.approx(lagrangian.report.cost, rel=1e-6)


def test_cyclic_optimum_closes_and_costs_more() -> None:
    problem = sm.sample_problem(duration=2.0)
    free = sm.plan(problem)
    natural = sm.plan_by(problem, sm.LagrangianOptimum(free))
    closed = sm.plan_by(problem, sm.LagrangianOptimum(free, cyclic=True))
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
    best = sm.plan_by(problem, sm.LagrangianOptimum(ours, tolerance=1e-5))
    assert best.certificate.verified
    assert best.report.cost <= ours.report.cost * (1.0 + 1e-6)
    assert best.report.cost == pytest.approx(ours.report.cost, rel=5e-3)


@pytest.mark.parametrize("task", ["pose", "pointing"])
def test_hamiltonian_flow(panda_circle: Circle, task: str) -> None:
    """ṗ = -∂H/∂q for H = ½q̇ᵀq̇ + V + pᵀq̇ - λᵀ(Jq̇ - ẋ), stationary in q̇ and λ: by differences."""
    problem = panda_circle(task, costs=(sm.JointVelocity(), sm.InverseManipulability(1e-2)))
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


def test_gradient_projection_climbs(panda_circle: Circle) -> None:
    problem = panda_circle("position", rest=False)
    still = sm.plan_by(problem, sm.PseudoInverse())
    moving = sm.plan_by(problem, sm.GradientProjection(gain=1.0))
    end = still.trajectory.q[-1], moving.trajectory.q[-1]
    w = [np.prod(np.linalg.svd(problem.robot.task_jacobian(q, problem.task))[1]) for q in end]
    assert w[1] > w[0]
    assert moving.certificate.verified


def test_gradient_projection_tunes_its_gain() -> None:
    """The tuned gain is no worse than others, and better than none."""
    problem = sm.sample_problem()
    tuned = sm.plan_by(problem, sm.GradientProjection())
    assert tuned.report.cost < 0.75 * tuned.report.initial_cost
    for gain in (0.5, 1.0, 2.0):
        fixed = sm.plan_by(problem, sm.GradientProjection(gain=gain))
        assert tuned.report.cost <= fixed.report.cost + 1e-6


def test_pose_gradient_is_that_of_the_cost(panda: sm.RobotModel, panda_circle: Circle) -> None:
    problem = panda_circle("pose")
    q = problem.given_start
    found = pose_gradient(problem, sm.Manipulability(), 0.0, q)

    def negative_w(q: np.ndarray) -> float:
        jacobian = panda.task_jacobian(q, problem.task)
        return -float(np.sqrt(np.linalg.det(jacobian @ jacobian.T)))

    step = 1e-6
    expected = [(negative_w(q + s) - negative_w(q - s)) / (2 * step) for s in step * np.eye(7)]
    np.testing.assert_allclose(found, expected, atol=1e-8)


def test_extended_jacobian_keeps_the_pose_stationary(panda_circle: Circle) -> None:
    problem = panda_circle("pose")
    found = sm.plan_by(problem, sm.ExtendedJacobian())
    assert found.certificate.verified
    q = found.trajectory.q[-1]
    null = np.linalg.svd(problem.robot.task_jacobian(q, problem.task))[2][6:]
    slope = pose_gradient(problem, sm.Manipulability(), 0.0, q)
    start = pose_gradient(problem, sm.Manipulability(), 0.0, problem.given_start)
    assert np.abs(null @ slope).max() < 1e-6 * np.linalg.norm(start)


def test_extended_jacobian_breaks_down_by_name() -> None:
    with pytest.raises(sm.BreakdownError, match=r"without bound|singular") as caught:
        sm.plan_by(sm.sample_problem(), sm.ExtendedJacobian())
    assert 0.0 < caught.value.time < 1.0


def test_damping_costs_path_and_certificates_say_so() -> None:
    found = sm.plan_by(sm.sample_problem(), sm.DampedLeastSquares(0.3))
    assert not found.certificate.verified
    assert found.certificate.position_error.value > 1e-3
    assert "off the path" in found.certificate.verdict
    far = sm.plan_by(sm.sample_problem(), sm.DampedLeastSquares(0.3, threshold=1e-6))
    assert far.certificate.verified


def test_plans_by_a_method_are_plans_like_any(tmp_path: Path) -> None:
    found = sm.plan_by(sm.sample_problem(), sm.PseudoInverse())
    assert write_replay(found, tmp_path / "replay.html").is_file()
    file = tmp_path / "plan.npz"
    found.save(file)
    again = sm.load_plan(file)
    np.testing.assert_array_equal(again.trajectory.q, found.trajectory.q)
    assert again.report.message == found.report.message


@pytest.mark.parametrize(
    ("method", "message"),
    [
        (lambda: sm.DampedLeastSquares(0.0), "damping is 0.0"),
        (lambda: sm.DampedLeastSquares(0.1, -1.0), "threshold is -1.0"),
        (lambda: sm.GradientProjection(gain=-1.0), "gain is -1.0"),
    ],
)
def test_bad_parameters(method: Callable[[], object], message: str) -> None:
    with pytest.raises(sm.ProblemError, match=message):
        method()


def test_the_lagrangian_method_refuses_what_it_cannot_solve() -> None:
    def solve(*costs: sm.Cost, cyclic: bool = False) -> None:
        base = sm.sample_problem()
        problem = sm.Problem(base.robot, base.path, base.task, base.start, costs=costs)
        sm.plan_by(problem, sm.LagrangianOptimum(cyclic=cyclic))

    with pytest.raises(sm.ProblemError, match="'joint acceleration' is neither"):
        solve(sm.JointVelocity(), sm.JointAcceleration())
    with pytest.raises(sm.ProblemError, match="no joint velocity cost"):
        solve(sm.Manipulability())
    with pytest.raises(sm.ProblemError, match="does not end where it begins"):
        solve(sm.JointVelocity(), cyclic=True)
    problem, climb = sm.sample_problem(), sm.GradientProjection(sm.JointVelocity(), gain=1.0)
    with pytest.raises(sm.ProblemError, match="does not depend on the pose"):
        sm.plan_by(problem, climb)

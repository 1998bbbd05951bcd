"""Methods that look at one moment: the pseudo-inverse, and gradient projection."""

from collections.abc import Callable

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.paper.baselines.local import configuration_gradient

Circle = Callable[..., sm.Problem]


def test_pseudo_inverse_is_x_0(ours: sm.Plan) -> None:
    """Two integrators, one of fixed steps and one of controlled error, on the same equation."""
    found = sm.plan_by(sm.sample_problem(), sm.baselines.PseudoInverse())
    assert found.certificate.verified
    assert found.report.cost == pytest.approx(ours.report.initial_cost, rel=1e-6)
    assert found.report.cost == pytest.approx(15.500547, abs=1e-5)


def test_gradient_projection_climbs(panda_circle: Circle) -> None:
    problem = panda_circle("position", rest=False)
    minimum_norm = sm.plan_by(problem, sm.baselines.PseudoInverse())
    moving = sm.plan_by(problem, sm.baselines.GradientProjection(gain=1.0))
    end = minimum_norm.trajectory.q[-1], moving.trajectory.q[-1]
    w = [np.prod(np.linalg.svd(problem.robot.task_jacobian(q, problem.task))[1]) for q in end]
    assert w[1] > w[0]
    assert moving.certificate.verified


@pytest.mark.site
def test_gradient_projection_tunes_its_gain() -> None:
    """The tuned gain is no worse than others, and better than none."""
    problem = sm.sample_problem()
    tuned = sm.plan_by(problem, sm.baselines.GradientProjection())
    assert tuned.report.cost < 0.75 * tuned.report.initial_cost
    for gain in (0.5, 1.0, 2.0):
        fixed = sm.plan_by(problem, sm.baselines.GradientProjection(gain=gain))
        assert tuned.report.cost <= fixed.report.cost + 1e-6


def test_configuration_gradient_is_that_of_the_cost(
    panda: sm.RobotModel, panda_circle: Circle
) -> None:
    problem = panda_circle("pose")
    q = problem.given_start
    found = configuration_gradient(problem, sm.costs.Manipulability(), 0.0, q)

    def negative_w(q: np.ndarray) -> float:
        jacobian = panda.task_jacobian(q, problem.task)
        return -float(np.sqrt(np.linalg.det(jacobian @ jacobian.T)))

    step = 1e-6
    expected = [(negative_w(q + s) - negative_w(q - s)) / (2 * step) for s in step * np.eye(7)]
    np.testing.assert_allclose(found, expected, atol=1e-8)


def test_damping_costs_path_and_certificates_say_so() -> None:
    found = sm.plan_by(sm.sample_problem(), sm.baselines.DampedLeastSquares(0.3))
    assert not found.certificate.verified
    assert found.certificate.position_error.value > 1e-3
    assert "off the path" in found.certificate.verdict
    far = sm.plan_by(sm.sample_problem(), sm.baselines.DampedLeastSquares(0.3, threshold=1e-6))
    assert far.certificate.verified


# The extended Jacobian keeps the pose stationary, or breaks down by name.


def test_extended_jacobian_keeps_the_pose_stationary(panda_circle: Circle) -> None:
    problem = panda_circle("pose")
    found = sm.plan_by(problem, sm.baselines.ExtendedJacobian())
    assert found.certificate.verified
    q = found.trajectory.q[-1]
    null = np.linalg.svd(problem.robot.task_jacobian(q, problem.task))[2][6:]
    slope = configuration_gradient(problem, sm.costs.Manipulability(), 0.0, q)
    start = configuration_gradient(problem, sm.costs.Manipulability(), 0.0, problem.given_start)
    assert np.abs(null @ slope).max() < 1e-6 * np.linalg.norm(start)


def test_extended_jacobian_breaks_down_by_name() -> None:
    with pytest.raises(sm.errors.BreakdownError, match=r"without bound|singular") as caught:
        sm.plan_by(sm.sample_problem(), sm.baselines.ExtendedJacobian())
    assert 0.0 < caught.value.time < 1.0

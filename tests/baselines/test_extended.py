"""The extended Jacobian keeps the pose stationary, or breaks down by name."""

from collections.abc import Callable

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.baselines.local import pose_gradient

Circle = Callable[..., sm.Problem]


def test_extended_jacobian_keeps_the_pose_stationary(panda_circle: Circle) -> None:
    problem = panda_circle("pose")
    found = sm.plan_by(problem, sm.baselines.ExtendedJacobian())
    assert found.certificate.verified
    q = found.trajectory.q[-1]
    null = np.linalg.svd(problem.robot.task_jacobian(q, problem.task))[2][6:]
    slope = pose_gradient(problem, sm.costs.Manipulability(), 0.0, q)
    start = pose_gradient(problem, sm.costs.Manipulability(), 0.0, problem.given_start)
    assert np.abs(null @ slope).max() < 1e-6 * np.linalg.norm(start)


def test_extended_jacobian_breaks_down_by_name() -> None:
    with pytest.raises(sm.errors.BreakdownError, match=r"without bound|singular") as caught:
        sm.plan_by(sm.sample_problem(), sm.baselines.ExtendedJacobian())
    assert 0.0 < caught.value.time < 1.0

"""The pullback of one stage."""

import numpy as np
import pinocchio as pin
import pytest

from selfmotion import kernels
from selfmotion.basics import Array
from support.arms import Case, central_difference

# Exact derivatives against central differences, relative to the largest entry.
GRADIENT = 1e-6


@pytest.mark.parametrize("damped", [False, True])
def test_pullback_of_one_stage_equals_central_differences(case: Case, damped: bool) -> None:
    """Off the path, to q, ε and the path's pose and twist, for cotangents on q, q̇ and e."""
    robot, task, start, path = case
    rng, n, m = np.random.default_rng(10), robot.dof, task.dimension
    q, epsilon = start + 0.02 * rng.normal(size=n), rng.normal(size=n)
    goal = path.pose(0.0)
    table = np.zeros((1, kernels.columns(n, m)))
    at, data = kernels.parts(table, n, m), robot.model.createData()
    gain, kind = 3.0, kernels.angle_kind(task.rows, task.tool_axes)
    sigma = np.linalg.svd(robot.task_jacobian(q, task), compute_uv=False)[-1]
    law = (1.3 * float(sigma), 0.4 * float(sigma)) if damped else None
    by_q, by_qd, by_error = rng.normal(size=n), rng.normal(size=n), rng.normal(size=6)
    if not task.tool_axes:
        # Rows that the task leaves free have no error to speak of.
        by_error[np.isin(np.arange(6), task.rows, invert=True)] = 0.0
    twist = rng.normal(size=6)

    def value(x: Array) -> float:
        """Of changes in q (n), ε (n), and the path's pose (6) and twist (6)."""
        at.q[0], at.epsilon[0] = q + x[:n], epsilon + x[n : 2 * n]
        at.target_translation[0] = goal.translation + x[2 * n : 2 * n + 3]
        at.target_rotation[0] = pin.exp3(x[2 * n + 3 : 2 * n + 6]) @ goal.rotation
        at.target_twist[0] = twist + x[2 * n + 6 :]
        pin.computeJointJacobians(robot.model, data, at.q[0])
        pose = pin.updateFramePlacement(robot.model, data, robot.chain.tip)
        place = (data.J, pose.rotation, pose.translation)
        assert kernels.advance(0, *place, table, task.rows, kind, gain, law)
        return float(by_q @ at.q[0] + by_qd @ at.qd[0] + by_error @ at.error[0])

    expected = central_difference(value, np.zeros(2 * n + 12))
    value(np.zeros(2 * n + 12))
    assert (at.damping[0, 1] > 0.0) == damped
    to_epsilon, to_q, to_target = np.empty((1, n)), np.empty(n), np.empty((1, 12))
    kernels.pullback(
        by_q[None],
        by_qd[None],
        by_error[None],
        table,
        task.rows,
        kind,
        gain,
        law,
        np.zeros(kernels.space_size(n, m)),
        to_epsilon,
        to_q,
        to_target,
    )
    exact = np.concatenate([to_q, to_epsilon[0], to_target[0]])
    np.testing.assert_allclose(exact, expected, atol=GRADIENT * np.abs(expected).max())

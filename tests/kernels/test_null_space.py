"""Bases carried along a motion do not turn inside the null space."""

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.kernels import carried
from selfmotion.model.robot import null_space
from support.arms import Case
from support.rollouts import random_epsilon, rollout_of

# A few products of matrices of order 1, and a Cholesky factor.
ALGEBRA = 1e-10


def transport(jacobians: Array) -> Array:
    return carried(null_space(jacobians[0]), jacobians)


def test_transported_basis_is_orthonormal_and_continuous(case: Case) -> None:
    robot, task, start, _ = case
    rollout = rollout_of(case, 60)
    assert rollout.run(start, random_epsilon(rollout, 3)) is None
    jacobians = rollout.samples().task_jacobian[rollout.grid.node_stages]
    bases = transport(jacobians)
    redundancy = robot.dof - task.dimension
    for jacobian, basis in zip(jacobians, bases, strict=True):
        np.testing.assert_allclose(jacobian @ basis, 0.0, atol=ALGEBRA)
        np.testing.assert_allclose(basis.T @ basis, np.eye(redundancy), atol=ALGEBRA)
    assert np.abs(np.diff(bases, axis=0)).max() < 0.1


def test_transport_survives_flipped_singular_vectors() -> None:
    """Rows reordered and negated from node to node leave the basis continuous."""
    rng = np.random.default_rng(11)
    base, slope = rng.normal(size=(2, 2, 5))
    jacobians = []
    for k in range(50):
        jacobian = base + 0.02 * k * slope
        jacobians.append((-1.0) ** k * jacobian[:: (-1) ** k])
    assert np.abs(np.diff(transport(np.array(jacobians)), axis=0)).max() < 0.1

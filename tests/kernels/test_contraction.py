"""The contraction with ∂J/∂q, on every arm."""

import numpy as np

import selfmotion as sm
from selfmotion import kernels
from selfmotion.kernels import stages, tool
from support.arms import Case, central_difference
from support.compiled import compiled
from support.followed import standing

contract, damp = compiled(tool.contract), compiled(stages.damp)


def test_contraction_with_the_hessian_and_a_twist(panda: sm.RobotModel) -> None:
    """⟨M, ∂J6/∂q⟩ + J6ᵀ t, added to what is there."""
    rng = np.random.default_rng(8)
    q, weights, twist = rng.normal(size=7), rng.normal(size=(6, 7)), rng.normal(size=6)
    out = np.ones(7)
    layout = standing(panda, "pose").layout
    contract(layout, 0, np.ascontiguousarray(panda.jacobian(q)), weights, twist, out)
    hessian = central_difference(lambda x: float((weights * panda.jacobian(x)).sum()), q)
    np.testing.assert_allclose(out, 1.0 + hessian + panda.jacobian(q).T @ twist, atol=1e-8)


def test_contraction_equals_the_jacobian_hessian(case: Case) -> None:
    """⟨M, ∂J/∂q⟩ in O(n) against differences of the task Jacobian, for any M."""
    robot, task, start, _ = case
    weights = np.random.default_rng(10).normal(size=(task.dimension, robot.dof))
    found = kernels.contract_task(
        robot.jacobian(start)[None],
        np.array(robot.pose(start).rotation)[None],
        weights[None],
        standing(robot, task).layout,
        0,
    )[0]
    expected = central_difference(
        lambda q: float((weights * robot.task_jacobian(q, task)).sum()), start
    )
    np.testing.assert_allclose(found, expected, atol=1e-7)

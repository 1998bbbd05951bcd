"""Null spaces of Jacobians, and what is asked of many configurations at once."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from support.arms import CASES, robot_named

# A few roundings of Jacobians of order 1.
ROUNDING = 1e-12
LINKS = np.array([2.0, 2.0, 1.0])


@pytest.fixture(params=CASES, ids=lambda case: "-".join(case))
def arm(request: pytest.FixtureRequest) -> tuple[sm.RobotModel, str, Array]:
    """Each arm with its task, and configurations (5, n)."""
    name, task = request.param
    robot = robot_named(name)
    return robot, task, robot.generic_configurations()


def test_its_columns_are_orthonormal_and_do_not_move_the_tool(arm) -> None:
    robot, task, q = arm
    bases = robot.null_space(q, task)
    assert bases.shape == (len(q), robot.dof, robot.redundancy(task))
    for here, basis in zip(q, bases, strict=True):
        assert np.abs(robot.task_jacobian(here, task) @ basis).max() <= ROUNDING
        np.testing.assert_allclose(basis.T @ basis, np.eye(basis.shape[1]), atol=ROUNDING)


def test_it_is_all_of_the_null_space(arm) -> None:
    """N Nᵀ = I − J⁺J, by a pseudo-inverse of normal equations: no singular values."""
    robot, task, q = arm
    for here in q:
        basis, rows = robot.null_space(here, task), robot.task_jacobian(here, task)
        projector = np.eye(robot.dof) - rows.T @ np.linalg.solve(rows @ rows.T, rows)
        np.testing.assert_allclose(basis @ basis.T, projector, atol=1e-9)


def test_of_the_planar_arm_it_is_the_cross_product_of_the_rows(planar: sm.RobotModel) -> None:
    for q in planar.generic_configurations():
        angles = np.cumsum(q)
        rows = [
            [-(LINKS * np.sin(angles))[k:].sum() for k in range(3)],
            [(LINKS * np.cos(angles))[k:].sum() for k in range(3)],
        ]
        along = np.cross(*rows)
        found = planar.null_space(q, "planar")[:, 0]
        expected = along / np.linalg.norm(along)
        np.testing.assert_allclose(found, np.sign(found @ expected) * expected, atol=ROUNDING)


def test_rows_that_no_joint_moves_do_not_count(planar: sm.RobotModel) -> None:
    """The planar arm never moves along z: its position has the null space of x and y."""
    q = planar.generic_configurations()
    assert planar.null_space(q, "position").shape == (len(q), 3, 1)


def test_a_singular_configuration_has_a_larger_one(planar: sm.RobotModel) -> None:
    straight, bent = [0.3, 0.0, 0.0], [0.3, 0.5, 0.2]
    assert planar.null_space(straight, "planar").shape == (3, 2)
    with pytest.raises(
        sm.errors.RobotError, match=r"rank 2 at configuration 0 and 1 at configuration 1"
    ):
        planar.null_space([bent, straight], "planar")


def test_many_configurations_are_each_of_them(arm) -> None:
    robot, task, q = arm
    for k, (here, pose) in enumerate(zip(q, robot.pose(q), strict=True)):
        found = robot.pose(here).homogeneous
        np.testing.assert_allclose(found, pose.homogeneous, rtol=0, atol=ROUNDING)
        one, all_of_them = robot.jacobian(here), robot.jacobian(q)
        np.testing.assert_allclose(all_of_them[k], one, rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(
            robot.task_jacobian(q, task)[k], robot.task_jacobian(here, task), rtol=0, atol=ROUNDING
        )


def test_no_configurations_are_none(panda: sm.RobotModel) -> None:
    none = np.zeros((0, 7))
    assert panda.pose(none) == []
    assert panda.jacobian(none).shape == (0, 6, 7)
    assert panda.null_space(none).shape == (0, 7, 1)


@pytest.mark.parametrize("ask", ["pose", "jacobian", "null_space"])
def test_what_is_no_configuration_is_named(panda: sm.RobotModel, ask: str) -> None:
    bad = np.zeros((3, 7))
    bad[2, 1] = np.nan
    with pytest.raises(sm.errors.RobotError, match="configuration 2: joint 'panda_joint2' is nan"):
        getattr(panda, ask)(bad)
    with pytest.raises(sm.errors.RobotError, match=r"\(3, 6\), expected \(7,\) or \(K, 7\)"):
        getattr(panda, ask)(np.zeros((3, 6)))
    with pytest.raises(sm.errors.RobotError, match=r"\(2, 3, 7\)"):
        getattr(panda, ask)(np.zeros((2, 3, 7)))

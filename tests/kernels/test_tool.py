"""Errors of the tool: logarithms, their pullbacks, and the rows of a task."""

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.basics.layout import LOGARITHM, POINTING, layout_of
from selfmotion.model import kernels
from selfmotion.model.kernels import stages, tool
from support.arms import Case, central_difference
from support.compiled import compiled
from support.followed import standing

# Well-conditioned algebra with entries of order 1.
ALGEBRA = 1e-12


TASKS = [sm.Task.POSE, sm.Task.POSITION, sm.Task.POINTING, sm.Task.PLANAR, sm.Task.PLANAR_POSE]


rotation_error, pointing_error = compiled(tool.rotation_error), compiled(tool.pointing_error)


pull_error, pose_error = compiled(tool.pull_error), compiled(tool.pose_error)


select, unselect, task_rows = map(compiled, (tool.select, tool.unselect, tool.task_rows))


def random_rotation(rng: np.random.Generator) -> Array:
    return np.asarray(pin.exp3(rng.uniform(-1.8, 1.8, 3)))


@pytest.mark.parametrize("angle", [0.0, 1e-14, 1e-9, 1e-4, 0.3, 2.0, 3.1])
def test_rotation_error_is_the_logarithm(angle: float) -> None:
    rng = np.random.default_rng(3)
    axis = rng.normal(size=3)
    expected = angle * axis / np.linalg.norm(axis)
    actual = random_rotation(rng)
    target = np.asarray(pin.exp3(expected)) @ actual
    # sin θ carries the digits, few of which are left where θ is near π.
    atol = 1e-15 / max(np.sin(angle), 0.1) + 1e-15
    np.testing.assert_allclose(rotation_error(target, actual), expected, atol=atol)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 0.3, 2.0, 3.1])
def test_pointing_error_is_the_shortest_turn_of_the_axis(angle: float) -> None:
    rng = np.random.default_rng(4)
    actual = random_rotation(rng)
    across = actual @ [np.cos(0.7), np.sin(0.7), 0.0]
    spin = pin.exp3(1.3 * actual[:, 2])
    target = np.asarray(pin.exp3(angle * across)) @ spin @ actual
    found = np.array(pointing_error(target, actual))
    np.testing.assert_allclose(found, angle * across, atol=1e-13)


@pytest.mark.parametrize("angle", [0.0, 1e-7, 1e-3, 0.0499, 0.0501, 0.5, 2.0, 3.0, 3.14])
def test_pullback_of_the_rotation_error_is_pinocchios(angle: float) -> None:
    """-Jr⁻¹ᵀ w, on both sides of where the series ends, and near π."""
    rng = np.random.default_rng(5)
    axis = rng.normal(size=3)
    phi = angle * axis / np.linalg.norm(axis)
    error, z, out = np.concatenate([np.zeros(3), phi]), rng.normal(size=6), np.empty(6)
    pull_error(LOGARITHM, error, np.eye(3), np.eye(3), z, out)
    expected = -pin.Jlog3(np.asarray(pin.exp3(phi))).T @ z[3:]
    np.testing.assert_allclose(out[:3], -z[:3])
    # Pinocchio's own logarithm loses digits near π.
    np.testing.assert_allclose(out[3:], expected, atol=1e-12 if angle < 3.0 else 1e-6)


@pytest.mark.parametrize("angle", [1e-3, 0.0499, 0.0501, 0.5, 2.0, 3.0])
@pytest.mark.parametrize("kind", [LOGARITHM, POINTING])
def test_pullback_of_the_pose_error_equals_central_differences(kind: int, angle: float) -> None:
    rng = np.random.default_rng(6)
    rotation = random_rotation(rng)
    across = rotation @ [np.cos(0.7), np.sin(0.7), 0.3 * (kind == LOGARITHM)]
    target = np.asarray(pin.exp3(angle * across / np.linalg.norm(across))) @ rotation
    z, error, out = rng.normal(size=6), np.empty(6), np.empty(6)

    def value(twist: Array) -> float:
        moved = np.asarray(pin.exp3(twist[3:])) @ rotation
        pose_error(kind, np.ones(3), target, twist[:3].copy(), moved, error)
        return float(z @ error)

    expected = central_difference(value, np.zeros(6))
    value(np.zeros(6))
    pull_error(kind, error, rotation, target, z, out)
    # The differences divide rounding in sin θ, too.
    atol = 1e-8 / max(np.sin(angle), 0.1) * max(1.0, np.abs(expected).max())
    np.testing.assert_allclose(out, expected, atol=atol)


def test_the_coefficients_equal_those_of_more_digits() -> None:
    """The closed forms with 18 digits, where those are good for 13."""
    logarithm = compiled(tool.logarithm_coefficient)
    pointing = compiled(tool.pointing_coefficients)
    for angle in (0.02, 0.04, 0.0499, 0.0501, 0.1, 1.0, 3.0):
        x = np.longdouble(angle)
        expected = (1 - x / 2 / np.tan(x / 2)) / x**2
        assert logarithm(angle) == pytest.approx(float(expected), rel=1e-12)
        slope = (x * np.cos(x) - np.sin(x)) / np.sin(x) ** 3
        found = pointing(np.sin(angle), np.cos(angle))
        assert found[0] == pytest.approx(float(x / np.sin(x)), rel=1e-12)
        assert found[1] == pytest.approx(float(slope), rel=1e-11)
    assert logarithm(np.pi) == pytest.approx(1.0 / np.pi**2)


@pytest.mark.parametrize("task", TASKS)
def test_selection_is_the_tasks_and_has_its_adjoint(task: sm.Task) -> None:
    """⟨S t, v⟩ = ⟨t, Sᵀ v⟩, and J = S J6 column by column."""
    rng = np.random.default_rng(7)
    rotation, jacobian = random_rotation(rng), rng.normal(size=(6, 7))
    layout = layout_of([(task.rows, task.tool_axes, np.arange(7))], 7)
    v, given = rng.normal(size=task.dimension), (layout, 0, rotation)
    rows, selected = np.empty((task.dimension, 7)), np.empty(task.dimension)
    back = np.empty(6)
    task_rows(*given, jacobian, rows)
    np.testing.assert_allclose(rows, task.select(jacobian, rotation), atol=ALGEBRA)
    twist = jacobian[:, 2].copy()
    select(*given, twist, selected)
    np.testing.assert_allclose(selected, rows[:, 2], atol=ALGEBRA)
    unselect(*given, v, back)
    assert selected @ v == pytest.approx(twist @ back, abs=ALGEBRA)


# The contraction with ∂J/∂q, on every arm.

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

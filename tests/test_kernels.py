"""Each compiled kernel against a NumPy formula, Pinocchio, or differences."""

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from conftest import central_difference
from selfmotion import kernels
from selfmotion.basics.arrays import Array
from selfmotion.kernels import algebra, backward, contraction, damping, table, tool

Case = tuple[sm.RobotModel, sm.Task, Array, sm.Path]

# Well-conditioned algebra with entries of order 1.
ALGEBRA = 1e-12
# Exact derivatives against central differences, relative to the largest entry.
GRADIENT = 1e-6
SIZES = range(1, 7)
TASKS = [sm.Task.POSE, sm.Task.POSITION, sm.Task.POINTING, sm.Task.PLANAR, sm.Task.PLANAR_POSE]


def compiled(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """Return a kernel that kernels call as they have it, not as Python runs it."""
    function: Callable[..., Any] = numba.njit(error_model="numpy")(lambda *given: kernel(*given))
    return function


gram, cholesky = compiled(algebra.gram), compiled(algebra.cholesky)
solve_cholesky, respond = compiled(algebra.solve_cholesky), compiled(algebra.respond)
smallest_eigenvector = compiled(algebra.smallest_eigenvector)
rotation_error, pointing_error = compiled(tool.rotation_error), compiled(tool.pointing_error)
pull_error, pose_error = compiled(tool.pull_error), compiled(tool.pose_error)
select, unselect, task_rows = map(compiled, (tool.select, tool.unselect, tool.task_rows))
contract, damp = compiled(contraction.contract), compiled(damping.damp)


def random_rotation(rng: np.random.Generator) -> Array:
    return np.asarray(pin.exp3(rng.uniform(-1.8, 1.8, 3)))


def positive(rng: np.random.Generator, m: int) -> Array:
    root = rng.normal(size=(m, m + 2))
    return np.asarray(root @ root.T)


@pytest.mark.parametrize(("n", "m"), [(3, 2), (7, 6), (8, 5), (2, 1)])
def test_parts_tile_what_they_are_parts_of(n: int, m: int) -> None:
    """Each number belongs to one part: no overlap, none left, none beyond the end."""
    for parts, size in (
        (table.parts, kernels.columns(n, m)),
        (backward.divide, kernels.space_size(n, m)),
    ):
        numbers = np.arange(float(size))
        found = np.concatenate([part.ravel() for part in parts(numbers, n, m)])
        np.testing.assert_array_equal(np.sort(found), numbers)


def test_compiled_parts_are_those_in_python() -> None:
    """Of a row, and q and q̇ by themselves."""
    rows = np.random.default_rng(0).normal(size=(2, kernels.columns(7, 6)))
    read = compiled(table.parts)
    for s in range(2):
        for mine, theirs in zip(read(rows[s], 7, 6), table.parts(rows[s], 7, 6), strict=True):
            np.testing.assert_array_equal(mine, theirs)
        np.testing.assert_array_equal(
            compiled(table.q_of)(rows, s, 7), kernels.parts(rows, 7, 6).q[s]
        )
        np.testing.assert_array_equal(
            compiled(table.qd_of)(rows, s, 7), kernels.parts(rows, 7, 6).qd[s]
        )


@pytest.mark.parametrize("m", SIZES)
def test_cholesky_factor_and_its_solutions(m: int) -> None:
    rng = np.random.default_rng(m)
    a, b = positive(rng, m), rng.normal(size=m)
    factor, solution = np.tril(a), b.copy()
    assert cholesky(factor)
    lower = np.tril(factor, -1) + np.diag(1.0 / np.diag(factor))
    np.testing.assert_allclose(lower @ lower.T, a, atol=ALGEBRA * np.abs(a).max())
    solve_cholesky(factor, solution)
    np.testing.assert_allclose(a @ solution, b, atol=ALGEBRA * np.linalg.cond(a))


@pytest.mark.parametrize("m", SIZES)
def test_cholesky_refuses_what_is_not_positive(m: int) -> None:
    """Also where rounding alone makes it so."""
    rng = np.random.default_rng(m)
    for _ in range(50):
        rows = np.linalg.qr(rng.normal(size=(8, m - 1)))[0].T
        rows = np.vstack([rows, rng.normal(size=m - 1) @ rows])
        assert not cholesky(rows @ rows.T)
    assert not cholesky(-positive(rng, m))
    broken = positive(rng, m)
    broken[m - 1, 0] = np.nan
    assert not cholesky(broken)


@pytest.mark.parametrize("m", SIZES)
def test_gram_and_the_solution_of_equation_4(m: int) -> None:
    rng = np.random.default_rng(m)
    jacobian, u, epsilon = rng.normal(size=(m, 8)), rng.normal(size=m), rng.normal(size=8)
    factor, y, qd = np.zeros((m, m)), u.copy(), np.empty(8)
    gram(jacobian, factor)
    np.testing.assert_allclose(factor, np.tril(jacobian @ jacobian.T), atol=ALGEBRA)
    assert cholesky(factor)
    respond(jacobian, factor, y, epsilon, qd)
    inverse = np.linalg.pinv(jacobian)
    expected = inverse @ u + epsilon - inverse @ (jacobian @ epsilon)
    np.testing.assert_allclose(qd, expected, atol=ALGEBRA * np.linalg.cond(jacobian) ** 2)


@pytest.mark.parametrize("m", SIZES)
@pytest.mark.parametrize("equal", [1, 2, 6])
def test_smallest_eigenvector(m: int, equal: int) -> None:
    """Also of matrices whose smallest eigenvalues are equal, or all of them."""
    rng = np.random.default_rng(m)
    basis = np.linalg.qr(rng.normal(size=(m, m)))[0]
    values = np.sort(rng.uniform(0.1, 2.0, m))
    values[:equal] = values[0]
    a = (basis * values) @ basis.T
    vector = np.empty(m)
    value = smallest_eigenvector(a.copy(), np.empty((m, m)), vector)
    assert value == pytest.approx(values[0], abs=ALGEBRA)
    assert np.linalg.norm(vector) == pytest.approx(1.0, abs=ALGEBRA)
    np.testing.assert_allclose(a @ vector, value * vector, atol=ALGEBRA)


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
    pull_error(tool.LOGARITHM, error, np.eye(3), np.eye(3), z, out)
    expected = -pin.Jlog3(np.asarray(pin.exp3(phi))).T @ z[3:]
    np.testing.assert_allclose(out[:3], -z[:3])
    # Pinocchio's own logarithm loses digits near π.
    np.testing.assert_allclose(out[3:], expected, atol=1e-12 if angle < 3.0 else 1e-6)


@pytest.mark.parametrize("angle", [1e-3, 0.0499, 0.0501, 0.5, 2.0, 3.0])
@pytest.mark.parametrize("kind", [tool.LOGARITHM, tool.POINTING])
def test_pullback_of_the_pose_error_equals_central_differences(kind: int, angle: float) -> None:
    rng = np.random.default_rng(6)
    rotation = random_rotation(rng)
    across = rotation @ [np.cos(0.7), np.sin(0.7), 0.3 * (kind == tool.LOGARITHM)]
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
    v, given = rng.normal(size=task.dimension), (task.rows, task.tool_axes, rotation)
    rows, selected = np.empty((task.dimension, 7)), np.empty(task.dimension)
    back = np.empty(6)
    task_rows(*given, jacobian, rows)
    np.testing.assert_allclose(rows, task.select(jacobian, rotation), atol=ALGEBRA)
    twist = jacobian[:, 2].copy()
    select(*given, twist, selected)
    np.testing.assert_allclose(selected, rows[:, 2], atol=ALGEBRA)
    unselect(*given, v, back)
    assert selected @ v == pytest.approx(twist @ back, abs=ALGEBRA)


def test_contraction_with_the_hessian_and_a_twist(panda: sm.RobotModel) -> None:
    """⟨M, ∂J6/∂q⟩ + J6ᵀ t, added to what is there."""
    rng = np.random.default_rng(8)
    q, weights, twist = rng.normal(size=7), rng.normal(size=(6, 7)), rng.normal(size=6)
    out = np.ones(7)
    contract(np.ascontiguousarray(panda.jacobian(q)), weights, twist, out)
    hessian = central_difference(lambda x: float((weights * panda.jacobian(x)).sum()), q)
    np.testing.assert_allclose(out, 1.0 + hessian + panda.jacobian(q).T @ twist, atol=1e-8)


@pytest.mark.parametrize("m", SIZES)
def test_damping_and_its_derivative(m: int) -> None:
    """λ² and 1 - f by NumPy's singular values; df by differences of JJᵀ through v."""
    rng = np.random.default_rng(m)
    jacobian, strength = rng.normal(size=(m, 8)), 0.3
    sigma = np.linalg.svd(jacobian, compute_uv=False)[-1]
    law = (1.5 * sigma, strength)

    def fade(jacobian: Array) -> float:
        sigma = np.linalg.svd(jacobian, compute_uv=False)[-1]
        return float((1.0 - (sigma / law[0]) ** 2) ** 2)

    square = np.tril(jacobian @ jacobian.T)
    damped, out = square.copy(), np.empty(3 + m)
    assert damp(damped, law, out) == pytest.approx(1.0 - fade(jacobian), abs=ALGEBRA)
    expected = square + strength**2 * fade(jacobian) * np.eye(m)
    np.testing.assert_allclose(damped, expected, atol=ALGEBRA * square.max())
    assert out[0] == strength**2
    assert out[1] == pytest.approx(fade(jacobian), abs=ALGEBRA)
    change = rng.normal(size=(m, 8))
    slope = (fade(jacobian + 1e-6 * change) - fade(jacobian - 1e-6 * change)) / 2e-6
    found = out[2] * 2.0 * (out[3:] @ change) @ (jacobian.T @ out[3:])
    assert found == pytest.approx(slope, rel=GRADIENT, abs=GRADIENT)


def test_no_damping_beyond_the_threshold_nor_of_nan() -> None:
    jacobian = np.random.default_rng(9).normal(size=(6, 8))
    square = np.tril(jacobian @ jacobian.T)
    sigma = np.linalg.svd(jacobian, compute_uv=False)[-1]
    for scale, broken in ((0.999, False), (1e3, True)):
        given, out = square.copy(), np.ones(9)
        if broken:
            given[3] = np.nan
        before = given.copy()
        assert damp(given, (scale * sigma, 0.3), out) == 1.0
        np.testing.assert_array_equal(given, before)
        np.testing.assert_array_equal(out, 0.0)


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
        pose = pin.updateFramePlacement(robot.model, data, robot.tool_id)
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

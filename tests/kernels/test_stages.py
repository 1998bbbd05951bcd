"""Damping and its derivative."""

import numpy as np
import pytest

from selfmotion.basics import Array
from selfmotion.model import kernels
from selfmotion.model.follow import Follows
from selfmotion.model.kernels import stages, tool
from support.arms import Case, central_difference
from support.compiled import compiled
from support.two_arms import both_arms

# Well-conditioned algebra with entries of order 1.
ALGEBRA = 1e-12


# Exact derivatives against central differences, relative to the largest entry.
GRADIENT = 1e-6


SIZES = range(1, 7)


contract, damp = compiled(tool.contract), compiled(stages.damp)


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


# The pullback of one stage.

# Exact derivatives against central differences, relative to the largest entry.


@pytest.mark.parametrize("damped", [False, True])
def test_pullback_of_one_stage_equals_central_differences(case: Case, damped: bool) -> None:
    robot, task, start, path = case
    check_stage(Follows.of(robot, path, task), start, damped)


@pytest.mark.parametrize("damped", [False, True])
@pytest.mark.parametrize(
    "tasks", [("pose", "position"), ("pointing", "pose"), ("planar", "pointing")]
)
def test_pullback_of_one_stage_with_several_tips(tasks: tuple[str, str], damped: bool) -> None:
    """Two arms on one body, the second relative to the first: rows stacked."""
    check_stage(*both_arms(*tasks), damped)


def check_stage(follows: Follows, start: Array, damped: bool) -> None:
    """Off the path, to q and ε, for cotangents on q, q̇ and e."""
    rng, n, m = np.random.default_rng(10), follows.robot.dof, follows.dimension
    count = len(follows.items)
    q, epsilon = start + 0.02 * rng.normal(size=n), rng.normal(size=n)
    goals = [item.path.pose(0.0) for item in follows.items]
    table = np.zeros((1, kernels.columns(n, m, count)))
    at = kernels.stage_of(table, n, m)
    tips = [kernels.tip_of(table, f, n, m) for f in range(count)]
    places = [item.chain.kinematics() for item in follows.items]
    gain, layout = 3.0, follows.layout
    sigma = np.linalg.svd(follows.jacobian(q), compute_uv=False)[-1]
    law = (1.3 * float(sigma), 0.4 * float(sigma)) if damped else None
    by_q, by_qd, by_error = rng.normal(size=n), rng.normal(size=n), rng.normal(size=(count, 6))
    for f, item in enumerate(follows.items):
        if not item.task.tool_axes:
            # Rows that the task leaves free have no error to speak of.
            by_error[f, np.isin(np.arange(6), item.task.rows, invert=True)] = 0.0
    twists = rng.normal(size=(count, 6))

    def value(x: Array) -> float:
        """Of changes in q (n) and ε (n)."""
        at.q[0], at.epsilon[0] = q + x[:n], epsilon + x[n:]
        for f, (tip, goal, place) in enumerate(zip(tips, goals, places, strict=True)):
            tip.target_translation[0], tip.target_rotation[0] = goal.translation, goal.rotation
            tip.target_twist[0] = twists[f]
            place.refresh(at.q[0])
            where = (place.jacobian, place.rotation, place.translation)
            assert kernels.advance(0, f, *where, table, layout, gain, law)
        return float(by_q @ at.q[0] + by_qd @ at.qd[0]) + sum(
            float(by_error[f] @ tip.error[0]) for f, tip in enumerate(tips)
        )

    expected = central_difference(value, np.zeros(2 * n))
    value(np.zeros(2 * n))
    assert (at.damping[0, 1] > 0.0) == damped
    to_epsilon, to_q = np.empty((1, n)), np.empty(n)
    kernels.pullback(
        by_q[None],
        by_qd[None],
        by_error[None],
        table,
        layout,
        gain,
        law,
        None,
        np.zeros(kernels.space_size(n, m)),
        to_epsilon,
        to_q,
    )
    exact = np.concatenate([to_q, to_epsilon[0]])
    np.testing.assert_allclose(exact, expected, atol=GRADIENT * np.abs(expected).max())

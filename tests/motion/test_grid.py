"""Steps are as short as they need to be, where they need to be."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.motion import Grid
from support.arms import robot_named


def test_steps_are_halved_where_they_are_asked_to_be() -> None:
    grid = Grid(np.array([0.0, 1.0, 3.0, 4.0]))
    np.testing.assert_array_equal(grid.halved().nodes, [0.0, 0.5, 1.0, 2.0, 3.0, 3.5, 4.0])
    some = grid.halved(np.array([False, True, False]))
    np.testing.assert_array_equal(some.nodes, [0.0, 1.0, 2.0, 3.0, 4.0])
    # A quadrature of order four on any steps.
    assert some.weights @ some.stage_times**3 == pytest.approx(64.0, rel=1e-12)


def bumped(t: Array) -> Array:
    """Return a straight line with one short detour, (N, 3) [m]."""
    bump = 0.02 * np.exp(-(((t - 1.0) / 0.05) ** 2))
    return np.stack([0.1 * t, bump, np.zeros_like(t)], axis=1)


def test_steps_are_short_where_the_path_bends_and_not_elsewhere() -> None:
    robot = robot_named("panda")
    q = robot.dexterous_configuration("position")
    t = np.linspace(0.0, 2.0, 201)
    points = robot.pose(q).translation + bumped(t) - bumped(np.zeros(1))
    problem = sm.Problem(
        robot,
        sm.paths.Waypoints(t, points),
        "position",
        q,
        null_motion=sm.PolynomialNullMotion(),
        constraints=[],
        rest=False,
    )
    plan = sm.plan(problem, tolerance=sm.Tolerance(1e-10, 1e-10))
    assert plan.certificate.on_path
    steps, middles = np.diff(plan.trajectory.t), plan.trajectory.t[:-1]
    near = np.abs(middles - 1.0) < 0.2
    assert steps[near].min() <= 0.25 * steps[~near].max()
    # As if steps were equal, but fewer of them.
    assert len(steps) < 0.7 * 2.0 / steps.min()

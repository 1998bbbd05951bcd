"""Conditions on nodes and between them, and how they change with the nodes."""

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

import selfmotion as sm
from selfmotion.nodes.spline import Hermite
from support.arms import PANDA_HOME
from support.nodes import around_of, centred, moved, nodes_of, random_step

NEAR, DIFFERENCE = 1e-5, 1e-6

CONSTRAINTS = {
    "positions": lambda: [sm.JointPositionLimits()],
    "rates": lambda: [
        sm.JointVelocityLimits(1.0),
        sm.JointAccelerationLimits(2.0),
        sm.JointJerkLimits(20.0),
    ],
    "a band": lambda: [sm.Band.of_elbow("up")],
    "tool": lambda: [sm.ToolLimits(acceleration=1.0)],
    "two": lambda: [sm.JointPositionLimits(), sm.JointAccelerationLimits(2.0)],
    "clearance": lambda: [
        sm.JointPositionLimits(),
        sm.Clearance([sm.Sphere("ball", (0.6, 0.35, 0.4), 0.1)], distance=0.02),
    ],
}


def motion_with(panda: sm.RobotModel, name: str):
    path = sm.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    problem = sm.Problem(
        *(panda, path, "position", PANDA_HOME),
        constraints=CONSTRAINTS[name](),
        rest=False,
        collision=None,
    )
    motion = nodes_of(problem, 10)
    return centred(moved(motion, random_step(motion, 1, 0.02)))


@pytest.mark.parametrize("name", CONSTRAINTS)
@pytest.mark.parametrize("known", [False, True])
def test_what_is_near_a_limit_is_what_the_residuals_say(
    panda: sm.RobotModel, name: str, known: bool
) -> None:
    """Whether these are known already or not."""
    motion = motion_with(panda, name)
    between = motion.h[:-1, motion.h.shape[1] // 2 :].max(axis=1)
    # Between two of them, so that no rounding decides.
    near = -np.sort(between)[-3:-1].mean()
    asked = motion if known else motion_with(panda, name)
    found = asked.grid.conditions.along(asked.samples.checked, near)
    assert np.count_nonzero(found) == 2
    np.testing.assert_array_equal(found, between > -near)


@pytest.mark.parametrize("name", CONSTRAINTS)
def test_rows_and_pullbacks_are_central_differences(panda: sm.RobotModel, name: str) -> None:
    motion = motion_with(panda, name)
    step, conditions = random_step(motion, 2), motion.grid.conditions
    above, below = (moved(motion, sign * NEAR * step).h for sign in (1.0, -1.0))
    change = (above - below) / (2 * NEAR)
    around = around_of(motion)
    columns = np.arange(motion.h.shape[1])
    rows = conditions.rows(motion.samples.checked, around.changes, columns)
    padded = np.pad(step, ((1, 1), (0, 0)))
    near = np.concatenate([padded[:-2], step, padded[2:]], axis=1)
    along = np.einsum("kcd,kd->kc", rows, near)
    scale = max(np.abs(change).max(), 1.0)
    # Distances of hulls to a sphere have slopes of their own accuracy.
    allowed = 1e-3 if name == "clearance" else DIFFERENCE
    np.testing.assert_allclose(along, change, atol=allowed * scale)
    prices = np.random.default_rng(3).uniform(size=motion.h.shape)
    by = conditions.pulled(motion.samples.checked, prices)
    pulled = motion.charts.pulled(motion.place, by[:, 0], by[:, 1])
    expected = float(np.sum(prices * change))
    assert float(np.sum(pulled * step)) == pytest.approx(expected, abs=allowed * scale * 100)


def test_columns_are_those_of_all(panda: sm.RobotModel) -> None:
    motion = motion_with(panda, "two")
    around = around_of(motion)
    rows = motion.grid.conditions.rows
    checked = motion.samples.checked
    every = rows(checked, around.changes, np.arange(motion.h.shape[1]))
    some = np.array([3, 17, 40, 55])
    np.testing.assert_array_equal(rows(checked, around.changes, some), every[:, some])


def test_orders_are_those_of_what_is_limited(panda: sm.RobotModel) -> None:
    motion = motion_with(panda, "rates")
    orders = motion.grid.conditions.orders(motion.samples.checked)
    assert orders.tolist() == 2 * (14 * [1] + 14 * [2] + 14 * [3])
    motion = motion_with(panda, "a band")
    assert set(motion.grid.conditions.orders(motion.samples.checked)) == {0}


def test_between_nodes_a_limit_counts_as_well(panda: sm.RobotModel) -> None:
    """Conditions of the middles are of the spline there, and none follows the last node."""
    motion = motion_with(panda, "rates")
    half = motion.h.shape[1] // 2
    assert (motion.h[-1, half:] < -100.0).all()
    middle = np.einsum("ka,kan->kn", motion.grid.spline.between[1], motion.samples.ends)
    limits = panda.velocity_limit.clip(max=1.0)
    expected = middle / limits - 1.0 + 2e-3
    np.testing.assert_allclose(motion.h[:-1, half : half + 7], expected, atol=1e-12)


def test_what_is_between_two_nodes_says_how_fast_the_motion_is_at_most() -> None:
    """Of the spline's q̇, a parabola on each interval: the bound is attained where that is flat."""
    rng = np.random.default_rng(3)
    spline = Hermite(np.cumsum(rng.uniform(0.1, 1.0, 9)))
    q, qd = rng.normal(size=(2, 9, 3))
    ends = np.stack([q[:-1], qd[:-1], q[1:], qd[1:]], axis=1)
    control = np.einsum("ka,kan->kn", spline.between[1], ends)
    most = np.maximum(np.maximum(qd[:-1], qd[1:]), control)
    fine = np.linspace(0.0, 1.0, 101)
    for k, h in enumerate(spline.steps):
        known = CubicHermiteSpline([0.0, h], q[k : k + 2], qd[k : k + 2])
        rates = known(h * fine, 1)
        assert (rates <= most[k] + 1e-12).all()
        bent = (1 - fine) ** 2 * qd[k, :1] + 2 * fine * (1 - fine) * control[k, :1]
        np.testing.assert_allclose(rates[:, 0], bent + fine**2 * qd[k + 1, :1], atol=1e-9)

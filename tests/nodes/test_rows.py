"""Rows of limits at control points, of others at points, and how they change with the nodes."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.motion import Trajectory
from selfmotion.model.robot import ToolRates
from selfmotion.planning.nodes import (
    by_kind,
    carried,
    conservatism,
    minimise,
    on_grid,
    subdivisions,
)
from selfmotion.planning.nodes.limit_rows import ControlPointRows
from selfmotion.planning.nodes.node_matrix import NodeMatrix
from selfmotion.planning.nodes.rows import sampled_curve
from selfmotion.planning.nodes.spline import AT_CONTROLS, ORDERS, Quintic, control_times, unit_bases
from selfmotion.problem.constraints import separate_clearances
from support.arms import PANDA_HOME
from support.circles import small_circle
from support.nodes import along, around_of, centred, moved, nodes_of, problem_of, random_step

NEAR, DIFFERENCE = 1e-5, 1e-6

CONSTRAINTS = {
    "positions": lambda: [sm.constraints.JointPositionLimits()],
    "rates": lambda: [
        sm.constraints.JointVelocityLimits(1.0),
        sm.constraints.JointAccelerationLimits(2.0),
        sm.constraints.JointJerkLimits(20.0),
    ],
    "a band": lambda: [sm.constraints.Band.of_elbow("up")],
    "tool": lambda: [sm.constraints.ToolLimits(acceleration=1.0)],
    "two": lambda: [
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointAccelerationLimits(2.0),
    ],
    "clearance": lambda: [
        sm.constraints.JointPositionLimits(),
        sm.constraints.Clearance(
            [sm.obstacles.Sphere("ball", (0.6, 0.35, 0.4), 0.1)], distance=0.02
        ),
    ],
}


def motion_with(panda: sm.RobotModel, name: str):
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    others, apart = separate_clearances(CONSTRAINTS[name](), None)
    problem = sm.Problem(
        *(panda, path, "position", PANDA_HOME), constraints=others, rest=False, clearance=apart
    )
    motion = nodes_of(problem, 10)
    return centred(moved(motion, random_step(motion, 1, 0.02)))


@pytest.mark.parametrize("name", CONSTRAINTS)
def test_rows_and_pullbacks_are_central_differences(panda: sm.RobotModel, name: str) -> None:
    motion = motion_with(panda, name)
    step, rows = random_step(motion, 2) * motion.grid.scale, motion.grid.rows
    above, below = (moved(motion, sign * NEAR * step).h for sign in (1.0, -1.0))
    # Control points that two intervals share are asked for once.
    kept = motion.h > -500.0
    change = ((above - below) / (2 * NEAR))[kept]
    changes = along(motion, around_of(motion).changes, step)
    linear = rows.linearised(lambda: motion.checked, kept)
    scale = max(np.abs(change).max(), 1.0)
    # Distances of hulls to a sphere have slopes of their own accuracy.
    allowed = 1e-3 if name == "clearance" else DIFFERENCE
    np.testing.assert_allclose(linear.along(changes), change, atol=allowed * scale)
    multipliers = np.zeros(len(kept))
    multipliers[kept] = np.random.default_rng(3).uniform(size=kept.sum())
    pulled = float(np.sum(linear.pulled(multipliers) * changes))
    expected = float(multipliers[kept] @ change)
    assert pulled == pytest.approx(expected, abs=allowed * scale * kept.sum())
    # Those that do not count have no say.
    few = kept & (np.arange(len(kept)) % 3 == 0)
    some = rows.linearised(lambda: motion.checked, few).along(changes)
    np.testing.assert_allclose(some, linear.along(changes)[few[kept]], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", CONSTRAINTS)
def test_squares_of_rows_are_the_sums_of_their_products(panda: sm.RobotModel, name: str) -> None:
    motion = motion_with(panda, name)
    step, kept = random_step(motion, 2), motion.h > -500.0
    around = around_of(motion)
    by = motion.grid.spline.changes(around.changes)
    linear = motion.grid.rows.linearised(lambda: motion.checked, kept)
    weights = np.zeros(len(kept))
    weights[kept] = np.random.default_rng(4).uniform(size=kept.sum())
    matrix = NodeMatrix.zeros(*around.curvature.shape[:2])
    linear.add_squared(matrix, by, weights)
    found = float(step.ravel() @ matrix.banded().dense() @ step.ravel())
    changes = along(motion, around.changes, step)
    expected = float(weights[kept] @ linear.along(changes) ** 2)
    assert found == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("order", range(ORDERS))
def test_control_points_bound_the_curve(order: int) -> None:
    """What they keep, the whole curve keeps; at both ends they are the curve."""
    rng = np.random.default_rng(order)
    spline = Quintic(np.cumsum(rng.uniform(0.1, 1.0, 9)))
    ends = spline.ends(rng.normal(size=(9, 3, 5)))
    control = spline.at(AT_CONTROLS, order, ends)
    curve = spline.at(unit_bases(np.linspace(0.0, 1.0, 201)), order, ends)
    rounding = 1e-12 * np.abs(control).max()
    assert (curve.max(axis=1) <= control.max(axis=1) + rounding).all()
    assert (curve.min(axis=1) >= control.min(axis=1) - rounding).all()
    np.testing.assert_allclose(curve[:, [0, -1]], control[:, [0, -1]], atol=rounding)
    # Not of the middle ones alone: the law says something.
    assert (curve.max(axis=1) > control[:, 1:-1].max(axis=1)).any()


def test_the_pieces_are_those_of_the_trajectory(panda: sm.RobotModel) -> None:
    """What is optimised is what the certificate judges."""
    motion = motion_with(panda, "two")
    t = motion.grid.spline.sampling.t
    for order, values in enumerate(
        (motion.sampled.arm.q, motion.sampled.arm.qd, motion.sampled.arm.qdd)
    ):
        expected = motion.trajectory(t, order)
        np.testing.assert_allclose(values, expected, atol=1e-9 * np.abs(expected).max())


def test_prices_are_carried_to_other_nodes_by_density(panda: sm.RobotModel) -> None:
    """Each row's price is that of the nearest one; what they add up to stays about the same."""
    motion = motion_with(panda, "tool")
    limits = motion_with(panda, "rates")
    for one in (motion, limits):
        finer = on_grid(one, one.grid.on(np.sort(np.append(one.grid.t, one.grid.t[:-1] + 0.2))))
        assert finer is not None
        multipliers = np.where(one.h > -500.0, 1.0, 0.0)
        known = carried(finer.grid.rows, one.grid.rows, multipliers)
        assert known.shape == finer.h.shape
        known[finer.h <= -500.0] = 0.0
        # Of each kind of row, per time.
        parts = (
            rows.split(each)
            for rows, each in ((finer.grid.rows, known), (one.grid.rows, multipliers))
        )
        for mine, theirs in zip(*parts, strict=True):
            assert mine.sum() == pytest.approx(theirs.sum(), rel=0.25)


@pytest.mark.parametrize("name", ["rates", "positions", "two"])
def test_limits_are_those_of_the_control_points_each_once(panda: sm.RobotModel, name: str) -> None:
    """Of q, q̇ and q̈ two intervals share one; the last one of the motion belongs to its own."""
    motion = motion_with(panda, name)
    rows, spline = motion.grid.rows, motion.grid.spline
    for own, h in zip(rows.limits, by_kind(rows, motion.h)[0], strict=True):
        item = own.item
        x = spline.at(AT_CONTROLS, item.order, motion.curve_ends)[:, :, own.joints]
        sides = np.stack([x - item.upper, item.lower - x], axis=2) / item.scale
        expected = sides + item.margin - item.granted
        shared = np.zeros(expected.shape, dtype=bool)
        if item.order < 3:
            shared[:-1, -1] = True
        np.testing.assert_allclose(h[~shared], expected[~shared], rtol=1e-9, atol=1e-12)
        assert (h[shared] < -500.0).all()
        # Active are all of a joint and side, one of which is near.
        near = by_kind(rows, rows.near(motion.h))[0][rows.limits.index(own)]
        column = np.where(shared, -np.inf, h).max(axis=(0, 1)) > -0.3
        np.testing.assert_array_equal(near, column & ~shared)


@pytest.mark.parametrize("name", ["rates", "positions", "tool"])
def test_prices_carried_to_the_same_nodes_are_the_same(panda: sm.RobotModel, name: str) -> None:
    motion = motion_with(panda, name)
    prices = np.random.default_rng(0).uniform(size=len(motion.h))
    # Control points that two intervals share are asked for once.
    once = motion.h > -500.0
    prices[~once] = 0.0
    known = carried(motion.grid.rows, motion.grid.rows, prices)
    np.testing.assert_allclose(known[once], prices[once], rtol=1e-12)


def test_intervals_are_divided_where_something_is_beyond_between_points(
    panda: sm.RobotModel,
) -> None:
    """And nowhere else; the more, the farther beyond it is."""
    free = sm.plan(small_circle(panda, task="position"))
    rates = ToolRates(panda.chain)

    def turn_rates(motion: Trajectory, t: np.ndarray) -> np.ndarray:
        velocity, _ = rates(motion(t), motion(t, 1), motion(t, 2))
        return np.linalg.norm(velocity[:, 3:], axis=1)

    whole = np.linspace(0.0, free.path.duration, 2001)
    limit = 0.7 * float(turn_rates(free.trajectory, whole).max())
    asked = sm.constraints.ToolLimits(turn_rate=limit)
    motion = nodes_of(small_circle(panda, task="position", constraints=[asked]))
    parts = subdivisions(motion)
    t = motion.grid.t
    looks = np.linspace(t[:-1], t[1:], 8, endpoint=False, axis=1)
    most = turn_rates(motion.trajectory, looks.ravel()).reshape(looks.shape).max(axis=1)
    assert (most > 1.02 * limit).any()
    assert (most < 0.98 * limit).any()
    assert (parts[most > 1.02 * limit] == parts.max()).all()
    assert (parts[most < 0.98 * limit] == 1).all()


@pytest.mark.parametrize("name", ["tool", "a band", "clearance"])
def test_what_is_of_accelerations_looks_twice_as_often(panda: sm.RobotModel, name: str) -> None:
    spline = motion_with(panda, name).grid.spline
    each = (len(spline.points.t) - 1) / spline.count
    assert each == {"tool": 4.0}.get(name, 2.0)
    # Of speeds of the tool alone nothing is of accelerations.
    (speed,) = sm.constraints.ToolLimits(speed=1.0).conditions(panda).points
    assert not speed.uses_accelerations(panda.dof)


def test_rows_of_a_vector_bend_as_squares_do(panda: sm.RobotModel) -> None:
    """The curvature that Newton's method is told of a cone, by differences of its slope."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    tilt = sm.constraints.Tilt("panda_hand_tcp", within=0.3)
    problem = sm.Problem(
        *(panda, path, "position", PANDA_HOME), constraints=[tilt], rest=False, clearance=None
    )
    motion = nodes_of(problem, 6)
    bound = next(item for item in motion.grid.conditions.points if item.name.startswith("tilt"))
    checked = motion.checked.arm
    slopes = bound.squares(checked)
    assert slopes.shape == (len(checked.q), 3, 7)
    way = np.random.default_rng(0).normal(size=7)

    def h(share: float) -> Array:
        q = checked.q + share * way
        away = bound.quantity.away(q, 0.0 * q, 0.0 * q)[:, 0]
        linear = bound.quantity.away(checked.q, 0.0 * q, 0.0 * q)[:, 0]
        turned = linear + share * slopes @ way * bound.quantity.bounds[0] / np.sqrt(2.0)
        assert np.abs(away - turned).max() <= 10.0 * share**2
        return np.asarray((turned**2).sum(axis=1)) / bound.quantity.bounds[0] ** 2

    bends = (h(1e-3) + h(-1e-3) - 2.0 * h(0.0)) / 1e-6
    np.testing.assert_allclose(bends, ((slopes @ way) ** 2).sum(axis=1), rtol=1e-6)
    # Of numbers there is nothing of that.
    (limits,) = sm.constraints.Band.of_elbow("up").conditions(panda).points
    assert limits.squares(checked) is None


def test_limits_are_told_as_used_where_the_curve_uses_them(panda: sm.RobotModel) -> None:
    """Not where only a control point is near: in shares of what each limit is."""
    motion = motion_with(panda, "positions")
    q, times = motion.trajectory, control_times(motion.grid.spline, 0)
    once = np.unique(times)
    lower, upper = panda.finite_limits()
    # As near to a limit as the curve comes, and as far as it is half of that.
    highest = float(q(once)[:, 3].max())
    upper[3] = highest + 1e-4
    limits = sm.constraints.JointPositionLimits(lower, upper)
    (bound,) = limits.conditions(panda).limits
    rows = ControlPointRows(motion.grid.spline, bound, 0)
    found = rows.multipliers_of(np.ones(rows.shape), motion.curve_ends)
    used = found.used.reshape(len(found.times), 2, -1)
    joint = list(bound.joints).index(3)
    expected = q(found.times)[:, 3] - upper[3] > -0.005
    assert 0 < expected.sum() < len(expected)
    np.testing.assert_array_equal(used[:, 0, joint], expected)
    assert not used[:, 1, joint].any()


@pytest.mark.parametrize("name", ["rates", "tool", "clearance"])
def test_half_of_each_tolerance_is_in_reserve(panda: sm.RobotModel, name: str) -> None:
    rows = motion_with(panda, name).grid.rows
    each = [np.full(place.stop - place.start, family.item.tolerance)
            for family, (place, _) in zip(rows.families, rows._places, strict=True)]  # fmt: skip
    np.testing.assert_allclose(2.0 * rows.granted, np.concatenate(each))


def test_the_curve_between_nodes_is_looked_at_when_it_is_there(panda: sm.RobotModel) -> None:
    motion = motion_with(panda, "tool")
    grid = motion.grid
    curve = sampled_curve(grid.formulation, grid.spline, motion.curve_ends).arm
    times = curve.sampling.t
    assert len(times) > 3 * grid.spline.count
    assert (np.diff(times) >= 0.0).all()
    assert times[0] >= 0.0
    assert times[-1] <= grid.t[-1]
    for order, values in enumerate((curve.q, curve.qd, curve.qdd)):
        expected = motion.trajectory(times, order)
        # At a node the jerk jumps, nothing below it does.
        np.testing.assert_allclose(values, expected, atol=1e-9 * np.abs(expected).max())


def test_finer_nodes_lose_less_to_control_points(panda: sm.RobotModel) -> None:
    """Limits of control points cost nothing where none binds, and little of fine nodes."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))

    def optimum(limit: float, count: int) -> tuple[float, float]:
        slow = sm.constraints.JointVelocityLimits(limit)
        case = panda, "pose", PANDA_HOME, path
        found = minimise(nodes_of(problem_of(case, constraints=[slow]), count), lambda step: False)
        motion = found.motion
        bound = conservatism(motion.grid.rows, found.multipliers, motion.curve_ends)
        assert (bound >= 0.0).all()
        return motion.cost, float(bound.sum())

    _, nothing = optimum(10.0, 12)
    (coarse, lost), (fine, less) = (optimum(1.25, count) for count in (12, 48))
    assert nothing <= 1e-9 * coarse
    assert lost > 1e-3 * coarse
    assert less < 0.1 * lost
    assert fine < coarse

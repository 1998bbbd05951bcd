"""A motion of nodes: what is let go of is the same when it is asked for again."""

from itertools import pairwise

import numpy as np

import selfmotion as sm
from selfmotion.basics import Counts
from selfmotion.planning.formulation import BoundConditions, Formulation, path_errors
from selfmotion.planning.nodes import NodeGrid, breaks_hard, broken_intervals, forget
from selfmotion.planning.nodes.local_model import LocalModel
from selfmotion.planning.nodes.motion import hermite_accelerations, moved_along, stepped
from selfmotion.planning.nodes.spline import AT_CONTROLS
from support.arms import PANDA_HOME, Case
from support.nodes import around_of, nodes_of, problem_of
from support.stretching import DURATION, rounded_problem, stretching

# The arm moves at a steady speed [rad/s²].
CALM = 0.1
# A step along the self-motion [rad], and what the curve may miss the path by between few nodes [m].
FAR, ON_PATH = 0.1, 1e-3


def test_what_is_forgotten_is_the_same_again(case: Case) -> None:
    limits = (
        sm.constraints.JointPositionLimits(-9.0, 9.0),
        sm.constraints.JointAccelerationLimits(50.0),
    )
    motion = nodes_of(problem_of(case, constraints=limits))

    def known() -> list[np.ndarray]:
        return [
            motion.h,
            motion.checked.arm.qdd,
            motion.sampled.arm.qddd,
            motion.curve_ends,
            np.array([motion.cost, motion.objective, motion.violation]),
            broken_intervals(motion),
        ]

    before = known()
    forget(motion)
    assert not {*motion.__dict__} & {"h", "partials", "checked", "samples", "curve_ends"}
    for again, once in zip(known(), before, strict=True):
        np.testing.assert_array_equal(again, once)


def test_beside_a_singular_pose_rounding_of_the_path_does_not_accelerate_the_arm() -> None:
    problem = rounded_problem()
    t = np.linspace(0.0, DURATION, 65)
    # At the pose itself nothing may come onto the path.
    t[32] += 0.3 * (t[33] - t[32])
    formulation = Formulation.of(problem)
    grid = NodeGrid(formulation, t, BoundConditions(), free=True, counts=Counts())
    q = stretching(t)

    motion = grid.near(q, np.gradient(q, t, axis=0))
    assert motion is not None
    assert np.abs(motion.trajectory.qdd).max() < CALM
    assert path_errors(formulation, motion.trajectory).max() < 1e-6


def in_span(vectors: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the multiples (K, 1) of vectors (K, n) that are nearest to values (K, n)."""
    return ((vectors * values).sum(axis=1) / (vectors**2).sum(axis=1))[:, None]


def linear_and_real_jerks(panda: sm.RobotModel, count: int) -> tuple[np.ndarray, ...]:
    """Return control points of the jerk by linear rows, and those of both kinds of steps."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.1, 4.0, normal=(1.0, 0.0, 0.0))
    problem = sm.Problem(panda, path, "pose", PANDA_HOME, constraints=(), rest=False)
    motion = nodes_of(problem, count)
    grid, place = motion.grid, motion.place
    around = LocalModel.of(
        motion.charts, motion.nu, motion.alpha, place, np.zeros_like(place.nodes), grid.scale
    )
    assert around is not None
    changes = around.changes
    # The self-motion swings to and fro, with the rates that this has to first order.
    z = FAR * np.sin(np.pi * grid.t / path.duration)[:, None] ** 2
    rates = grid.spline.differences(np.einsum("knd,kd->kn", changes[:, 0, :, :1], z))
    nu = in_span(changes[:, 1, :, 1], rates[0] - changes[:, 1, :, 0] * z)
    bent = changes[:, 2, :, 0] * z + changes[:, 2, :, 1] * nu
    alpha = in_span(changes[:, 2, :, 2], rates[1] - bent)
    step = np.hstack([z, nu, alpha])
    moved = np.einsum("kond,kd->kon", changes, step)

    def jerks(nodes: np.ndarray) -> np.ndarray:
        return grid.spline.at(AT_CONTROLS, 3, grid.spline.ends(nodes))

    found = moved_along(motion, step, changes), stepped(motion, step)
    assert found[0] is not None
    assert found[1] is not None
    assert path_errors(grid.formulation, found[0].trajectory).max() < ON_PATH
    return jerks(place.nodes + moved), *(jerks(one.place.nodes) for one in found)


def test_a_step_moves_the_curve_as_linear_rows_say(panda: sm.RobotModel) -> None:
    """However near to each other the nodes are; where their rates are their own, it does not."""
    off = []
    for count in (20, 160):
        linear, along, alone = linear_and_real_jerks(panda, count)
        off.append([np.abs(x - linear).max() for x in (along, alone)])
    (few, few_alone), (many, many_alone) = off
    assert many <= 1.5 * few
    assert many_alone >= 5.0 * few_alone
    assert many <= 0.05 * many_alone


def test_accelerations_of_cubics_are_exact(panda: sm.RobotModel) -> None:
    """Whatever the lengths of intervals: means of the Hermite cubics on both sides."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    grid = nodes_of(problem_of((panda, "pose", PANDA_HOME, path))).grid
    grid = grid.on(np.array([0.0, 0.3, 1.3, 1.5, 2.9, 4.0]))
    powers = np.random.default_rng(0).normal(size=(4, 7))
    cubic = np.polynomial.Polynomial
    q, qd, qdd = (
        np.stack([cubic(powers[:, k]).deriv(order)(grid.t) if order else cubic(powers[:, k])(grid.t)
                  for k in range(7)], axis=1)
        for order in range(3)
    )  # fmt: skip
    np.testing.assert_allclose(hermite_accelerations(grid.spline, len(q), q, qd), qdd, atol=1e-9)


def test_rates_of_nodes_change_by_what_a_step_says(panda: sm.RobotModel) -> None:
    """q̇ by N0 Δν where the node stays; q̈ by N0 Δα where its rates stay as well."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    motion = nodes_of(problem_of((panda, "position", PANDA_HOME, path)))
    r, rng = motion.nu.shape[1], np.random.default_rng(0)
    for order, (before, name) in enumerate(
        ((motion.place.qd, "qd"), (motion.place.qdd, "qdd")), start=1
    ):
        step = np.zeros((len(motion.nu), 3 * r))
        change = rng.normal(size=(len(step), r))
        step[:, order * r : (order + 1) * r] = change / motion.grid.scale[order * r]
        found = stepped(motion, step)
        assert found is not None
        np.testing.assert_allclose(found.place.q, motion.place.q, atol=1e-9)
        expected = before + motion.charts.spread(change)
        np.testing.assert_allclose(getattr(found.place, name), expected, atol=1e-8)


def test_bases_turn_as_little_as_possible_from_node_to_node(panda: sm.RobotModel) -> None:
    """Each basis is the nearest rotation to the one before: products are symmetric, above 0."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    motion = nodes_of(problem_of((panda, "position", PANDA_HOME, path)), 12)
    manifolds = motion.grid.manifolds
    bases = manifolds._bases(motion.place.q)
    for before, after in pairwise(bases):
        product = after.T @ before
        np.testing.assert_allclose(product, product.T, atol=1e-9)
        assert np.linalg.eigvalsh(product).min() > 0.0
    # They are bases of the null spaces.
    for basis, q in zip(bases, motion.place.q, strict=True):
        np.testing.assert_allclose(basis.T @ basis, np.eye(basis.shape[1]), atol=1e-9)
        assert np.abs(manifolds.follows.jacobian(q) @ basis).max() < 1e-9


def test_an_arm_that_rests_accelerates_where_its_path_does(panda: sm.RobotModel) -> None:
    """At the ends of a path whose speed begins with a corner only the velocity is held."""
    first, seconds = panda.pose(PANDA_HOME), 2.0
    along = np.array([0.0, 0.2, 0.0, 0.0, 0.0, 0.0])
    path = sm.paths.TwistPath(first, lambda t: t * (seconds - t) * along, seconds)
    motion = nodes_of(problem_of((panda, "pose", PANDA_HOME, path), rest=True))
    assert motion.grid.formulation.problem.rest_orders == (1, 1)
    r = motion.nu.shape[1]
    held = set(motion.grid.held.tolist())
    for node in (0, len(motion.nu) - 1):
        assert 3 * r * node + r in held
        assert 3 * r * node + 2 * r not in held
        np.testing.assert_allclose(motion.place.qd[node], 0.0, atol=1e-12)
        tool = panda.jacobian(motion.place.q[node]) @ motion.place.qdd[node]
        np.testing.assert_allclose(np.abs(tool), seconds * along, atol=1e-6)
    # So it is where rates are given anew.
    again = motion.grid.around(motion.charts, motion.place.qd + 1.0, motion.place.qdd)
    assert again is not None
    np.testing.assert_allclose(again.place.qd[[0, -1]], 0.0, atol=1e-12)


def test_joints_that_stand_still_for_a_while_have_no_coordinates_then(panda: sm.RobotModel) -> None:
    """What is not held moves none of them, and of each order one is held for each."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    window = sm.Relaxation("rz", 0.1, during=(1.0, 3.0))
    motion = nodes_of(
        problem_of((panda, "pose", PANDA_HOME, path), relaxations=[window]), free=True
    )
    grid, still = motion.grid, motion.grid.manifolds.held
    assert 0 < still.sum() < len(still)
    held = np.zeros((len(still), 3 * motion.nu.shape[1]), dtype=bool)
    held.reshape(-1)[grid.held] = True
    np.testing.assert_array_equal(held.sum(axis=1), 3 * still.sum(axis=1))
    changes = around_of(motion).changes
    for node, joint in np.argwhere(still).tolist():
        assert not changes[node, :, joint][:, ~held[node]].any()
    np.testing.assert_array_equal(grid.rested(np.ones(still.shape), 1), ~still)


def test_a_step_of_each_coordinate_counts_as_much_as_the_others(panda: sm.RobotModel) -> None:
    """In a usual interval a rate changes an angle as much as the coordinate that stands for it."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    motion = nodes_of(problem_of((panda, "pose", PANDA_HOME, path)), 10)
    np.testing.assert_allclose(motion.grid.scale * 0.4 ** np.arange(3.0), 1.0, rtol=1e-12)


def test_limits_are_broken_by_what_lies_beyond_them(panda: sm.RobotModel) -> None:
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    case = panda, "pose", PANDA_HOME, path
    wide, tight = (
        nodes_of(problem_of(case, constraints=(sm.constraints.JointVelocityLimits(most),)))
        for most in (10.0, 0.01)
    )
    assert not breaks_hard(wide)
    assert breaks_hard(tight)
    assert not breaks_hard(tight, tight.violation)

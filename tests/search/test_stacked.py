"""Motions that keep limits and quantities as rows of their task follow the path, and keep them."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.follow import Coordinates
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.search import Stacked, metrics, start_candidates
from selfmotion.problem.problem import envelope_of_problem
from support.arms import robot_named
from support.cones import UPRIGHT, downhand

# Rows bind before their limits: a quantity keeps these as shares.
WITHIN = 1.0
# And a joint may be beyond its limit by this [rad].
MET = 0.02
# What is put onto the path is there to this [m, rad].
ON_PATH = 1e-9
# Of steps whose equations are damped.
DAMPED = 1e-3


def carried(problem: sm.Problem, weights: Array, places: int = 49) -> tuple[Array, Array]:
    """Return times (N,) and motions (K, N, n) from drawn starts that went all the way."""
    formulation = Formulation.of(problem)
    t, envelope = np.linspace(0.0, problem.path.duration, places), formulation.envelope
    limits = envelope.lower, envelope.upper
    task = Stacked(formulation.follows, envelope.quantities, *limits, weights)
    starts = start_candidates(formulation.follows, 16, np.random.default_rng(0))
    q, kept = task.placed(np.array(starts), 0.0)
    motions, arrived = task.carried(q[kept], t)
    return t, motions[arrived]


def misses(problem: sm.Problem, t: Array, q: Array) -> float:
    items = Formulation.of(problem).follows.items
    pairs = zip(t, q, strict=True)
    return max(max(item.miss(item.path.pose(s), x)) for item in items for s, x in pairs)


@pytest.mark.parametrize("lean", [0.3, 0.7])
def test_the_torch_stays_upright_and_the_table_turns(lean: float) -> None:
    problem = downhand(lean)
    t, motions = carried(problem, np.ones(8))
    assert len(motions) > 1
    turn = problem.robot.joint_names.index("table/turn")
    (tilt,) = envelope_of_problem(problem).quantities
    for motion in motions:
        assert misses(problem, t, motion) <= ON_PATH
        still = np.zeros_like(motion)
        sizes = np.linalg.norm(tilt.away(motion, still, still), axis=2)
        assert sizes.max() <= WITHIN * tilt.bounds[0]
        assert np.ptp(motion[:, turn]) > 1.8 * np.pi


def test_without_rows_it_leans() -> None:
    """The law above rejects what a motion without self-motion does."""
    problem = downhand(0.7)
    free = dataclasses.replace(
        problem, constraints=[item for item in problem.constraints if item is not UPRIGHT]
    )
    _, motions = carried(free, np.ones(8))
    (tilt,) = envelope_of_problem(problem).quantities
    for motion in motions:
        still = np.zeros_like(motion)
        assert np.linalg.norm(tilt.away(motion, still, still), axis=2).max() > tilt.bounds[0]


def test_what_is_heavy_moves_less() -> None:
    cell = sm.load_robot(
        {"arm": "panda", "table": "positioner"},
        base={"table": pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0]))},
        tool="arm/panda_hand_tcp",
        reference="table/plate",
    )
    first = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.1, 0.0, 0.03]))
    ring = sm.paths.Circle.around(first, radius=0.1, duration=12.0, normal=(0, 0, 1))
    problem = sm.Problem(cell, ring, task="pointing", clearance=None)
    usual, arm, table, *alone = metrics(Coordinates.of(cell))
    assert [np.flatnonzero(weights > usual).tolist() for weights in (arm, table, *alone)] == [
        [0, 1, 2, 3, 4, 5, 6],
        [7, 8],
        [7],
        [8],
    ]
    moved = {
        name: np.median([np.ptp(q, axis=0) for q in carried(problem, weights)[1]], axis=0)
        for name, weights in (("arm", arm), ("table", table))
    }
    assert moved["arm"][:7].max() < 0.5 * moved["table"][:7].max()
    assert moved["table"][8] < 0.5 * moved["arm"][8]


def test_an_arm_without_parts_has_one_metric() -> None:
    assert len(metrics(Coordinates.of(robot_named("panda")))) == 1
    # Of one on a lift, the lift and the arm are parts.
    lift = robot_named("tiago")
    assert len(metrics(Coordinates.of(lift))) == 3


def test_a_joint_stops_at_its_limit() -> None:
    panda = robot_named("panda")
    home = np.array(sm.NAMED_ARMS["panda"].home)
    path = sm.paths.Circle.around(panda.pose(home), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    free = sm.Problem(panda, path, "pose", home, constraints=(), clearance=None)
    t = np.linspace(0.0, 4.0, 33)

    def motion(upper: Array) -> Array:
        task = Stacked(free.follows, (), panda.lower, upper, np.ones(7))
        found, arrived = task.carried(home[None], t)
        assert arrived.all()
        return found[0]

    before, upper = motion(panda.upper)[:, 0], panda.upper.copy()
    upper[0] = home[0]
    assert before.max() > upper[0] + 2.0 * MET
    after = motion(upper)
    assert misses(free, t, after) <= ON_PATH
    assert after[:, 0].max() <= upper[0] + MET


def test_rows_that_do_not_bind_have_no_part_in_a_step() -> None:
    """Far from all limits a step is that of the task alone, the shortest by the weights."""
    robot = robot_named("panda")
    q = np.array(sm.NAMED_ARMS["panda"].home)[None]
    problem = sm.Problem(robot, sm.paths.Dwell(robot.pose(q[0]), 1.0), "position", start=q[0])
    follows, weights = Formulation.of(problem).follows, np.linspace(0.5, 2.0, 7)
    wide = q[0] - 2.0, q[0] + 2.0
    along = np.array([0.01, -0.02, 0.03])
    step = Stacked(follows, (), *wide, weights)._step(q, along)[0]
    jacobian = follows.jacobian(q[0])
    light = np.diag(1.0 / weights)
    expected = light @ jacobian.T @ np.linalg.solve(jacobian @ light @ jacobian.T, along)
    np.testing.assert_allclose(step, expected, atol=DAMPED * np.abs(expected).max())


def test_each_part_is_heavy_in_turn_and_others_are_as_usual() -> None:
    """So is each joint of a part of few."""
    robot = downhand(0.3).robot
    coordinates = Coordinates.of(robot)
    usual, *heavy = metrics(coordinates)
    np.testing.assert_allclose(usual, np.asarray(coordinates.weights) ** 2)
    assert len(heavy) > 2
    for weights in heavy:
        ratios = weights / usual
        assert set(np.unique(ratios.round(9))) == {1.0, ratios.max().round(9)}
        assert ratios.max() > 10.0

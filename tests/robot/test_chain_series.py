"""Majorants of simple chains are what the derivation says, coefficient by coefficient."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array, series
from selfmotion.model.robot import ChainSeries, ToolRates
from support.arms import robot_named
from support.circles import small_circle
from support.gantries import gantry

HALF = np.array([0.1, 0.7])


def random_joints(robot: sm.RobotModel) -> Array:
    return np.random.default_rng(0).random((robot.dof, series.LENGTH, 2))


def same(found: Array, expected: Array) -> None:
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-15)


def test_a_planar_arm_is_bounded_link_by_link() -> None:
    """Each link is as long as it is, times the exponential of the turns before it."""
    robot = robot_named("planar_3r")
    q = random_joints(robot)
    chain = ChainSeries(robot, q, HALF)
    tip, base = robot.chain.tip, np.zeros((series.LENGTH, 2))
    turns = [
        series.exponential(base),
        *(series.exponential(q[: k + 1].sum(axis=0)) for k in range(3)),
    ]
    model = robot.model
    links = [float(np.linalg.norm(x.translation)) for x in list(model.jointPlacements)[1:]]
    last = float(np.linalg.norm(model.frames[tip].placement.translation))
    places = [base]
    for k, length in enumerate(links):
        places.append(places[-1] + length * turns[k])
    for k in range(4):
        same(chain.turned[k], turns[k])
        same(chain.places[k], places[k])
    same(chain.place(tip), places[3] + last * turns[3])
    same(chain.orientation(tip), turns[3])
    spin = sum(series.product(series.derivative(q[k], HALF), turns[k]) for k in range(3))
    same(chain.spin(tip), spin)
    same(chain.rate(1), series.derivative(q[1], HALF))
    assert [chain.parent(joint) for joint in range(3)] == [0, 1, 2]
    assert all(chain.is_revolute(joint) for joint in range(3))
    place, turned = chain.relative(robot.chain)
    same(place, chain.place(tip))
    same(turned, chain.orientation(tip))
    same(chain.relative_spin(robot.chain), spin)


def test_slides_are_bounded_by_where_they_are(tmp_path: Path) -> None:
    robot = gantry(tmp_path)
    q = random_joints(robot)
    chain = ChainSeries(robot, q, HALF)
    tip = robot.chain.tip
    # No link is long, and nothing turns but the last.
    same(chain.place(tip), q[0] + q[1] + q[2])
    same(chain.orientation(tip), series.exponential(q[3]))
    same(chain.spin(tip), series.derivative(q[3], HALF))
    assert [chain.is_revolute(joint) for joint in range(4)] == [False, False, False, True]


def test_an_arm_may_have_one_joint(tmp_path: Path) -> None:
    robot = gantry(tmp_path, kinds=("prismatic", "fixed", "fixed", "fixed"))
    q = random_joints(robot)
    assert len(q) == 1
    chain, tip = ChainSeries(robot, q, HALF), robot.chain.tip
    same(chain.place(tip), q[0])
    same(chain.orientation(tip), series.exponential(np.zeros_like(q[0])))
    same(chain.spin(tip), np.zeros_like(q[0][1:]))


@pytest.mark.parametrize(("tool", "base"), [("l3", "l0"), ("l2", "l1"), ("l0", "l3")])
def test_between_two_frames_only_the_joints_between_count(
    tool: str, base: str, tmp_path: Path
) -> None:
    robot = gantry(tmp_path)
    q = random_joints(robot)
    chain = ChainSeries(robot, q, HALF)
    seen = robot.chain_to(tool, base)
    first, last = sorted((int(tool[1]), int(base[1])))
    slides = [k for k in range(first + 1, last + 1) if k < 3]
    place, turned = chain.relative(seen)
    turn = q[3] if last == 3 else 0.0 * q[3]
    same(turned, series.exponential(turn))
    # Seen from what turns, places are turned as well.
    by = turned if base == "l3" else series.exponential(0.0 * turn)
    same(place, sum(series.product(q[k], by) for k in slides))
    spin = series.derivative(turn, HALF)
    same(chain.relative_spin(seen), spin)


def test_between_two_links_each_turn_is_turned_by_those_before_it(panda: sm.RobotModel) -> None:
    q = random_joints(panda)
    chain = ChainSeries(panda, q, HALF)
    seen = panda.chain_to("panda_link7", "panda_link4")
    before = [series.exponential(q[4:k].sum(axis=0)) for k in range(4, 8)]
    spin = sum(
        series.product(series.derivative(q[k], HALF), by)
        for k, by in zip(range(4, 7), before, strict=False)
    )
    same(chain.relative_spin(seen), spin)
    same(chain.relative(seen)[1], before[-1])


# The tool's rates are derivatives of its pose.


@pytest.fixture
def free(panda: sm.RobotModel) -> sm.Plan:
    return sm.plan(small_circle(panda, task="position"))


def test_rates_are_derivatives_of_the_pose(panda: sm.RobotModel, free: sm.Plan) -> None:
    motion, h = free.trajectory, 1e-5
    t = np.linspace(0.1, 2.9, 23)
    velocity, acceleration = ToolRates(panda.chain)(motion(t), motion(t, 1), motion(t, 2))

    def world_twist(at: float) -> np.ndarray:
        step = 1e-5
        early, late = (panda.pose(motion(at + d)) for d in (-step, step))
        linear = (late.translation - early.translation) / (2 * step)
        angular = pin.log3(late.rotation @ early.rotation.T) / (2 * step)
        return np.concatenate([linear, angular])

    for k, at in enumerate(t):
        turn = panda.pose(motion(at)).rotation.T
        twist, change = world_twist(at), (world_twist(at + h) - world_twist(at - h)) / (2 * h)
        for part in (slice(0, 3), slice(3, 6)):
            np.testing.assert_allclose(velocity[k, part], turn @ twist[part], atol=1e-8)
            np.testing.assert_allclose(acceleration[k, part], turn @ change[part], atol=1e-4)


def test_derivatives_of_rates_are_differences(panda: sm.RobotModel) -> None:
    """By q, q̇ and q̈, at random states of motion."""
    rates, rng, h = ToolRates(panda.chain), np.random.default_rng(3), 1e-6
    q, qd, qdd = (rng.normal(scale=0.5, size=(4, panda.dof)) for _ in range(3))
    velocity, acceleration = rates.derivatives(q, qd, qdd)

    def differences(which: int, by: int) -> np.ndarray:
        found = np.empty((len(q), 6, panda.dof))
        for j in range(panda.dof):
            ends = []
            for sign in (1.0, -1.0):
                moved = [q.copy(), qd.copy(), qdd.copy()]
                moved[by][:, j] += sign * h
                ends.append(rates(*moved)[which])
            found[:, :, j] = (ends[0] - ends[1]) / (2.0 * h)
        return found

    for which, parts in enumerate((velocity, acceleration)):
        for by, part in enumerate(parts):
            np.testing.assert_allclose(part, differences(which, by), atol=2e-8)

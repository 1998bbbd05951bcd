"""What chains are chosen by: the problem's own costs, against their integrals and brute force."""

import itertools

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.motion import Sampling
from selfmotion.planning.search.chains import best_chains
from selfmotion.planning.search.measures import JointTravel, RunningCost, measure_of
from selfmotion.problem.costs import Samples
from support.arms import robot_named
from support.followed import charging, standing

COSTS = (
    sm.costs.JointVelocity(2.0),
    sm.costs.InverseManipulability(1e-3),
    sm.costs.KineticEnergy(robot_named("panda")),
)


FIXED = np.zeros(7, dtype=bool)


def smooth_motion(count: int) -> tuple[Array, Array, Array]:
    """Return times, q and q̇ of a smooth motion of the Panda."""
    t = np.linspace(0.0, 2.0, count)
    home = np.array(sm.NAMED_ARMS["panda"].home)
    rate = np.linspace(0.5, 1.5, 7)
    return t, home + 0.3 * np.sin(np.outer(t, rate)), 0.3 * rate * np.cos(np.outer(t, rate))


def test_a_chain_costs_what_its_motion_does() -> None:
    robot, task = robot_named("panda"), sm.Task.POSE
    t, q, qd = smooth_motion(801)
    samples = Samples.along(standing(robot, task), Sampling.trapezoidal(t), q, qd)
    integral = sum(float(samples.weights @ cost.value(samples)) for cost in COSTS)
    errors = []
    for stride in (20, 10):
        coarse = RunningCost.of(charging(robot, task, COSTS), t[::stride])
        errors.append(abs(coarse.cost_of(q[::stride]) / integral - 1.0))
    # The energy takes the inertia at the beginning of each step: first order.
    assert errors[1] < 0.6 * errors[0]
    assert errors[1] < 1e-2


def test_faster_steps_count_as_spread_over_the_time_that_they_take() -> None:
    robot, task = robot_named("panda"), sm.Task.POSE
    t = np.array([0.0, 0.1, 0.2])
    q = np.array(sm.NAMED_ARMS["panda"].home)
    jump = np.array([q, q + 0.5, q + 0.5])
    measure = RunningCost.of(charging(robot, task, [sm.costs.JointVelocity()]), t)
    moved = 0.5 * np.sqrt(7.0)
    assert measure.cost_of(jump) == pytest.approx(0.5 * moved**2 / 0.1)
    # At twice the mean speed v: ½v² over |Δq| / v.
    speed = 2.0 * moved / 0.2
    assert measure.with_speed_of(jump).cost_of(jump) == pytest.approx(0.5 * speed * moved)
    # Of three times the duration the mean is a third: the jump lasts longer than its step.
    longer = RunningCost.of(charging(robot, task, [sm.costs.JointVelocity()]), 0.1 * np.arange(4.0))
    jump = np.vstack([jump, jump[-1:]])
    speed = 2.0 * moved / 0.3
    assert longer.with_speed_of(jump).cost_of(jump) == pytest.approx(0.5 * speed * moved)
    # What stands still has no pace.
    assert measure.with_speed_of(jump[1:]).speed == np.inf


def test_the_cheapest_chain_is_that_of_brute_force_and_so_backwards() -> None:
    robot, task = robot_named("panda"), sm.Task.POSE
    rng = np.random.default_rng(0)
    t, q, _ = smooth_motion(5)
    layers = [here + 0.1 * rng.normal(size=(4, 7)) for here in q]
    layers = [layer[np.argsort(layer[:, 0])] for layer in layers]
    step = np.full(7, 0.6)
    measure = RunningCost.of(charging(robot, task, COSTS), t).with_speed_of(q)
    costs = []
    for chain in itertools.product(range(4), repeat=len(layers)):
        motion = np.array([layer[k] for layer, k in zip(layers, chain, strict=True)])
        if np.abs(np.diff(motion, axis=0)).max() <= 0.6:
            costs.append((measure.cost_of(motion), chain))
    best, chain = min(costs)
    forward = best_chains(layers, step, FIXED, measure)
    assert forward.cost[-1].min() == pytest.approx(best)
    assert tuple(forward.back(4, int(np.argmin(forward.cost[-1])))) == chain
    backward = best_chains(layers[::-1], step, FIXED, measure.reversed())
    assert backward.cost[-1].min() == pytest.approx(best)
    # Shorter is another one.
    length = best_chains(layers, step, FIXED, JointTravel(np.ones(7)))
    assert tuple(length.back(4, int(np.argmin(length.cost[-1])))) != chain


def test_lengths_are_measured_as_such_and_accelerations_left_out() -> None:
    robot, task, t = robot_named("panda"), sm.Task.POSE, np.linspace(0.0, 1.0, 5)
    ones = np.ones(7)
    assert isinstance(
        measure_of(charging(robot, task, [sm.costs.PathLength()]), t, ones), JointTravel
    )
    assert isinstance(
        measure_of(charging(robot, task, [sm.costs.JointAcceleration()]), t, ones), JointTravel
    )
    both = measure_of(
        charging(robot, task, [sm.costs.JointVelocity(), sm.costs.JointJerk()]), t, ones
    )
    assert isinstance(both, RunningCost)
    assert [cost.name for cost in (*both.static_costs, *both.kinetic_costs)] == ["joint velocity"]

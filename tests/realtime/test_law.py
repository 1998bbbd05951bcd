"""Commands of one cycle: eq. 4 within limits, which hold for ever, whatever is asked for."""

import numpy as np
import pytest
from scipy.optimize import linprog

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.basics.layout import layout_of
from selfmotion.realtime import law
from selfmotion.realtime.law import (
    braking_distance,
    fastest,
    fastest_on_curve,
    saturated_rates,
    tightened,
    viable_accelerations,
)
from support.arms import PANDA_HOME

# Segments meet in the same numbers, computed in the same way but for one shift of an index.
SAME = 1e-12


def test_rates_are_those_of_eq_4_where_no_bound_is_in_the_way(panda: sm.RobotModel) -> None:
    rng = np.random.default_rng(1)
    for task in ("pose", "position"):
        jacobian = panda.task_jacobian(PANDA_HOME, task)
        u, epsilon = rng.standard_normal(len(jacobian)), rng.standard_normal(7)
        rates, wide = np.empty(7), np.full(7, 1e3)
        assert saturated_rates(jacobian, u, epsilon, -wide, wide, rates)
        inverse = np.linalg.pinv(jacobian)
        expected = inverse @ u + (np.eye(7) - inverse @ jacobian) @ epsilon
        assert rates == pytest.approx(expected, abs=1e-9)


def test_the_self_motion_gives_before_the_tool_does(panda: sm.RobotModel) -> None:
    rng = np.random.default_rng(2)
    jacobian = np.ascontiguousarray(panda.task_jacobian(PANDA_HOME, "position"))
    followed = possible = 0
    for _ in range(200):
        u, epsilon = 0.3 * rng.standard_normal(3), 3.0 * rng.standard_normal(7)
        rates, bound = np.empty(7), rng.uniform(0.3, 1.5, 7)
        follows = saturated_rates(jacobian, u, epsilon, -bound, bound, rates)
        assert np.all(np.abs(rates) <= bound + SAME)
        programme = linprog(
            np.zeros(7), A_eq=jacobian, b_eq=u, bounds=np.stack([-bound, bound], axis=1)
        )
        possible += programme.status == 0
        if follows:
            followed += 1
            assert jacobian @ rates == pytest.approx(u, abs=2e-3)
    # One joint after the other is no search over all sets of joints: a few are not found.
    assert possible > 100
    assert followed >= 0.97 * possible


def random_limits(rng: np.random.Generator, n: int = 7) -> Array:
    lower, upper = -rng.uniform(0.01, 3.0, n), rng.uniform(0.01, 3.0, n)
    rates = rng.uniform(0.1, 3.0, n), rng.uniform(0.5, 20.0, n)
    # Of curves, some much steeper than the joint brakes, and some that are none.
    hard, offset = 10.0 ** rng.uniform(-0.3, 2.0, n), rng.uniform(0.0, 0.4, n)
    # They let a joint rest at its limits.
    beyond_rest = offset**2 / (2.0 * hard) + rng.uniform(0.0, 0.1, n)
    beyond_rest[rng.random(n) < 0.2] = np.inf
    curves = hard, offset, lower - beyond_rest, upper + beyond_rest
    return np.array([lower, upper, *rates, *curves])


def nonsense(rng: np.random.Generator, cycles: int) -> Array:
    """Return tables of cycles that ask for what nobody should ask for, 50 cycles of a kind."""
    kinds = np.repeat(rng.integers(4, size=cycles // 50 + 1), 50)[:cycles, None]
    wild = rng.standard_normal((cycles, 14 + law.REFERENCE))
    asked = np.select(
        [kinds == 0, kinds == 1, kinds == 2], [3.0 * wild, np.inf, np.nan], 1e9 * wild
    )
    # The pose is one, except where it is no number either.
    asked[:, 14:26] = np.where(kinds == 2, np.nan, np.append(np.zeros(3), np.eye(3)))
    return asked


def commanded(rng: np.random.Generator, cycles: int, limits: Array, h: float) -> Array:
    """Return states (cycles + 1, 3, 7) of commands to an arm whose Jacobians are arbitrary."""
    states, inner = np.zeros((cycles + 1, 3, 7)), np.vstack([tightened(limits), np.zeros(7)])
    states[0, 0] = rng.uniform(limits[0] + 1e-6, limits[1] - 1e-6)
    task, table, here = sm.Task.POSE, nonsense(rng, cycles), np.eye(3)
    layout = layout_of([(task.rows, task.tool_axes, np.arange(7))], 7)
    for cycle in range(cycles):
        # Of full rank, of less, and of none.
        jacobian = rng.standard_normal((6, 7)) * (rng.random((6, 1)) < rng.choice([0.0, 0.7, 1.0]))
        arm = jacobian, here, np.zeros(3)
        law.command(cycle, *arm, table, states, inner, layout, 20.0, h)
    return states


def beyond(limits: Array, states: Array) -> float:
    """Return by how much states (N, 3, n) are beyond limits, less than 0 where they are within."""
    c, w, a = states[:, 0], states[:, 1], states[:, 2]
    hard, offset, first, last = limits[4:]
    rising, falling = (np.maximum(x + offset, 0.0) ** 2 / (2.0 * hard) for x in (w, -w))
    curves = rising + c - last, falling - c + first
    sides = limits[0] - c, c - limits[1], np.abs(w) - limits[2], np.abs(a) - limits[3], *curves
    # What is no number is beyond all.
    return float(np.nan_to_num(np.max(sides), nan=np.inf))


@pytest.mark.parametrize("seed", range(20))
def test_whatever_is_asked_for_limits_hold_for_ever(seed: int) -> None:
    rng = np.random.default_rng(seed)
    limits, h = random_limits(rng), float(rng.choice([1e-3, 4e-3, 1e-2]))
    states = commanded(rng, 4000, limits, h)
    assert np.any(states[1:, 1] != 0.0)
    assert beyond(limits, states) <= 0.0


def test_the_law_of_limits_rejects_a_command_that_is_only_clipped() -> None:
    none = [[1.0], [0.0], [-np.inf], [np.inf]]
    limits, h = np.array([[-0.5], [0.5], [2.0], [10.0], *none]), 1e-3
    states = np.zeros((1001, 3, 1))
    for cycle in range(1000):
        a = float(np.clip((limits[2] - states[cycle, 1]) / h, -limits[3], limits[3])[0])
        w = states[cycle, 1] + h * a
        states[cycle + 1] = states[cycle, 0] + h * w, w, [a]
    assert beyond(limits, states) > 0.1
    assert beyond(limits, np.full((1, 3, 1), np.nan)) == np.inf


def test_a_stop_from_any_viable_state_stays_within_limits() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        limits, h = random_limits(rng), 2e-3
        cycles = int(rng.integers(1, 400))
        states = np.zeros((4000, 3, 7))
        states[: cycles + 1] = commanded(rng, cycles, limits, h)
        inner = np.vstack([tightened(limits), np.zeros(7)])
        end = law.brake(states, cycles, inner, 1.0, h)
        assert end < len(states) - 1
        assert np.all(states[end, 1:] == 0.0)
        assert beyond(limits, states[: end + 1]) <= 0.0


# Commands that can always be stopped: how fast is viable.


@pytest.mark.parametrize("seed", range(50))
def test_the_fastest_rate_uses_all_the_room(seed: int) -> None:
    rng = np.random.default_rng(seed)
    room, most, h = 10.0 ** rng.uniform(-8, 1), rng.uniform(0.5, 20.0), 10.0 ** rng.uniform(-3, -2)
    w = fastest(room, most, h)
    # Rounding, where thousands of cycles are added up.
    assert h * w + braking_distance(w, most, h) == pytest.approx(room, rel=1e-9)


@pytest.mark.parametrize("seed", range(50))
def test_the_fastest_rate_on_a_curve_is_the_largest_from_which_braking_stays_below(
    seed: int,
) -> None:
    """Against braking itself, cycle by cycle: just below it is kept, just above it is broken."""
    rng = np.random.default_rng(seed)
    most, hard, offset = rng.uniform(0.5, 20.0), 10.0 ** rng.uniform(-0.3, 2.0), rng.uniform(0, 0.4)
    h = 1e-3
    room = offset**2 / (2.0 * hard) + 10.0 ** rng.uniform(-3, 1)
    w = fastest_on_curve(room, most, hard, offset, h)
    assert curve_missed(0.999 * w, room, most, hard, offset, h) <= 1e-9
    # Where the parabola touches the curve, by a cycle of braking less than it might be.
    assert curve_missed(1.01 * w + 2.0 * h * most, room, most, hard, offset, h) > 0.0


def curve_missed(w: float, room: float, most: float, hard: float, offset: float, h: float) -> float:
    """Return by how much a joint exceeds its curve while it brakes from w, at the end of cycles."""
    c, worst = 0.0, -np.inf
    while True:
        c += h * w
        worst = max(worst, max(w + offset, 0.0) ** 2 / (2.0 * hard) + c - room)
        if w <= 0.0:
            return float(worst)
        w = max(w - h * most, 0.0)


def test_a_box_without_any_acceleration_to_choose_is_no_trouble() -> None:
    numbers = [-1.0, 1.0, 1.0, 5.0, 1.0, 0.0, -np.inf, np.inf]
    low, high = viable_accelerations(1.0, 0.0, np.array(numbers)[:, None], 0, 1e-3)
    assert low <= high <= 0.0

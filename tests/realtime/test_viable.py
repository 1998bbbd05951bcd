"""Commands that can always be stopped."""

import numpy as np
import pytest

from selfmotion.realtime.law import brake
from selfmotion.realtime.viable import (
    advance_state,
    braking_distance,
    fastest,
    tightened,
)
from support.loops import Array

# What commands are viable.


def wishes(rng: np.random.Generator, kind: int, hardest: Array) -> Array:
    """Accelerations that nobody should ask for."""
    if kind == 0:
        return 3.0 * hardest * rng.standard_normal(len(hardest))
    if kind == 1:
        return np.full(len(hardest), np.inf)
    if kind == 2:
        return np.full(len(hardest), np.nan)
    return np.asarray(-1e9 * hardest * np.sign(rng.standard_normal(len(hardest))))


def random_limits(rng: np.random.Generator, n: int = 7) -> Array:
    lower, upper = -rng.uniform(0.01, 3.0, n), rng.uniform(0.01, 3.0, n)
    return np.array([lower, upper, rng.uniform(0.1, 3.0, n), rng.uniform(0.5, 20.0, n)])


def beyond(limits: Array, c: Array, w: Array, a: Array) -> float:
    return max(
        float(np.max([limits[0] - c, c - limits[1]])),
        float(np.max(np.abs(w) - limits[2])),
        float(np.max(np.abs(a) - limits[3])),
    )


@pytest.mark.parametrize("seed", range(20))
def test_whatever_is_asked_for_limits_hold_for_ever(seed: int) -> None:
    rng = np.random.default_rng(seed)
    limits, h = random_limits(rng), float(rng.choice([1e-3, 4e-3, 1e-2]))
    inner = tightened(limits)
    c = rng.uniform(limits[0] + 1e-6, limits[1] - 1e-6)
    w, a = np.zeros(7), np.zeros(7)
    kind = 0
    for k in range(4000):
        if k % 50 == 0:
            kind = int(rng.integers(4))
        advance_state(c, w, a, wishes(rng, kind, limits[3]), inner, h)
        assert beyond(limits, c, w, a) <= 0.0


def test_the_law_of_limits_rejects_a_command_that_is_only_clipped() -> None:
    limits = np.array([[-0.5], [0.5], [2.0], [10.0]])
    c, w, worst = np.zeros(1), np.zeros(1), 0.0
    for _ in range(1000):
        a = np.clip((limits[2] - w) / 1e-3, -limits[3], limits[3])
        w += 1e-3 * a
        c += 1e-3 * w
        worst = max(worst, beyond(limits, c, w, a))
    assert worst > 0.1


@pytest.mark.parametrize("seed", range(50))
def test_the_fastest_rate_uses_all_the_room(seed: int) -> None:
    rng = np.random.default_rng(seed)
    room, most, h = 10.0 ** rng.uniform(-8, 1), rng.uniform(0.5, 20.0), 10.0 ** rng.uniform(-3, -2)
    w = fastest(room, most, h)
    # Rounding, where thousands of cycles are added up.
    assert h * w + braking_distance(w, most, h) == pytest.approx(room, rel=1e-9)


def test_a_stop_from_any_viable_state_stays_within_limits() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        limits, h = random_limits(rng), 2e-3
        inner = np.vstack([tightened(limits), np.zeros(7)])
        states = np.zeros((4000, 3, 7))
        c, w, a = states[0]
        c[:] = rng.uniform(limits[0] + 1e-6, limits[1] - 1e-6)
        for _ in range(int(rng.integers(1, 400))):
            advance_state(c, w, a, wishes(rng, 3, limits[3]), inner, h)
        end = brake(states, 0, inner, h)
        assert end < len(states) - 1
        assert np.all(states[end, 1:] == 0.0)
        for k in range(end + 1):
            assert beyond(limits, *states[k]) <= 0.0

"""Joints that turn round are counted, and a cost makes them do so less often."""

from dataclasses import replace

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.result import Reversals
from support.arms import PANDA_HOME

# Where a motion turns round, by samples of it [s].
NEAR = 1e-4


def swinging(size: float, turns: int, duration: float = 4.0) -> sm.Trajectory:
    """Return a joint that swings from rest to rest, and one that goes one way."""
    t = np.linspace(0.0, duration, 801)
    w = np.pi * turns / duration
    q = np.stack([size * np.cos(w * t), t**2], axis=1)
    qd = np.stack([-size * w * np.sin(w * t), 2.0 * t], axis=1)
    qdd = np.stack([-size * w**2 * np.cos(w * t), np.full(len(t), 2.0)], axis=1)
    return sm.Trajectory(t, q, qd, ("swings", "goes"), qdd)


@pytest.mark.parametrize("turns", [1, 2, 7])
def test_a_swing_turns_round_where_it_is_farthest(turns: int) -> None:
    found = Reversals.of(swinging(0.3, turns))
    expected = 4.0 * np.arange(1, turns) / turns
    np.testing.assert_allclose(found.times["swings"], expected, atol=NEAR)
    assert not len(found.times["goes"])
    assert found.count == turns - 1
    assert str(found) == {0: "never", 1: "once: swings 1", 6: "6 times: swings 6"}[turns - 1]


def test_trembling_is_no_turning() -> None:
    slow, trembling = swinging(0.3, 2), swinging(2e-4, 40)
    both = sm.Trajectory(
        slow.t, slow.q + trembling.q, slow.qd + trembling.qd, slow.joint_names, None
    )
    assert Reversals.of(both).count == 1
    assert Reversals.of(trembling).count == 0
    # Three times the size it is more than the least that counts.
    assert Reversals.of(swinging(6e-4, 40)).count == 39


def test_the_cost_counts_and_a_motion_turns_round_less_often() -> None:
    panda = sm.load_robot("panda")
    pose = panda.pose(PANDA_HOME)
    away = [[0.0, 0.0], [0.0, 0.2], [0.05, 0.2], [0.05, 0.0]]
    points = [pose.translation + np.array([x, y, 0.0]) for x, y in away]
    path = sm.Feed(sm.Polyline(points, tolerance=2e-3), 0.1)
    velocity, turning = sm.JointVelocity(), sm.JointReversals(0.1)
    problem = sm.Problem(panda, path, "position", PANDA_HOME, costs=[velocity])
    plain = sm.plan(problem).require()
    fewer = sm.plan(replace(problem, costs=[velocity, turning])).require()
    assert fewer.reversals.count < plain.reversals.count
    # A joint that turns round costs the weight, one that begins or ends half of it.
    own = fewer.report.terms["joint reversals"] / 0.1
    rests = panda.dof
    assert fewer.reversals.count <= own <= 1.5 * (fewer.reversals.count + rests)

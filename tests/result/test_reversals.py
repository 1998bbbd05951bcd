"""Joints that turn round are counted, and a cost makes them do so less often."""

from dataclasses import replace

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.result import Reversals

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
    assert str(found) == {0: "0", 1: "1 (swings 1)", 6: "6 (swings 6)"}[turns - 1]


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
    arm = sm.load_robot("planar_3r")
    points = [[2.0, -0.6, 0.0], [2.0, 0.6, 0.0], [1.7, 0.6, 0.0], [1.7, -0.6, 0.0]]
    path = sm.paths.Feed(sm.paths.Polyline(points, tolerance=0.03), 1.0, within=0.5)
    velocity, turning = sm.costs.JointVelocity(), sm.costs.JointReversals(0.2)
    q = arm.inverse_kinematics(path.pose(0.0), "planar", seed=[-1.2, 1.2, 0.6])
    limits = [sm.constraints.JointPositionLimits()]
    problem = sm.Problem(arm, path, "planar", q, costs=[velocity], constraints=limits)
    plain, fewer = (
        sm.plan(replace(problem, costs=costs)) for costs in ([velocity], [velocity, turning])
    )
    assert plain.certificate.on_path
    assert fewer.certificate.on_path
    assert fewer.reversals.count < plain.reversals.count
    # A joint that turns round costs the weight, one that begins or ends half of it.
    own = fewer.report.terms["joint reversals"] / 0.2
    assert fewer.reversals.count <= own <= 1.5 * (fewer.reversals.count + arm.dof)

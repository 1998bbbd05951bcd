"""The loop keeps limits of speed that depend on the position, between cycles as well."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.realtime import Flag, Replanner, Segment
from support import franka
from support.arms import robot_named
from support.loops import closed_loop

# Rates between cycles, from differences of positions of the spline [rad/s].
ROUNDING = 1e-9
# Times per cycle at which commands are judged: 4 kHz.
PER_CYCLE = 4


def between_cycles(segment: Segment) -> tuple[Array, Array]:
    """Return q and q̇ of a segment at four times per cycle; q̈ is linear between commands."""
    h = float(segment.t[1] - segment.t[0])
    q, qd, qdd = segment.q[:-1], segment.qd[:-1], segment.qdd[:-1]
    slope = np.diff(segment.qdd, axis=0) / h
    times = h * np.arange(PER_CYCLE)[:, None, None] / PER_CYCLE
    places = q + times * (qd + times * (0.5 * qdd + times / 6.0 * slope))
    rates = qd + times * (qdd + 0.5 * times * slope)
    return places.reshape(-1, 7), rates.reshape(-1, 7)


def fast_motions(seed: int) -> list[Segment]:
    """Return segments towards a pose near the ends of some joints' ranges, as fast as it goes."""
    robot, rng = robot_named("fr3"), np.random.default_rng(seed)
    start = np.array(robot.home)
    goal = np.where(rng.random(7) < 0.5, robot.lower + 0.01, robot.upper - 0.01)
    goal = np.where(rng.random(7) < 0.5, goal, start)
    there = sm.paths.Line(robot.pose(start), robot.pose(goal), 0.4)
    rushing = sm.realtime.Approach(rate=30.0, speed=3.0, acceleration=20.0)
    replanner = Replanner(robot, "position", approach=rushing)
    return closed_loop(replanner, there, start, 1.0)[0]


@pytest.mark.parametrize("seed", range(6))
def test_commands_keep_the_makers_limits_at_4_khz(seed: int) -> None:
    segments = fast_motions(seed)
    for segment in segments:
        assert franka.refusals(*between_cycles(segment), ROUNDING) == 0
        assert np.all(segment.qd[-1] == 0.0)


def test_without_the_limits_the_same_commands_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """The judge of the test before sees what it is to see."""
    free = sm.constraints.Constraint.envelope
    monkeypatch.setattr(sm.constraints.PositionDependentVelocityLimits, "envelope", free)
    refused = [
        franka.refusals(*between_cycles(item), ROUNDING)
        for seed in range(3)
        for item in fast_motions(seed)
    ]
    assert sum(refused) > 0


def test_the_arm_does_not_begin_faster_than_it_can_stop() -> None:
    robot = robot_named("fr3")
    q, qd = np.array(robot.home), np.zeros(7)
    q[3], qd[3] = -0.3, 1.0
    limit = franka.velocity_limits(q[None])[1][0, 3]
    replanner = Replanner(robot, "position")
    with pytest.raises(sm.errors.StartError, match="fr3_joint4"):
        replanner.step(0.0, q, qd, sm.paths.Dwell(robot.pose(q), 10.0))
    qd[3] = 0.8 * limit
    segment = replanner.step(0.0, q, qd, sm.paths.Dwell(robot.pose(q), 10.0))
    assert segment.flag is Flag.PLANNED
    assert franka.refusals(*between_cycles(segment), ROUNDING) == 0


def test_one_constraint_says_how_speed_depends_on_the_position(panda: sm.RobotModel) -> None:
    limits = sm.constraints.PositionDependentVelocityLimits
    with pytest.raises(sm.errors.ProblemError, match="2 constraints say how limits of speed"):
        Replanner(panda, constraints=[limits(3.0), limits(4.0)])

"""A ball that jumps about a tool motion: what segments keep from it to their rest, at 4 kHz."""

from itertools import pairwise

import numpy as np
import pinocchio as pin

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.realtime import Approach, Replanner, Segment
from selfmotion.realtime.settings import NEARER
from support.arms import PANDA_HOME, robot_named

# What is issued, and where the ball was.
Found = list[tuple[Segment, Array]]
# Distance to keep [m].
FAR = 0.01
# Between control cycles segments are judged at this number of times: 4 kHz.
PER_CYCLE = 4
# Rounding of distances of bodies [m].
ROUNDING = 1e-6
# Rounding of limits, relative to them, and of commands that are computed twice [rad].
ROUNDED, SAME = 1e-9, 1e-12


def motion_between_cycles(segment: Segment) -> tuple[Array, Array, Array]:
    """Return q, q̇ and q̈ at four times per cycle, (K, n): q̈ is linear between commands."""
    h = float(segment.t[1] - segment.t[0])
    times = h * np.arange(PER_CYCLE)[:, None, None] / PER_CYCLE
    slope = np.diff(segment.qdd, axis=0) / h
    q, qd, qdd = segment.q[:-1], segment.qd[:-1], segment.qdd[:-1]
    places = q + times * (qd + times * (0.5 * qdd + times / 6.0 * slope))
    rates = qd + times * (qdd + 0.5 * times * slope)
    n = q.shape[1]
    q, qd, qdd = (x.transpose(1, 0, 2).reshape(-1, n) for x in (places, rates, qdd + times * slope))
    return q, qd, qdd


def between_cycles(segment: Segment) -> Array:
    """Return q at four times per cycle, (K, n)."""
    return motion_between_cycles(segment)[0]


def nearer_than_allowed(robot: sm.RobotModel, bodies: list, q: Array) -> float:
    """Return by how much the bodies come nearer than they may on a motion (K, n) [m]."""
    model = sm.obstacles.CollisionModel(robot, bodies)
    first, least = model.distance(q[0]).value, model.worst(q).value
    return min(FAR, first - NEARER) - least - ROUNDING


def ball_at(place: Array, radius: float = 0.05) -> sm.obstacles.Sphere:
    return sm.obstacles.Sphere("ball", place, radius)


def run(replanner: Replanner, seed: int, steps: int = 150) -> Found:
    """Return segments towards a tool motion through a ball that jumps about, and where it was."""
    robot, rng = replanner.robot, np.random.default_rng(seed)
    start = robot.pose(PANDA_HOME)
    goal = pin.SE3(start.rotation, start.translation + rng.uniform(-0.3, 0.3, 3))
    path = sm.paths.Line(start, goal, 0.8)
    t, q, qd, found = 0.0, PANDA_HOME, np.zeros(7), []
    place = np.array([0.0, 0.0, 9.0])
    for k in range(steps):
        if k % 25 == 5:
            # Beside the way of the tool, ahead of where it is.
            ahead = path.pose(min(t + 0.15, 0.8)).translation
            place = ahead + rng.uniform(-0.12, 0.12, 3)
        segment = replanner.step(t, q, qd, path, {"ball": pin.SE3(np.eye(3), place)})
        found.append((segment, place))
        t += replanner.period
        now = segment.index(t)
        q, qd = segment.q[now], segment.qd[now]
    return found


def looped() -> Replanner:
    clearance = sm.constraints.Clearance([ball_at(np.array([0.0, 0.0, 9.0]))], distance=FAR)
    rushing = Approach(speed=2.0, acceleration=10.0)
    return Replanner(robot_named("panda"), "position", constraints=[clearance], approach=rushing)


def is_rest(segment: Segment) -> bool:
    """Return whether a segment is the rest of the one before, for lack of a proof."""
    return any("not proved" in reason for reason in segment.reasons)


def judged(found: Found) -> list[float]:
    """Return how much too near each segment comes that is not the rest of the one before."""
    robot, excess = robot_named("panda"), []
    for segment, place in found:
        assert np.all(segment.qd[-1] == 0.0)
        assert np.all(segment.qdd[-1] == 0.0)
        if not is_rest(segment):
            excess.append(nearer_than_allowed(robot, [ball_at(place)], between_cycles(segment)))
    return excess


def changed_rests(found: Found) -> float:
    """Return by how much segments without a proof differ from the rest of the one before."""
    worst = 0.0
    for (before, _), (after, _) in pairwise(found):
        if is_rest(after):
            k = before.index(after.t[0])
            count = min(len(before.q) - k, len(after.q))
            worst = max(worst, float(np.abs(before.q[k : k + count] - after.q[:count]).max()))
    return worst


def limits_exceeded(replanner: Replanner, found: Found) -> float:
    """Return by how much segments exceed a limit, as a share of it, 0 or less where none does."""
    lower, upper, speed, hardest = replanner.limits
    worst = -np.inf
    for segment, _ in found:
        jerk = np.abs(np.diff(segment.qdd, axis=0)) / replanner.cycle
        sides = (
            (lower - segment.q).max(),
            (segment.q - upper).max(),
            (np.abs(segment.qd) / speed).max() - 1.0,
            (np.abs(segment.qdd) / hardest).max() - 1.0,
            (jerk / replanner.jerk_limit).max() - 1.0,
        )
        worst = max(worst, *map(float, sides))
    return worst


def faults(seed: int, replanner: Replanner) -> list[str]:
    """Return what a run showed that is against the laws; none where all hold."""
    replanner.reset()
    found = run(replanner, seed)
    said = []
    if (near := max(judged(found))) > 0.0:
        said.append(f"{near * 1e3:.3g} mm nearer than proved")
    if (off := changed_rests(found)) > SAME:
        said.append(f"the rest of a segment is {off:.2g} rad off it")
    if (beyond := limits_exceeded(replanner, found)) > ROUNDED:
        said.append(f"{beyond:.2g} beyond a limit")
    return said

"""Paths of an arm on a torso lift, each with a known motion: `python benchmarks/lifts.py`.

The tool's motion is that of a random smooth joint motion of a Fetch, within limits and clear of
itself, in which the lift goes a long way; then it is forgotten. Prints whether each path is
followed again, by a motion that is verified at all times, and how far the lift goes in it.

Then two paths of a Fetch are planned at several prices of a metre of the lift, each from nothing:
what a motion costs at its price, and by how much another one's would have been cheaper there.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
import suite
from scipy.interpolate import PchipInterpolator

import selfmotion as sm
from selfmotion.basics import Array, silent

DATA = Path(__file__).parent / "data"
DURATION, WAYPOINTS, KNOTS = 30.0, 60, 5
# How far the lift goes at least, there and back [m], and a joint between two knots at most [rad].
LONG_PATH, LARGEST = 0.3, 0.5
# From limits [rad or m], and from itself [m]; and a share of the limits of speed.
EDGE, CLEAR, SPEED = 0.02, 2e-3, 0.8
# What a metre of the lift counts [rad].
PRICES = (0.3, 1.0, 3.0, 10.0, 30.0, 100.0)


def known_motion(robot: sm.RobotModel, model: sm.obstacles.CollisionModel, number: int) -> Array:
    """Return a random motion (W, n)."""
    rng = np.random.default_rng(number)
    lower, upper = robot.finite_limits()
    lift = robot.joint_names.index("torso_lift_joint")
    while True:
        first = lower + (upper - lower) * rng.uniform(0.1, 0.9, robot.dof)
        moves = np.cumsum(rng.uniform(-LARGEST, LARGEST, (KNOTS, robot.dof)), axis=0)
        corners = np.clip(first + moves, lower + EDGE, upper - EDGE)
        corners[:, lift] = rng.uniform(lower[lift] + EDGE, upper[lift] - EDGE, KNOTS)
        t = np.linspace(0.0, 1.0, WAYPOINTS)
        q = np.asarray(PchipInterpolator(np.linspace(0.0, 1.0, KNOTS), corners)(t))
        fastest = np.abs(np.gradient(q, DURATION * t, axis=0)).max(axis=0)
        kept = length_of(q[:, lift]) >= LONG_PATH and np.all(
            fastest <= SPEED * robot.velocity_limit
        )
        if kept and model.worst(q).value >= CLEAR:
            return q


def length_of(x: Array) -> float:
    """Return how far a joint goes in all."""
    return float(np.abs(np.diff(x)).sum())


def at_prices(name: str) -> None:
    """Print what motions along a path of the suite cost, made at several prices of a metre."""
    problem = suite.load(DATA / name)
    slides = np.array([problem.robot.is_prismatic(joint) for joint in problem.robot.joint_names])
    ways = {}
    for price in PRICES:
        _, q = suite.plan(problem, 0, silent, metre=price)
        moved = np.abs(np.diff(q, axis=0)).sum(axis=0)
        ways[price] = np.array([moved[~slides].sum(), moved[slides].sum()])
    for price, way in ways.items():
        costs = [float(each @ (1.0, price)) for each in ways.values()]
        own = float(way @ (1.0, price))
        print(
            f"{name}, {price:5.1f} rad a metre: {way[0]:6.2f} rad + {way[1]:.3f} m, "
            f"{100 * (own / min(costs) - 1):.1f} % above the best of all at that price",
            flush=True,
        )


def main() -> int:
    """Print a row for each problem; return 1 where one is not found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=30)
    count = parser.parse_args().count
    robot = sm.load_robot(DATA / "fetch.urdf", tool="gripper_link")
    lift = robot.joint_names.index("torso_lift_joint")
    # Bellows around the lift are in what they hide as they are made.
    made = [(item.first, item.second) for item in sm.obstacles.CollisionModel(robot).overlapping]
    model = sm.obstacles.CollisionModel(robot, (), made)
    limits: list[sm.constraints.Constraint] = [
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
    ]
    apart = sm.constraints.Clearance(distance=0.0, disabled=made)
    found, seconds = 0, []
    for number in range(count):
        known = known_motion(robot, model, number)
        poses = [robot.pose(q) for q in known]
        path = sm.paths.Waypoints.from_poses(np.linspace(0.0, DURATION, WAYPOINTS), poses)
        began = time.process_time()
        try:
            problem = sm.Problem(robot, path, constraints=limits, clearance=apart, rest=False)
            plan = sm.plan(problem)
            good, said = plan.certificate.verified, plan.certificate.verdict
            way = f"{length_of(plan.trajectory.q[:, lift]):.3f} m"
        except sm.SelfmotionError as error:
            good, said, way = False, str(error), "-"
        seconds.append(time.process_time() - began)
        found += good
        print(
            f"{number:3d}  lift {length_of(known[:, lift]):.3f} m, found {way:8s} "
            f"{seconds[-1]:6.1f} s  {'yes' if good else 'NO: ' + said}",
            flush=True,
        )
    print(f"{found} of {count} found, {np.median(seconds):.1f} s in the median")
    for name in ("fetch__circle", "fetch__s"):
        at_prices(name)
    return int(found < count)


if __name__ == "__main__":
    sys.exit(main())

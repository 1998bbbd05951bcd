"""What margins of 5 mm and 0.5° cost, and whether they are there: `make bench NAME=bought`.

Random lines and circles, each with a ball, box or cylinder so large that it comes to 2 to 5 mm of
the arm. Each is planned with the margin (`plan_with_margin`); random displacements of its full
size, judged by Pinocchio and coal alone, must leave all bodies apart. The price is held against a
problem that knows nothing of margins: each body stands there in several places at once, displaced
towards where it comes nearest to the arm, more of them until none that is missing would meet it. So
that problem's optimum is what the margin has to cost.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import pinocchio as pin
import typer
from rich.console import Console

import selfmotion as sm

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from margins import random_path
from support.displaced import MISSED, Judge, random_displacement

ARMS = (("panda", "pose"), ("xarm7", "pose"), ("ur5", "position"))
# How near a body comes to the arm whose motion knows nothing of it [m], and what it has to leave.
NEAREST, FARTHEST, CLEARANCE = 2e-3, 5e-3, 1e-3
# At the given start it is no nearer than this [m].
AT_START = 0.03
# Sizes of bodies [m].
SMALLEST, LARGEST = 5e-3, 0.15
WANTED = sm.Margin(position=5e-3, rotation=np.radians(0.5))
# Times that the judge looks at.
LOOKS = 60
# Rounds of more displaced bodies, and what may be missing in the end [m].
ROUNDS, MISSING = 8, 1e-4
# A price below this share of the cost is none that could be compared.
LEAST_PRICE = 1e-4
# What a price may differ by from what it has to be.
NEARLY = 0.25


def body_of(kind: int, center: np.ndarray, turn: np.ndarray, size: float) -> sm.obstacles.Obstacle:
    """Return a ball, box or cylinder."""
    place = pin.SE3(turn, center)
    if kind == 0:
        return sm.obstacles.Sphere("body", center, size)
    if kind == 1:
        return sm.obstacles.Box("body", place, [2.0 * size, size, size])
    return sm.obstacles.Cylinder("body", place, size, 3.0 * size)


def distance(robot: sm.RobotModel, body: sm.obstacles.Obstacle, q: np.ndarray) -> float:
    """Return how near a body comes to the arm at configurations (K, n) [m]."""
    every = sm.obstacles.CollisionModel(robot, (body,)).pairs
    own = [pair for pair in every if body.name not in pair]
    return float(sm.obstacles.CollisionModel(robot, (body,), disabled=own).worst(q).value)


def near_plan(rng: np.random.Generator, arms: list[tuple[sm.RobotModel, str]]) -> sm.Plan:
    """Return the plan of a random line or circle whose arm comes near a body."""
    while True:
        robot, task = arms[rng.integers(len(arms))]
        start, path = random_path(rng, robot)
        limits = [sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()]
        try:
            bare = sm.Problem(robot, path, task, start, constraints=limits)
            alone = sm.plan(bare, deadline=2.0)
        except sm.SelfmotionError:
            continue
        if not alone.certificate.verified:
            continue
        q = alone.trajectory(np.linspace(0.0, alone.trajectory.duration, LOOKS))
        kind, joint = int(rng.integers(3)), int(rng.integers(2, 5))
        middle = robot.joint_poses(q[rng.integers(len(q) // 3, len(q))][None])[0, joint, :3]
        turn = pin.exp3(rng.normal(size=3))
        center = middle + rng.normal(0.0, 0.1, 3)

        wanted = float(rng.uniform(NEAREST, FARTHEST))
        low, high = SMALLEST, LARGEST
        least, most = (
            distance(robot, body_of(kind, center, turn, size), q) for size in (high, low)
        )
        if not least < wanted < most:
            continue
        for _ in range(10):
            size = 0.5 * (low + high)
            fits = distance(robot, body_of(kind, center, turn, size), q) > wanted
            low, high = (size, high) if fits else (low, size)
        body = body_of(kind, center, turn, low)
        if distance(robot, body, start[None]) < AT_START:
            continue
        try:
            clear = sm.constraints.Clearance([body], CLEARANCE)
            plan = sm.plan(bare.changed(constraints=limits, clearance=clear), deadline=2.0)
        except sm.SelfmotionError:
            continue
        if plan.certificate.verified:
            return plan


def worst_displacement(judge: Judge, plan: sm.Plan, t: np.ndarray) -> tuple[float, pin.SE3]:
    """Return what the worst displacement of the part would leave [m], to first order, and it."""
    part = sm.margin(plan, part=[body.name for body in plan.obstacles]).part
    still = judge.moved_by(part, np.zeros(3), np.zeros(3))
    least, worst = np.inf, (np.zeros(3), np.zeros(3))
    for one in t:
        judge.least(still, np.array([one]))
        for pair, found in zip(
            judge._bodies.collisionPairs, judge._places.distanceResults, strict=True
        ):
            names = judge.names[pair.first], judge.names[pair.second]
            moves = [name in part.bodies for name in names]
            if moves[0] == moves[1] or found.min_distance <= 0.0:
                continue
            points = found.getNearestPoint1(), found.getNearestPoint2()
            moving, other = points if moves[0] else points[::-1]
            towards = (other - moving) / np.linalg.norm(other - moving)
            moment = np.cross(moving - part.center, towards)
            lever = float(np.linalg.norm(moment))
            left = found.min_distance - WANTED.position - lever * WANTED.rotation
            if left < least:
                least = left
                worst = WANTED.position * towards, WANTED.rotation * moment / max(lever, 1e-12)
    rotation = pin.exp3(worst[1])
    center = np.asarray(part.center)
    return least, pin.SE3(rotation, center + worst[0] - rotation @ center)


def best_with_copies(first: sm.Plan, other: sm.Plan, t: np.ndarray) -> float:
    """Return the least cost past the bodies at all their worst places; inf where none is found.

    First with none but those that the worst displacements of the plan before lead to. The last
    problem is planned from the `other` motion, too: a problem past bodies has several optima.
    """
    problem, plan = first.problem, first
    copies: list[sm.obstacles.Obstacle] = []
    for number in range(ROUNDS):
        # The judge has to know the first bodies alone.
        bare = replace(plan, problem=problem, certificate=problem.certify(plan.trajectory))
        left, by = worst_displacement(Judge(bare), bare, t)
        if left > -MISSING:
            break
        copies += [
            replace(body, name=f"{body.name}_{number}", pose=by * body.pose)
            for body in first.obstacles
        ]
        also = sm.constraints.Clearance(copies, 0.0)
        there = problem.changed(clearance=[*problem.clearances, also])
        plan = sm.plan(there, warm_start=plan, deadline=20.0)
        if not plan.certificate.verified:
            break
    both = (plan, sm.plan(plan.problem, warm_start=other, deadline=20.0))
    return min((each.report.cost for each in both if each.certificate.verified), default=np.inf)


def main(
    count: Annotated[
        int, typer.Option(help="How many problems to which the margin is added.")
    ] = 40,
    displacements: Annotated[int, typer.Option(help="Of each plan, of the full size.")] = 50,
    seed: Annotated[int, typer.Option(help="Of the first plan.")] = 0,
) -> None:
    """Buy margins, displace, judge, and compare the price."""
    console = Console()
    arms = [(sm.load_robot(name), task) for name, task in ARMS]
    failures, made, reached, refused, beyond, errors, seconds = 0, 0, 0, 0, 0, [], []
    number = seed
    while reached < count:
        plan = near_plan(np.random.default_rng([47, number]), arms)
        number += 1
        bodies = [body.name for body in plan.obstacles]
        began = time.process_time()
        found = sm.plan_with_margin(plan.problem, WANTED, part=bodies)
        if not found.kept_apart:
            continue
        seconds.append(time.process_time() - began)
        if not found.reached:
            refused += 1
            console.print(f"{number - 1}: {found}", highlight=False, soft_wrap=True)
            continue
        reached += 1
        rng = np.random.default_rng([43, number - 1])
        judge, t = Judge(found.plan), np.linspace(0.0, found.plan.trajectory.duration, LOOKS)
        part = sm.margin(found.plan, part=bodies).part
        fell = 0
        for _ in range(displacements):
            moved = random_displacement(rng, WANTED.position, WANTED.rotation)
            made += 1
            fell += judge.least(judge.moved_by(part, *moved), t) < -MISSED
        failures += fell
        price, told = found.cost - found.cost_without, f"{found.extra_cost:+.3%}"
        if price > LEAST_PRICE * found.cost_without:
            least = best_with_copies(plan, found.plan, t) - found.cost_without
            if np.isinf(least):
                beyond += 1
            else:
                errors.append(price / least - 1.0 if least > 0.0 else np.inf)
                told += f", with bodies at their worst places {least / found.cost_without:+.3%}"
        console.print(
            f"{number - 1} {plan.robot.name}: {told}; {fell} fail", highlight=False, soft_wrap=True
        )
    errors = np.array(errors) if errors else np.array([np.nan])
    within, cheaper = np.abs(errors) <= NEARLY, errors < -NEARLY
    console.print(
        f"{reached} problems have the margin, {refused} others cannot; {made} displacements, "
        f"{failures} fail; of {len(errors)} prices above {LEAST_PRICE:.2%}, {within.sum()} "
        f"are within {NEARLY:.0%} of what they have to be, {cheaper.sum()} are lower still (there "
        f"the other problem ended at a worse optimum); median of the amounts "
        f"{np.median(np.abs(errors)):.1%}, most above {np.max(errors):.1%} ({beyond} not compared: "
        f"no motion past the bodies was found); "
        f"{np.median(seconds):.1f} s each in the median",
        highlight=False,
        soft_wrap=True,
    )
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    typer.run(main)

"""What it takes to keep what binds: `make bench NAME=binding`.

Each problem is planned with a condition that its best motion breaks, and without: limits of one
joint's jerk or of all of them that a calmer motion keeps, balls that the best one meets beside the
elbow or deep inside a link; and with the arm asked to keep off itself where it does so anyway.
Times are those of the processor, the shorter one of two; what is verified is told.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Annotated

import numpy as np
import pinocchio as pin
import typer
from problems import PANDA_HOME
from rich.console import Console
from rich.table import Table

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.collision import CollisionModel

ARMS = ("panda", "xarm7")
# How many problems of each kind.
COUNTS = {"jerk": 20, "all jerks": 20, "beside": 20, "deep": 11, "itself": 60}
# Limits of jerk are so many times what the motion of least jerk has, of the joint whose best motion
# is beyond that by the largest factor, or of all joints; it has to be beyond by this one.
ROOM, BINDS = 1.1, 1.05
# How far the best motion is inside a ball [m], and how far the start is away from it at least.
MET, DEEP, AWAY = (-0.03, 0.0), (-0.107, -0.055), 0.012
DISTANCE = 5e-3
MOTIONS, BALLS = 200, 60
Pair = tuple[sm.Problem, sm.Problem]


def free_problem(number: int, rng: np.random.Generator) -> sm.Problem:
    """Return a circle from a random start."""
    robot = sm.load_robot(ARMS[number % len(ARMS)])
    home = PANDA_HOME if robot.name == "panda" else robot.dexterous_configuration("pose")
    start = home + rng.uniform(-0.3, 0.3, robot.dof)
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    pose, radius = robot.pose(start), float(rng.uniform(0.06, 0.12))
    path = sm.paths.Circle.around(pose, radius, 4.0, normal=normal)
    task = "position" if rng.random() < 0.4 else "pose"
    return sm.Problem(robot, path, task, start)


def planned(problem: sm.Problem) -> sm.Plan | None:
    """Return a verified plan, or None."""
    try:
        plan = sm.plan(problem)
    except sm.SelfmotionError:
        return None
    return plan if plan.certificate.verified else None


def jerks(plan: sm.Plan) -> Array:
    """Return the largest jerk of each joint, (n,)."""
    t = np.linspace(0.0, plan.path.duration, 2001)
    return np.asarray(np.abs(np.diff(plan.trajectory(t, 2), axis=0)).max(axis=0) / t[1])


def with_jerks(number: int, *, of_all: bool) -> Pair | None:
    """Return a problem without limits of jerk, and with some that bind: of one joint or of all."""
    rng = np.random.default_rng([1, number])
    free = replace(free_problem(number, rng), constraints=[sm.constraints.JointPositionLimits()])
    plan = planned(free)
    if plan is None:
        return None
    calm = planned(replace(free, costs=[sm.costs.JointJerk()]))
    if calm is None:
        return None
    limits = ROOM * jerks(calm)
    beyond = jerks(plan) / np.maximum(limits, 1e-6)
    busiest = int(np.argmax(beyond))
    if beyond[busiest] <= BINDS:
        return None
    if not of_all:
        limits[np.arange(len(limits)) != busiest] = np.inf
    asked = sm.constraints.JointJerkLimits(np.maximum(limits, 1e-2))
    return free, replace(free, constraints=[*free.constraints, asked])


def beside(number: int, deep: bool) -> Pair | None:
    """Return a problem, and the same with a ball that its best motion meets."""
    rng = np.random.default_rng([int(deep), number])
    free = free_problem(number, rng)
    robot, plan = free.robot, planned(free)
    if plan is None or free.given_start is None:
        return None
    q, data = plan.trajectory.q, robot.model.createData()
    pin.forwardKinematics(robot.model, data, q[len(q) // 2])
    elbow = data.oMi[4].translation
    low, high = DEEP if deep else MET
    for _ in range(BALLS):
        radius, centre = float(rng.uniform(0.04, 0.1)), elbow + 0.1 * rng.normal(size=3)
        ball = sm.obstacles.Sphere("ball", centre, radius)
        bodies = CollisionModel(robot, (ball,))
        met, away = bodies.worst(q).value, bodies.worst(free.given_start[None]).value
        if low < met < high and away > AWAY:
            clearance = sm.constraints.Clearance((ball,), DISTANCE)
            return free, replace(free, clearance=clearance)
    return None


def off_itself(number: int) -> Pair | None:
    """Return a problem whose best motion keeps off itself, and the same that asks for it."""
    free = free_problem(number, np.random.default_rng([2, number]))
    if planned(free) is None:
        return None
    asked = sm.constraints.Clearance((), 0.0)
    return free, replace(free, clearance=asked)


KINDS: dict[str, Callable[[int], Pair | None]] = {
    "jerk": lambda number: with_jerks(number, of_all=False),
    "all jerks": lambda number: with_jerks(number, of_all=True),
    "beside": lambda number: beside(number, deep=False),
    "deep": lambda number: beside(number, deep=True),
    "itself": off_itself,
}


def pairs(kind: str, count: int) -> list[tuple[int, Pair]]:
    """Return the first so many problems of a kind that there are."""
    found: list[tuple[int, Pair]] = []
    for number in range(MOTIONS):
        pair = KINDS[kind](number) if len(found) < count else None
        if pair is not None:
            found.append((number, pair))
    return found


def timed(problem: sm.Problem) -> tuple[sm.Plan | None, float]:
    """Return a verified plan or None, and how long that takes [s]."""
    seconds = []
    for _ in range(2):
        began = time.process_time()
        plan = planned(problem)
        seconds.append(time.process_time() - began)
    return plan, min(seconds)


def main(
    kind: Annotated[list[str] | None, typer.Option(help="Of these kinds only.")] = None,
    share: Annotated[float, typer.Option(help="Only this share of the problems.")] = 1.0,
) -> int:
    """Plan them all; print how many are verified, and the ratios of times."""
    console, table = Console(), Table()
    for name in ("what binds", "problems", "verified", "evaluations", "time, median", "most"):
        table.add_column(name)
    sm.plan(sm.sample_problem())
    for name in kind or KINDS:
        kept, ratios, evaluations = 0, list[float](), list[int]()
        known = pairs(name, max(1, round(share * COUNTS[name])))
        for number, (free, asked) in known:
            (_, before), (plan, after) = timed(free), timed(asked)
            if plan is None:
                console.print(f"{name} {number}: not verified, {after:.1f} s")
                continue
            kept += 1
            ratios.append(after / before)
            evaluations.append(plan.report.evaluations)
        if not kept:
            continue
        middle = f"{np.median(ratios):.2f}", f"{max(ratios):.2f}"
        most = f"{np.median(evaluations):.0f}, at most {max(evaluations)}"
        table.add_row(name, str(len(known)), str(kept), most, *middle)
    console.print(table)
    return 0


if __name__ == "__main__":
    sys.exit(typer.run(main))

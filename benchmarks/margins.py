"""By how much part, tool and base may be displaced: `make bench NAME=margins`.

Random lines and circles among random bodies are planned. The margins of each verified plan are
held against a judge of the tests that knows Pinocchio and coal alone: random displacements on the
very edge of a margin must leave all bodies apart, and a bisection along the worst direction says
how much of the true margin is proved.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import track

import selfmotion as sm

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from support.displaced import MISSED, Judge, random_displacement, worst_scale

ARMS = (("panda", "pose"), ("xarm7", "pose"), ("ur5", "pointing"))
# Times that the judge looks at, besides those that a margin names and their neighbours [s]; along
# the worst direction those alone.
LOOKS, NEAR = 40, np.array([-0.02, 0.0, 0.02])
# A true margin that is larger than this multiple of the proved one is not looked for.
MOST = 3.0


def random_path(rng: np.random.Generator, robot: sm.RobotModel) -> tuple[np.ndarray, sm.paths.Path]:
    """Return a configuration well within the limits, and a line or circle from there."""
    lower, upper = robot.finite_limits()
    start = lower + (upper - lower) * rng.uniform(0.25, 0.75, robot.dof)
    pose, seconds = robot.pose(start), float(rng.uniform(2.0, 5.0))
    if rng.random() < 0.5:
        end = pose.copy()
        end.translation = pose.translation + rng.normal(0.0, 0.1, 3)
        return start, sm.paths.Line(pose, end, seconds)
    radius = float(rng.uniform(0.03, 0.12))
    return start, sm.paths.Circle.around(pose, radius, seconds, normal=rng.normal(size=3))


def random_plan(rng: np.random.Generator, arms: list[tuple[sm.RobotModel, str]]) -> sm.Plan | None:
    """Return the plan of a random line or circle among bodies; None where there is none."""
    robot, task = arms[rng.integers(len(arms))]
    start, path = random_path(rng, robot)
    pose = path.pose(0.0)
    bodies: list[sm.obstacles.Obstacle] = []
    for number in range(int(rng.integers(1, 4))):
        away = rng.normal(size=3)
        place = pose.translation + rng.uniform(0.15, 0.4) * away / np.linalg.norm(away)
        kind, size = rng.integers(4), rng.uniform(0.03, 0.15)
        bodies.append(
            (
                sm.obstacles.Sphere(f"body{number}", place, float(size)),
                sm.obstacles.Box(f"body{number}", place, rng.uniform(0.05, 0.5, 3)),
                sm.obstacles.Cylinder(
                    f"body{number}", place, float(size), float(rng.uniform(0.1, 0.4))
                ),
                sm.obstacles.Capsule(
                    f"body{number}", place, float(size), float(rng.uniform(0.1, 0.4))
                ),
            )[kind]
        )
    try:
        problem = sm.Problem(
            robot,
            path,
            task,
            start,
            constraints=[
                sm.constraints.JointPositionLimits(),
                sm.constraints.JointVelocityLimits(),
            ],
            clearance=sm.constraints.Clearance(bodies, float(rng.uniform(2e-3, 2e-2))),
        )
        plan = sm.plan(problem, deadline=2.0)
    except sm.SelfmotionError:
        return None
    return plan if plan.certificate.verified else None


def main(
    count: Annotated[int, typer.Option(help="How many plans.")] = 200,
    displacements: Annotated[int, typer.Option(help="Of each plan, on the edge.")] = 50,
    seed: Annotated[int, typer.Option(help="Of the first plan.")] = 0,
) -> None:
    """Plan, bound, displace, and judge."""
    arms = [(sm.load_robot(name), task) for name, task in ARMS]
    failures, shares, seconds, made, number = [], {}, [], 0, seed
    for _ in track(range(count), "plans", console=Console(stderr=True)):
        plan = None
        while plan is None:
            rng = np.random.default_rng(number)
            plan, number = random_plan(rng, arms), number + 1
        begin = time.process_time()
        margins = sm.margin(plan)
        seconds.append(time.process_time() - begin)
        judge = Judge(plan)
        duration = plan.trajectory.duration
        named = [
            found.time
            for item in margins.subjects
            for _, found in item.rows
            if np.isfinite(found.time)
        ]
        t = np.concatenate([np.linspace(0.0, duration, LOOKS), np.add.outer(named, NEAR).ravel()])
        t = np.unique(np.clip(t, 0.0, duration))
        for k in range(displacements):
            subject = margins.subjects[k % 3]
            kind, found = list(subject.rows)[(k // 3) % 3]
            moved = random_displacement(rng, found.position, found.rotation)
            made += 1
            if judge.least(judge.moved_by(subject, *moved), t) < -MISSED:
                failures.append((number - 1, subject.name, kind))
        for subject in margins.subjects:
            for kind in ("translation", "rotation"):
                found = getattr(subject, kind)
                if found.direction is None or not max(found.position, found.rotation) > 0.0:
                    continue
                near = np.clip(found.time + NEAR, 0.0, duration)
                scale = worst_scale(judge, subject, kind, near, MOST)
                shares.setdefault((subject.name, kind), []).append(1.0 / scale)
    print(f"{made} displacements on the edge of margins of {count} plans: {len(failures)} failures")
    for failure in failures:
        print("  seed {}, {}, {}".format(*failure))
    every = np.concatenate(list(shares.values()))
    print(f"proved share of the true margin: median {np.median(every):.3f} of {len(every)}")
    for (name, kind), found in shares.items():
        low, middle = np.percentile(found, [10, 50])
        print(
            f"  {name}, {kind}: median {middle:.3f}, a tenth below {low:.3f}, {len(found)} margins"
        )
    print(f"median {np.median(seconds):.2f} s a plan, most {np.max(seconds):.2f} s")
    if failures:
        sys.exit(1)


if __name__ == "__main__":
    typer.run(main)

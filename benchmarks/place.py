"""Where to put the part: `make bench-place`.

`selfmotion.place` against an exhaustive grid of the box, each place of it planned on its own, on
random seams above a block that belongs to the part, beside a wall that does not. Times are those of
the processor, costs those of verified motions.
"""

from __future__ import annotations

import time
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import Progress

import selfmotion as sm
from selfmotion.placement.places import Places, places_of
from selfmotion.placement.search import Box

ARMS = (("panda", "pose"), ("xarm7", "pose"), ("ur5", "pointing"))
WITHIN = {"x": (-0.2, 0.2), "y": (-0.25, 0.25), "yaw": (-0.6, 0.6)}
# How many places of the grid there are in x, y and yaw.
GRID = (10, 10, 4)


def random_problem(rng: np.random.Generator) -> sm.Problem:
    """Return a seam of which a motion is known where it stands."""
    while True:
        name, task = ARMS[rng.integers(len(ARMS))]
        robot = sm.load_robot(name)
        lower, upper = robot.finite_limits()
        q = robot.dexterous_configuration(task) + rng.uniform(-0.3, 0.3, robot.dof)
        pose = robot.pose(np.clip(q, lower, upper))
        end = pose.copy()
        way = rng.normal(size=3) * [1.0, 1.0, 0.2]
        end.translation = pose.translation + rng.uniform(0.1, 0.3) * way / np.linalg.norm(way)
        seam = sm.paths.Line(pose, end, float(rng.uniform(3.0, 6.0)))
        middle = 0.5 * (pose.translation + end.translation)
        block = sm.obstacles.Box("block", middle - [0.0, 0.0, 0.15], [0.15, 0.15, 0.05])
        wall = sm.obstacles.Box("wall", [middle[0] + 0.35, 0.0, middle[2]], [0.02, 1.0, 0.4])
        limits = [sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()]
        clear = sm.constraints.Clearance([block, wall], 5e-3)
        problem = sm.Problem(robot, seam, task, constraints=[*limits, clear])
        try:
            if sm.plan(problem, deadline=5.0).certificate.verified:
                return problem
        except sm.SelfmotionError:
            continue


def best_of_grid(places: Places, box: Box, told: Progress) -> tuple[float, int]:
    """Return the least cost of all places of the grid, and how many have a verified motion."""
    best, sound = np.inf, 0
    axes = [np.linspace(*ends, n) for *ends, n in zip(box.low, box.high, GRID, strict=True)]
    every = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(GRID))
    for place in told.track(every.tolist(), description="grid"):
        (problem,) = places.at(np.array(place))
        try:
            plan = sm.plan(problem)
        except sm.SelfmotionError:
            continue
        if plan.certificate.verified:
            best, sound = min(best, plan.report.cost), sound + 1
    return best, sound


def main(
    count: Annotated[int, typer.Option(help="How many problems.")] = 10,
    seed: Annotated[int, typer.Option(help="Of the problems.")] = 0,
) -> None:
    """Place each, search each grid, and compare."""
    rng, console = np.random.default_rng(seed), Console(stderr=True)
    ratios, shares = [], []
    with Progress(console=console, transient=True) as told:
        for number in range(count):
            problem = random_problem(rng)
            begin = time.process_time()
            found = sm.place(problem, WITHIN, part=["block"])
            placed = time.process_time() - begin
            names = tuple(WITHIN)
            box = Box(*np.array([WITHIN[name] for name in names]).T)
            begin = time.process_time()
            best, sound = best_of_grid(
                places_of([problem], "part", ["block"], None, names), box, told
            )
            searched = time.process_time() - begin
            ratios.append(found.cost / best)
            shares.append(placed / searched)
            print(
                f"{number} {problem.robot.name}: placed at {found.cost:.5g}, grid {best:.5g} "
                f"({sound} of {np.prod(GRID)} verified): ratio {ratios[-1]:.4f}; {placed:.1f} s "
                f"against {searched:.0f} s: {shares[-1]:.1%}",
                flush=True,
            )
    print(
        f"cost of the place found, against the best of {np.prod(GRID)}: median "
        f"{np.median(ratios):.4f}, worst {np.max(ratios):.4f}; time: median "
        f"{np.median(shares):.1%}, worst {np.max(shares):.1%}"
    )


if __name__ == "__main__":
    typer.run(main)

"""How near free starts come to the best that is known: `python benchmarks/starts.py`.

Random paths of a Panda, an xArm 7 and a pointing UR5, the cost ∫ ½|q̇|² + μ/det(JJᵀ) dt with three
values of μ. The default search is held against the best of everything tried: itself, 200 starts
that are all optimised, and, for redundancy 1, the global search.
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
from selfmotion.basics import write_csv

ARMS = (("panda", "pose"), ("xarm7", "pose"), ("ur5", "pointing"))
# Of μ/det(JJᵀ), in shares of what ½|q̇|² costs: none, as much, and much more.
SHARES = (0.0, 1.0, 10.0)
# Starts of the reference, all of them optimised.
MANY = 200
# A plan is as good as the best when it costs no more than this share above it.
AS_GOOD, WANTED_SHARE = 0.01, 0.95


def random_problem(number: int) -> sm.Problem:
    """Return a path that small joint moves draw, so that it can be followed."""
    rng = np.random.default_rng(number)
    name, task = ARMS[number % len(ARMS)]
    robot = sm.load_robot(name)
    lower, upper = robot.finite_limits()
    while True:
        q = lower + (upper - lower) * rng.uniform(0.2, 0.8, robot.dof)
        pose = robot.pose(q)
        if np.linalg.svd(robot.task_jacobian(q, sm.Task.of(task)))[1][-1] > 0.05:
            break
    if rng.integers(2):
        normal = rng.normal(size=3)
        path: sm.paths.Path = sm.paths.Circle.around(
            pose, rng.uniform(0.03, 0.12), 4.0, normal=normal
        )
    else:
        moves = np.cumsum(rng.uniform(-0.25, 0.25, (3, robot.dof)), axis=0)
        poses = [pose, *(robot.pose(x) for x in np.clip(q + moves, lower, upper))]
        path = sm.paths.Waypoints.from_poses(np.linspace(0.0, 4.0, 4), poses)
    share = SHARES[number // len(ARMS) % len(SHARES)]
    costs: list[sm.costs.Cost] = [sm.costs.JointVelocity()]
    if share:
        # μ such that the term costs about its share of a usual motion's speed, at a dexterous pose.
        best = robot.task_jacobian(robot.dexterous_configuration(task), sm.Task.of(task))
        costs.append(
            sm.costs.InverseManipulability(share * 0.1 * float(np.linalg.det(best @ best.T)))
        )
    return sm.Problem(robot, path, task, costs=costs)


def attempt(problem: sm.Problem, search: sm.Search) -> tuple[float, float]:
    """Return the cost (inf for no motion that keeps everything) and the processor time [s]."""
    began = time.process_time()
    try:
        found = sm.plan(problem, search=search)
    except sm.SelfmotionError:
        return np.inf, time.process_time() - began
    cost = found.report.cost if found.certificate.verified else np.inf
    return cost, time.process_time() - began


def main(
    count: Annotated[int, typer.Option(help="How many paths.")] = 60,
    seed: Annotated[int, typer.Option(help="Of the first path.")] = 0,
    out: Annotated[Path, typer.Option(help="Where the costs go.")] = Path("out/starts.csv"),
) -> None:
    """Compare, write the costs of every path, and tell how often the default is as good."""
    console, rows = Console(), []
    # So that compiling is nobody's time.
    attempt(random_problem(seed), sm.Search())
    for number in track(range(seed, seed + count), "paths", console=console, transient=True):
        problem = random_problem(number)
        default, seconds = attempt(problem, sm.Search())
        many, _ = attempt(problem, sm.Search(mode="local", starts=MANY, finalists=MANY))
        whole = np.inf
        if problem.robot.redundancy(problem.task) == 1:
            whole, _ = attempt(problem, sm.Search(mode="global"))
        best = min(default, many, whole)
        if not np.isfinite(best):
            console.print(f"{number:3d} {problem.robot.name:8s} no motion at all", highlight=False)
            continue
        above = default / best - 1.0
        rows.append([number, default, many, whole, above, seconds])
        console.print(
            f"{number:3d} {problem.robot.name:6s} default {default:.4f}, {MANY} starts {many:.4f}, "
            f"global {whole:.4f}: {100 * above:+.2f} %, {seconds:.2f} s",
            highlight=False,
        )
    write_csv(out, ["path", "default", "many", "global", "above", "seconds"], np.array(rows))
    excess, seconds_each = np.array(rows)[:, 4:].T
    share = float(np.mean(excess <= AS_GOOD))
    console.print(
        f"{len(rows)} paths of {count} with a motion: for {100 * share:.1f} % within "
        f"{100 * AS_GOOD:g} % of the best; processor time "
        f"{np.median(seconds_each):.2f} s (median), {seconds_each.max():.2f} s (most)"
    )
    sys.exit(0 if share >= WANTED_SHARE else 1)


if __name__ == "__main__":
    typer.run(main)

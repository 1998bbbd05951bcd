"""Jobs of which a seam was added, removed or moved, planned again: `make bench NAME=kept`.

100 random jobs of two to six seams on a block, for three arms. Each is planned, saved and loaded;
then a seam is added, removed or moved, or the job is left as it is, and it is planned again from
what was loaded. Every seam of which the same is asked has to be kept bit for bit, and the program
has to say so; it prints each that is not, with what the program says of it.
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

import selfmotion as sm
from selfmotion.model.task import SE3

ARMS = ("panda", "xarm7", "ur10")
CHANGES = ("added", "removed", "moved", "none")
# Of the block [m], how high above it seams are, and how far one is moved at most [m].
SIZE, ABOVE, FAR = (0.2, 0.2, 0.16), 0.02, 0.03
DOWN = np.diag([1.0, -1.0, -1.0])


def seam(name: str, rng: np.random.Generator, middle: np.ndarray) -> sm.Seam:
    """Return a line above the block."""
    ends = rng.uniform(-0.1, 0.1, (2, 2))
    poses = [SE3(DOWN, middle + np.array([*end, 0.5 * SIZE[2] + ABOVE])) for end in ends]
    seconds = float(rng.uniform(1.0, 3.0))
    line = sm.paths.Line(*poses, seconds, time_law="minimum_jerk")
    return sm.Seam(name, line, "pointing", either_way=bool(rng.uniform() < 0.8))


def job(number: int) -> tuple[sm.RobotModel, list[sm.Seam], sm.constraints.Clearance]:
    """Return an arm, seams on a block, and what stands there."""
    rng = np.random.default_rng([31, number])
    middle = np.array([0.5, 0.0, 0.2]) + rng.uniform(-0.05, 0.05, 3)
    seams = [seam(f"seam {k}", rng, middle) for k in range(int(rng.integers(2, 7)))]
    block = sm.obstacles.Box("block", SE3(np.eye(3), middle), SIZE)
    post = sm.obstacles.Cylinder("post", [0.55, float(rng.uniform(0.3, 0.4)), 0.3], 0.03, 0.6)
    apart = sm.constraints.Clearance((block, post), distance=0.003)
    return sm.load_robot(ARMS[number % len(ARMS)]), seams, apart


def changed(number: int, seams: list[sm.Seam]) -> tuple[str, list[sm.Seam], set[str]]:
    """Return what was changed, the seams then, and the names of those that are as they were."""
    rng = np.random.default_rng([37, number])
    change, k = CHANGES[(number // len(ARMS)) % len(CHANGES)], int(rng.integers(len(seams)))
    others = [*seams[:k], *seams[k + 1 :]]
    same = {item.name for item in others}
    if change == "removed" and others:
        return change, others, same
    if change == "added":
        middle = seams[k].path.pose(0.0).translation - np.array([0.0, 0.0, 0.5 * SIZE[2] + ABOVE])
        more = seam("more", rng, middle)
        return change, [*seams[:k], more, *seams[k:]], same | {seams[k].name}
    if change == "moved":
        shift = SE3(np.eye(3), np.append(rng.uniform(-FAR, FAR, 2), 0.0))
        ends = [shift * seams[k].path.pose(t) for t in (0.0, seams[k].path.duration)]
        line = sm.paths.Line(*ends, seams[k].path.duration, time_law="minimum_jerk")
        return change, [*seams[:k], replace(seams[k], path=line), *seams[k + 1 :]], same
    return "none", seams, same | {seams[k].name}


def is_same(one: sm.Plan, other: sm.Plan) -> bool:
    """Whether two plans have the same motion, bit for bit."""
    pairs = ((getattr(plan.trajectory, part) for plan in (one, other)) for part in ("t", "q", "qd"))
    return all(np.array_equal(*pair) for pair in pairs)


def main(
    count: Annotated[int, typer.Option(help="How many jobs.")] = 100,
    first: Annotated[int, typer.Option(help="Number of the first one.")] = 0,
) -> None:
    """Plan the jobs, change them, and plan them again."""
    console = Console()
    kept, seams_asked, exceptions, untold, lost, counted = 0, 0, 0, 0, 0, 0
    ratios = list[float]()
    for number in range(first, first + count):
        robot, seams, apart = job(number)
        given = {"clearance": apart, "start": robot.dexterous_configuration(), "branches": 2}
        began = time.process_time()
        before = sm.plan_job(robot, seams, **given)
        cold = time.process_time() - began
        change, others, same = changed(number, seams)
        told = f"{number:3d} {robot.name:6s} {len(seams)} seams, {change:7s}"
        if not before.verified:
            console.print(f"{told} not verified: {before.summary}", highlight=False, soft_wrap=True)
            continue
        counted += 1
        with tempfile.TemporaryDirectory() as folder:
            before.save(Path(folder, "job.program"))
            loaded = sm.load_program(Path(folder, "job.program"))
        began = time.process_time()
        again = sm.plan_job(robot, others, warm_start=loaded, **given)
        ratios.append((time.process_time() - began) / cold)
        lost += not again.verified
        wrong = []
        for name in sorted(same & again.plans.keys()):
            seams_asked += 1
            as_before = is_same(again.plans[name], before.plans[name])
            kept += as_before
            untold += as_before != (again.kept[name] == "")
            if not as_before:
                wrong.append(f"'{name}': {again.kept[name]}")
        exceptions += len(wrong)
        console.print(
            f"{told} {cold:5.1f} s, again {ratios[-1]:.2f} ×"
            f"{'' if again.verified else f', LOST: {again.summary}'}"
            f"{'' if not wrong else f', NOT KEPT: {wrong}'}",
            highlight=False,
            soft_wrap=True,
        )
    console.print(
        f"{counted} jobs, {lost} not verified again; of {seams_asked} seams that did not change "
        f"{kept} kept bit for bit, {exceptions} exceptions, {untold} said wrongly; time "
        f"{np.median(ratios):.2f} × in the median",
        highlight=False,
        soft_wrap=True,
    )
    sys.exit(1 if exceptions or untold or lost else 0)


if __name__ == "__main__":
    typer.run(main)

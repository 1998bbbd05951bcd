"""Random jobs whose seams leave posts where others are: `make bench NAME=fuzz-job`.

Every program is looked at anew: what stands there by then is measured at many times of each step,
the order is held against what has to come first, and each seam is made once or named.
"""

from __future__ import annotations

import sys
import time
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

import selfmotion as sm
from selfmotion.model.task import SE3

# Looks at each step; distances may be off by rounding [m].
LOOKS, ROUNDING = 400, 1e-9
# Of seams, how many leave a post, and come after another one.
LEAVES, AFTER = 0.7, 0.2


def seams(number: int) -> list[sm.Seam]:
    """Return 4 to 7 short lines in front of a Panda, and posts that stand near some of them."""
    rng = np.random.default_rng(number)
    down = np.diag([1.0, -1.0, -1.0])
    first = rng.uniform([0.35, -0.35, 0.2], [0.6, 0.35, 0.45], (int(rng.integers(4, 8)), 3))
    last = first + rng.uniform(-0.08, 0.08, first.shape)
    found = []
    for k, (begin, end) in enumerate(zip(first, last, strict=True)):
        leaves = []
        if rng.uniform() < LEAVES:
            near = int(rng.integers(len(first)))
            place = 0.5 * (first[near] + last[near]) + rng.uniform(-0.12, 0.12, 3)
            leaves = [sm.obstacles.Box(f"post {k}", place, rng.uniform(0.02, 0.1, 3))]
        after = [f"seam {rng.integers(k)}"] if k and rng.uniform() < AFTER else []
        line = sm.paths.Line(SE3(down, begin), SE3(down, end), 2.0, time_law="minimum_jerk")
        found.append(sm.Seam(f"seam {k}", line, "pointing", leaves=leaves, after=after))
    return found


def wrong(program: sm.Program, asked: list[sm.Seam]) -> str:
    """Return what is wrong with a program that says that it is verified so far; "" for nothing."""
    names = {seam.name: seam for seam in asked}
    if sorted([*program.order, *program.missing]) != sorted(names):
        return "seams are lost, or made twice"
    standing: list[sm.obstacles.Obstacle] = []
    made: set[str] = set()
    for step in program.steps:
        motion = step.motion
        model = sm.obstacles.CollisionModel(program.robot, tuple(standing))
        times = np.linspace(motion.t[0], motion.t[-1], LOOKS)
        least = model.worst(motion(times))
        if least.value < -ROUNDING:
            return f"'{step.name}': {least.first} - {least.second} {1e3 * least.value:.3f} mm"
        if step.is_seam:
            if not made.issuperset(names[step.name].after):
                return f"'{step.name}' comes too early"
            made.add(step.name)
            standing += names[step.name].leaves
    return ""


def main(
    count: Annotated[int, typer.Option(help="How many jobs.")] = 40,
    seed: Annotated[int, typer.Option(help="Of the first one.")] = 0,
) -> None:
    """Plan the jobs, and look at each program."""
    console, arm = Console(), sm.load_robot("panda")
    whole, missing, faults, seconds = 0, 0, 0, []
    for number in range(seed, seed + count):
        asked, began = seams(number), time.process_time()
        home = sm.NAMED_ARMS["panda"].home
        program = sm.plan_job(arm, asked, branches=2, move_seconds=2.0, start=home)
        seconds.append(time.process_time() - began)
        fault = wrong(program, asked)
        whole, missing = whole + program.verified, missing + len(program.missing)
        faults += bool(fault)
        console.print(
            f"{number:3d} {len(program.order)} of {len(asked)} seams, moves "
            f"{program.transfer_time:.2f} s, {seconds[-1]:.1f} s {fault}",
            highlight=False,
        )
    console.print(
        f"{count} jobs: {whole} made whole, {missing} seams named as missing in the others, "
        f"{faults} wrong; {np.median(seconds):.1f} s of the processor in the median"
    )
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    typer.run(main)

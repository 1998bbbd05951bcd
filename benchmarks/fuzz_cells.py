"""Cells made at random: `python benchmarks/fuzz_cells.py`.

Two chains of two to seven joints on one body, what they follow being one tip or two, in the world
or in frames that move. Each is planned; each verified plan is judged by kinematics that share no
code with the planner, of the tree as it stands: where every tip is in its reference frame, at a
hundred times between samples. Times are those of the processor.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.progress import track

import selfmotion as sm
from selfmotion.basics import Array

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from support.own_kinematics import Arm, along
from support.random_cells import LEFT, RIGHT, random_cell, random_follows

# Looks between two samples.
LOOKS = 100


def misses(plan: sm.Plan) -> list[tuple[float, float]]:
    """Return by how much each tip is off its path at most [m], [rad], by yourdfpy's tree."""
    arm, motion = Arm(plan.robot), plan.trajectory
    shares = np.arange(LOOKS) / LOOKS
    t = (motion.t[:-1, None] + np.diff(motion.t)[:, None] * shares).ravel()
    q, frames = along(motion, t, 0), plan.robot.model.frames
    found = []
    for item in plan.problem.follows.items:
        turn, at = arm.place(item.chain.tip_name, q)
        if item.chain.base:
            base, origin = arm.place(frames[item.chain.base].name, q)
            at = np.einsum("kji,kj->ki", base, at - origin)
            turn = np.einsum("kji,kjl->kil", base, turn)
        found.append(_missed(item.task, item.path.samples(t), turn, at))
    return found


def _missed(
    task: sm.Task, target: sm.paths.PathSamples, turn: Array, at: Array
) -> tuple[float, float]:
    linear = task.rows[task.rows < 3]
    position = np.linalg.norm((at - target.translation)[:, linear], axis=1).max(initial=0.0)
    if not task.angular:
        return float(position), 0.0
    apart = target.rotation - turn
    chord = (
        np.linalg.norm(apart[:, :, 2], axis=1)
        if task.tool_axes
        else (np.linalg.norm(apart, axis=(1, 2)) / np.sqrt(2.0))
    )
    return float(position), float(2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0)).max())


def main(
    count: Annotated[int, typer.Option(help="How many cells.")] = 200,
    seed: Annotated[int, typer.Option(help="Of the first one.")] = 0,
) -> None:
    """Plan, judge, and count."""
    ended: Counter[str] = Counter()
    seconds, false = [], []
    with tempfile.TemporaryDirectory() as folder:
        for number in track(range(seed, seed + count), "cells"):
            rng = np.random.default_rng(number)
            robot = sm.load_robot(random_cell(rng, Path(folder)), tool=(LEFT, RIGHT))
            items, _, start = random_follows(rng, robot)
            given = start if rng.random() < 0.5 else None
            begin = time.process_time()
            try:
                problem = sm.Problem(robot, items, start=given)
                plan = sm.plan(problem)
            except sm.SelfmotionError as error:
                ended[type(error).__name__] += 1
                continue
            seconds.append(time.process_time() - begin)
            ended["verified" if plan.certificate.verified else "not verified"] += 1
            if plan.certificate.verified:
                allowed = plan.tolerance
                for position, rotation in misses(plan):
                    if position > allowed.position or rotation > allowed.rotation:
                        false.append(number)
    for what, often in ended.most_common():
        print(f"{what}: {often}")
    print(f"verified though off a path: {len(false)} {false}")
    print(f"seconds: {np.median(seconds):.2f} in the median, {np.max(seconds):.1f} at most")
    sys.exit(1 if false else 0)


if __name__ == "__main__":
    typer.run(main)

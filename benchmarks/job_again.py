"""Jobs planned again with the part moved by up to 50 mm and 5°: `make bench-again`.

Ten jobs of 5 to 8 seams among posts that stay, of a Panda and a UR5. Each is planned from nothing
with the part moved, and with `begin_with` the program of where it was: how much less time of the
processor that takes, whether both are verified, and how long the programs are.
"""

from __future__ import annotations

import sys
import time
from typing import Annotated

import numpy as np
import typer

import selfmotion as sm
from selfmotion.task import SE3, exp3

# How far the part is moved at most [m, rad], and what the median ratio of times should be.
MOVED, TURNED, ASKED = 0.05, np.radians(5.0), 0.4
DOWN = np.diag([1.0, -1.0, -1.0])


def job(number: int, place: SE3) -> tuple[sm.RobotModel, list[sm.Seam], dict]:
    """Return an arm, seams on a part at a place, and what else the job asks for."""
    rng = np.random.default_rng(number)
    robot = sm.load_robot(("panda", "ur5")[number % 2])
    count = int(rng.integers(5, 9))
    first = rng.uniform([-0.1, -0.2, 0.0], [0.1, 0.2, 0.15], (count, 3))
    last = first + rng.uniform(-0.08, 0.08, first.shape)
    seams = []
    for k, (begin, end) in enumerate(zip(first, last, strict=True)):
        ends = (place * SE3(DOWN, begin), place * SE3(DOWN, end))
        line = sm.Line(*ends, 2.0, time_law="minimum_jerk")
        seams.append(sm.Seam(f"seam {k}", line, "pointing"))
    posts = [
        sm.Box(f"post {k}", [0.5, side, 0.1], [0.04, 0.04, 0.2])
        for k, side in enumerate((-0.45, 0.45))
    ]
    asked = {
        "clearance": sm.Clearance(posts, 0.01),
        "constraints": (
            sm.JointPositionLimits(),
            sm.JointVelocityLimits(),
            sm.JointAccelerationLimits(8.0),
        ),
    }
    return robot, seams, asked


def moved(place: SE3, rng: np.random.Generator) -> SE3:
    """Return a place up to so far from another one."""
    way, turn = rng.normal(size=3), rng.normal(size=3)
    way *= MOVED * rng.uniform() / np.linalg.norm(way)
    turn *= TURNED * rng.uniform() / np.linalg.norm(turn)
    return SE3(exp3(turn) @ place.rotation, place.translation + way)


def timed(number: int, place: SE3, before: sm.Program | None = None) -> tuple[sm.Program, float]:
    """Return a program, and the time of the processor that it took [s]."""
    robot, seams, asked = job(number, place)
    began = time.process_time()
    program = sm.plan_job(robot, seams, begin_with=before, **asked)
    return program, time.process_time() - began


def main(number: Annotated[int, typer.Option(help="How many jobs.")] = 10) -> None:
    """Print a row for each, and exit with 1 where something is not as it should be."""
    print("job  seams  anew [s]  from before [s]  ratio  verified  program [s]  from before [s]")
    ratios, wrong = [], 0
    # What is compiled on first use is no part of it.
    timed(0, SE3(np.eye(3), np.array([0.5, 0.0, 0.25])))
    for k in range(number):
        place = SE3(np.eye(3), np.array([0.5, 0.0, 0.25]))
        before, _ = timed(k, place)
        there = moved(place, np.random.default_rng(1000 + k))
        anew, cold = timed(k, there)
        again, warm = timed(k, there, before)
        ratios.append(warm / cold)
        wrong += anew.verified and not again.verified
        print(
            f"{k:3}  {len(again.order):5}  {cold:8.2f}  {warm:15.2f}  {warm / cold:5.2f}  "
            f"{anew.verified!s:>5}/{again.verified!s}  {anew.duration:9.2f}  "
            f"{again.duration:12.2f}",
            flush=True,
        )
    median = float(np.median(ratios))
    print(f"median ratio {median:.2f}, asked at most {ASKED}; {wrong} verified only anew")
    sys.exit(int(wrong > 0 or median > ASKED))


if __name__ == "__main__":
    typer.run(main)

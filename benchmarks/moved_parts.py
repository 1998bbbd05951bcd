"""Jobs whose part was moved, planned again from the program that is kept: `make bench NAME=moved`.

30 jobs of two to four seams on a block, with a post beside it, for three arms. Each is planned,
then the block is moved by up to 50 mm and turned by up to 5°, and the job is planned again: from
nothing, and from the program. Prints for each the times of the processor and their ratio, how long
both programs last, and what both motions of the seams cost. A moved job that cannot be made from
nothing either does not count.
"""

from __future__ import annotations

import sys
import time
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.task import SE3, rpy

ARMS = ("panda", "xarm7", "ur10")
# How far parts are moved [m] and turned [rad] at most.
FAR, TURNED = 0.05, np.radians(5.0)
# Of the block [m], and how high above it seams are.
SIZE, ABOVE = (0.2, 0.2, 0.16), 0.02


def job(number: int, place: SE3) -> tuple[sm.RobotModel, list[sm.Seam], sm.constraints.Clearance]:
    """Return an arm, seams on a block at a place, and what stands there."""
    rng = np.random.default_rng([17, number])
    robot = sm.load_robot(ARMS[number % len(ARMS)])
    down = np.diag([1.0, -1.0, -1.0])
    seams = []
    for k in range(int(rng.integers(2, 5))):
        ends = rng.uniform(-0.1, 0.1, (2, 2))
        poses = [place * SE3(down, np.array([*end, 0.5 * SIZE[2] + ABOVE])) for end in ends]
        line = sm.paths.Line(
            poses[0], poses[1], float(rng.uniform(2.0, 4.0)), time_law="minimum_jerk"
        )
        seams.append(sm.Seam(f"seam {k}", line, "pointing", either_way=bool(rng.integers(2))))
    post = sm.obstacles.Cylinder("post", [0.55, float(rng.uniform(0.3, 0.4)), 0.3], 0.03, 0.6)
    block = sm.obstacles.Box("block", place, SIZE)
    return robot, seams, sm.constraints.Clearance((block, post), distance=0.003)


def placed(number: int, moved: bool) -> SE3:
    """Return where the block of a job stands, before or after it was moved."""
    rng = np.random.default_rng([23, number])
    middle = np.array([0.5, 0.0, 0.2]) + rng.uniform(-0.05, 0.05, 3)
    first = SE3(rpy.rpyToMatrix(0.0, 0.0, float(rng.uniform(-0.5, 0.5))), middle)
    if not moved:
        return first
    way, axis = rng.normal(size=(2, 3))
    far, turned = rng.uniform(0.0, FAR), rng.uniform(0.0, TURNED)
    # About the block's middle, upright or nearly so.
    turn = _turn(turned * axis / np.linalg.norm(axis))
    shift = SE3(np.eye(3), far * way / np.linalg.norm(way))
    return shift * first * SE3(turn, np.zeros(3))


def _turn(vector: Array) -> Array:
    """Return the rotation (3, 3) about a vector by its length [rad]."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(vector).as_matrix())


def _costs(program: sm.Program) -> float:
    return sum(plan.report.cost for plan in program.plans.values())


def main(
    count: Annotated[int, typer.Option(help="How many jobs.")] = 30,
) -> None:
    """Plan the jobs, and those whose part was moved."""
    console = Console()
    ratios, lasts, costs, lost, counted = [], [], [], 0, 0
    for number in range(count):
        robot, seams, apart = job(number, placed(number, moved=False))
        home = robot.dexterous_configuration()
        first = sm.plan_job(robot, seams, clearance=apart, start=home, end=home)
        _, seams, apart = job(number, placed(number, moved=True))
        programs, seconds = list[sm.Program](), list[float]()
        for known in (None, first):
            began = time.process_time()
            programs.append(
                sm.plan_job(robot, seams, clearance=apart, start=home, end=home, warm_start=known)
            )
            seconds.append(time.process_time() - began)
        cold, again = programs
        told = f"{number:2d} {robot.name:6s} {len(seams)} seams: "
        if not (cold.verified and first.verified):
            console.print(f"{told}not verified from nothing", highlight=False)
            continue
        counted += 1
        lost += not again.verified
        ratios.append(seconds[1] / seconds[0])
        lasts.append(again.duration / cold.duration)
        costs.append(_costs(again) / _costs(cold))
        console.print(
            f"{told}{seconds[0]:5.1f} s, again {seconds[1]:5.1f} s ({ratios[-1]:.2f} ×), "
            f"lasts {lasts[-1]:.4f} ×, costs {costs[-1]:.4f} ×"
            f"{'' if again.verified else f', LOST: {again.verdict}'}",
            highlight=False,
            soft_wrap=True,
        )
    console.print(
        f"{counted} jobs, {lost} lost; time {np.median(ratios):.2f} × in the median, "
        f"{max(ratios):.2f} × at most; lasts {np.median(lasts):.4f} × and {max(lasts):.4f} ×, "
        f"costs {np.median(costs):.4f} × and {max(costs):.4f} ×",
        highlight=False,
        soft_wrap=True,
    )
    sys.exit(1 if lost else 0)


if __name__ == "__main__":
    typer.run(main)

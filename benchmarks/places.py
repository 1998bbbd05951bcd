"""A seam at many places around three arms: what is planned, and how fast a 'no' comes.

`make bench NAME=places`. Each place is drawn at random, near and far, with and without relaxations,
and with bodies in some; many are bad, as they are when a cell is laid out. A 'yes' is a verified
plan; a 'no' is held against an exhaustive search that shares nothing with the product's
(`places_truth.py`).
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import pinocchio as pin
import typer
from places_truth import Truth, truth_of
from rich.console import Console
from rich.progress import track

import selfmotion as sm
from selfmotion.basics import write_csv
from selfmotion.problem.constraints import NO_OVERLAP

ARMS = (("panda", "pose"), ("xarm7", "pointing"), ("ur5", "pointing"))
# Distances of the seam's middle from the arm's axis, in shares of its reach, and heights [m].
FAR, HIGH = (0.2, 0.65), (-0.1, 0.7)
# What a relaxed seam allows: a cone about the torch [rad], and its stick-out [m].
CONE, STICK_OUT = np.radians(10.0), 3e-3
# Of an arm among bodies [m].
CLEARANCE = 2e-3
DURATION = 6.0
# A 'no' is quick within this [s of the processor]; so many of them should be.
QUICK, WANTED = 0.5, 0.9


@dataclass(frozen=True)
class Answer:
    """What a plan of a place came to.

    Attributes
    ----------
    verified : bool
    why : str
        Of a 'no', what was said.
    seconds : float
        Of the processor, until all that can be planned was.
    said : float
        Likewise until a 'no' was first said: by the plan's progress, or the answer itself.
    """

    verified: bool
    why: str
    seconds: float
    said: float


def seam(rng: np.random.Generator) -> list[pin.SE3]:
    """Return poses of a torch along a seam in the part's frame, z into the part."""
    length, bend = rng.uniform(0.15, 0.35), rng.choice([0.0, rng.uniform(0.3, 1.2)])
    torch = pin.utils.rotate("x", np.pi) @ pin.utils.rotate("y", rng.uniform(-0.4, 0.4))
    poses = []
    for s in np.linspace(-0.5, 0.5, 7):
        turn = pin.utils.rotate("z", bend * s)
        place = length * np.array([s, 0.5 * bend * s * s, 0.0])
        poses.append(pin.SE3(turn @ torch, place))
    return poses


def part_at(robot: sm.RobotModel, rng: np.random.Generator) -> pin.SE3:
    """Return a place of the part, tilted by up to a right angle."""
    angle, far = rng.uniform(-np.pi, np.pi), robot.reach * rng.uniform(*FAR)
    position = np.array([far * np.cos(angle), far * np.sin(angle), rng.uniform(*HIGH)])
    tilt = pin.utils.rotate("x", rng.uniform(-1.0, 1.0)) @ pin.utils.rotate("y", rng.uniform(-1, 1))
    return pin.SE3(pin.utils.rotate("z", rng.uniform(-np.pi, np.pi)) @ tilt, position)


def bodies(part: pin.SE3, rng: np.random.Generator) -> list[sm.obstacles.Obstacle]:
    """Return what stands at a part: a plate under the seam, and a post beside it."""
    side, along = rng.choice([-1.0, 1.0]) * rng.uniform(0.06, 0.2), rng.uniform(-0.2, 0.2)
    high = rng.uniform(0.05, 0.4)
    plate = part * pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.03]))
    post = part * pin.SE3(np.eye(3), np.array([along, side, 0.5 * high]))
    return [
        sm.obstacles.Box("plate", plate, [0.5, 0.3, 0.04]),
        sm.obstacles.Box("post", post, [0.05, 0.05, high]),
    ]


def place(number: int) -> sm.Problem:
    """Return a seam at one of the places."""
    rng = np.random.default_rng(number)
    name, task = ARMS[number % 3]
    robot = sm.load_robot(name)
    part = part_at(robot, rng)
    poses = [part * pose for pose in seam(rng)]
    path = sm.paths.Waypoints.from_poses(np.linspace(0.0, DURATION, len(poses)), poses)
    constraints: list[sm.constraints.Constraint] = [
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
    ]
    apart = NO_OVERLAP
    if number // 6 % 2:
        apart = sm.constraints.Clearance(bodies(part, rng), CLEARANCE)
    relaxed = number // 3 % 2
    relaxations = [
        sm.Relaxation(("rx", "ry"), float(CONE)),
        sm.Relaxation("z", STICK_OUT, axes="tool"),
    ]
    return sm.Problem(
        robot,
        path,
        task,
        constraints=constraints,
        clearance=apart,
        relaxations=relaxations if relaxed else (),
    )


def answer(problem: sm.Problem) -> Answer:
    """Return what a plan comes to."""
    news: list[float] = []

    def progress(stage: str, done: int, total: int) -> None:
        if total == 0:
            news.append(time.process_time() - began)

    began = time.process_time()
    try:
        found = sm.plan(problem, progress=progress)
    except sm.SelfmotionError as error:
        seconds = time.process_time() - began
        return Answer(False, str(error), seconds, min([*news, seconds]))
    seconds = time.process_time() - began
    good = found.certificate.verified
    why = "" if good else found.certificate.verdict
    return Answer(good, why, seconds, min([*news, seconds]))


def main(
    count: Annotated[int, typer.Option(help="How many places.")] = 300,
    seed: Annotated[int, typer.Option(help="Of the first place.")] = 0,
    truth: Annotated[bool, typer.Option(help="Hold each 'no' against the truth.")] = True,
    out: Annotated[Path, typer.Option(help="Where the answers go.")] = Path("out/places.csv"),
) -> None:
    """Plan at every place, and tell how often a 'yes' is missed and how fast a 'no' is."""
    console, rows = Console(), []
    # So that compiling is nobody's time.
    for number in range(min(12, count)):
        answer(place(number))
    for number in track(range(seed, seed + count), "places", console=console, transient=True):
        problem = place(number)
        said = answer(problem)
        known = Truth.MOTION if said.verified else Truth.UNKNOWN
        if truth and not said.verified:
            known = truth_of(problem)
        rows.append([number, said.verified, known.value, said.seconds, said.said])
        name = f"{problem.robot.name} {problem.task.value}"
        kind = f"{'relaxed ' * bool(problem.relaxations)}{'bodies' * (number // 6 % 2)}"
        console.print(
            f"{number:3d} {name:15s} {kind:14s} {'yes' if said.verified else 'no ':3s} "
            f"{said.said:6.2f} {said.seconds:6.2f} s  truth: {known.name.lower()}  {said.why}",
            highlight=False,
            markup=False,
            soft_wrap=True,
        )
    table = np.array(rows, dtype=np.float64)
    write_csv(out, ["place", "yes", "truth", "seconds", "said"], table)
    sys.exit(_told(console, table))


def _told(console: Console, table: np.ndarray) -> int:
    """Print the shares, and return the exit code."""
    yes, known, seconds = table[:, 1] > 0.0, table[:, 2], table[:, 3]
    missed = ~yes & (known == Truth.MOTION.value)
    # What is said on the way has to be true, too.
    taken_back = yes & (table[:, 4] < seconds)
    found = int(yes.sum()) / max(int((yes | missed).sum()), 1)
    no, whole = table[~yes & ~missed, 4], seconds[~yes & ~missed]
    quick = float(np.mean(no <= QUICK)) if len(no) else 1.0
    console.print(
        f"{len(table)} places: {int(yes.sum())} planned and verified, which is {100 * found:.1f} % "
        f"of those with a motion; {int(missed.sum())} times a wrong 'no', "
        f"{int(taken_back.sum())} times one that was taken back"
    )
    if len(no):
        console.print(
            f"{len(no)} times no motion: said within {QUICK} s for {100 * quick:.1f} %, "
            f"{np.median(no):.2f} s in the median, {no.max():.1f} s at most; with what can be "
            f"planned all the same {np.median(whole):.2f} s and {whole.max():.1f} s; a plan takes "
            f"{np.median(seconds[yes]) if yes.any() else np.nan:.2f} s in the median"
        )
    return 0 if found >= 0.99 and quick >= WANTED and not taken_back.any() else 1


if __name__ == "__main__":
    typer.run(main)

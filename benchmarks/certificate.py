"""Tries to refute certificates: `make bench NAME=fuzz-certificate`.

900 motions that are hard to judge: thin plates between samples, limits passed between samples,
noisy seams. An independent judge looks at 1,000 times per interval. No motion may be 'verified'
that it refutes; of those that are valid with 1 % to spare, 3 % may go unverified. Then the price
of proof: the time that a certificate takes, relative to a check at five times per interval.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import selfmotion as sm
from selfmotion.certificate import deviation_from
from selfmotion.certificate.path_error import smallest_singular_values
from selfmotion.model.follow import single_tip
from support.scenes import Scene, among_plates, carrying, near_limits, seams

REPEATS = 9
ARMS = ("panda", "xarm7", "kinova")


def made(maker: Callable[[int, Path], Scene], count: int, seed: int) -> Iterator[Scene]:
    """Yield scenes with arms of their own."""
    for number in range(seed, seed + count):
        with tempfile.TemporaryDirectory() as folder:
            yield maker(number, Path(folder))


def along_seams(count: int, seed: int) -> Iterator[Scene]:
    """Yield motions of named arms along seams."""
    robots = [sm.load_robot(name) for name in ARMS]
    starts = [robot.dexterous_configuration() for robot in robots]
    number = seed
    while count > 0:
        which = number % len(robots)
        found = seams(number, robots[which], starts[which])[:count]
        count, number = count - len(found), number + 1
        yield from found


def plain_check(plan: sm.Plan, model: sm.obstacles.CollisionModel | None) -> tuple[float, ...]:
    """Return what five times per interval say of errors, limits and clearance."""
    motion, robot = plan.trajectory, plan.robot
    shares = np.arange(5) / 5
    t = np.append((motion.t[:-1, None] + np.diff(motion.t)[:, None] * shares).ravel(), motion.t[-1])
    q, qd = motion(t), motion(t, order=1)
    follows = plan.problem.follows
    miss = deviation_from(single_tip(follows), t, q, False)
    found = [float(np.linalg.norm(part, axis=1).max()) for part in (miss[:, :3], miss[:, 3:])]
    found += [float(np.minimum(q - robot.lower, robot.upper - q).min())]
    found += [float((np.abs(qd) / robot.velocity_limit).max())]
    found += [float(smallest_singular_values(follows, q).min())]
    return (*found, model.worst(q).value) if model else tuple(found)


def seconds(action: Callable[[], object]) -> float:
    """Return the median time of an action."""
    times = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        action()
        times.append(time.perf_counter() - began)
    return float(np.median(times))


def prices() -> Iterator[tuple[str, float, float]]:
    """Yield (what, seconds of the plain check, seconds of the certificate)."""
    for name in ARMS:
        robot = sm.load_robot(name)
        start = robot.dexterous_configuration()
        path = sm.paths.Circle.around(robot.pose(start), 0.08, 6.0, normal=(1.0, 0.0, 0.0))
        plan = sm.plan(sm.Problem(robot, path, start=start, task=_task(robot)))
        box = sm.obstacles.Box(
            "box", robot.pose(start).translation + np.array([0.0, 0.0, 0.4]), [0.1] * 3
        )
        clearance = sm.constraints.Clearance([box], 1e-3)
        model = clearance.model(robot)
        for what, bodies, wanted in (
            (f"{name}, no bodies", None, ()),
            (f"{name} and a box", model, (clearance.requirement(robot),)),
        ):
            plain = seconds(lambda plan=plan, bodies=bodies: plain_check(plan, bodies))
            proved = seconds(
                lambda plan=plan, wanted=wanted: sm.certify(
                    plan.robot, plan.path, plan.task, plan.trajectory, requirements=wanted
                )
            )
            yield what, plain, proved


def _task(robot: sm.RobotModel) -> str:
    return "pose" if robot.redundancy("pose") else "position"


def main(
    count: Annotated[int, typer.Option(help="How many motions of each kind.")] = 300,
    seed: Annotated[int, typer.Option(help="Of the first one.")] = 0,
    kinds: Annotated[str, typer.Option(help="Which of them.")] = "plates,carried,limits,seams",
) -> None:
    """Make motions, certify and judge, tell counts and prices."""
    console, wrong = Console(), False
    makers = {
        "plates": lambda: made(among_plates, count, seed),
        "carried": lambda: made(carrying, count, seed),
        "limits": lambda: made(near_limits, count, seed),
        "seams": lambda: along_seams(count, seed),
    }
    for name in kinds.split(","):
        scenes = makers[name]()
        verified = valid = false = strict = 0
        for number, scene in enumerate(scenes):
            certificate, found = scene.certify(), scene.judge.judge(scene.motion)
            verified += certificate.verified
            valid += found.valid()
            line = ""
            if certificate.verified and found.refutes:
                false += 1
                line = f"FALSE {'; '.join(found.refutes)}"
            elif found.valid() and not certificate.verified:
                strict += 1
                line = f"STRICT {found.shares}"
            if line:
                text = f"{name} {number}: {line} | {certificate.verdict}"
                console.print(text, markup=False, soft_wrap=True)
        console.print(
            f"{name}: {count} motions, {verified} verified, {false} of them false; {valid} valid "
            f"with 1 % to spare, {strict} of them not verified",
            markup=False,
            soft_wrap=True,
        )
        wrong |= false > 0 or strict > 0.03 * valid
    for what, plain, proved in prices():
        console.print(
            f"{what}: {1e3 * proved:.1f} ms, {proved / plain:.2f} times {1e3 * plain:.1f} ms"
        )
    sys.exit(int(wrong))


if __name__ == "__main__":
    typer.run(main)

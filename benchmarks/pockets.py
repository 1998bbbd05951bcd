"""200 random programs of pockets and holes, held against an interpreter.

`make bench NAME=fuzz-pockets`.

Depths, several cuts, `G28`, `G53`, `G91`, cycles, M words between (`tests/support/
pocket_programs.py`). Each is read as a job; where the tool goes is held against the interpreter's
lines, rapids along the tool's axis included, and what is switched against where it was then. Some
are planned as well: then it is the arm's motion, by kinematics of the tests' own, that is held
against them, and the free moves must begin and end where the traverses do.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import selfmotion as sm
from selfmotion.basics import Array
from support.arms import robot_named
from support.own_kinematics import Arm, along
from support.pocket_programs import Interpreter, Seam, misses, random_program

# Where the program's zero is [m].
ZERO = (0.45, 0.0, 0.3)
JOB = (
    'task = "pointing"\nclearance = false\n[robot]\nname = "panda"\n[job]\nstart = "home"\n'
    'branches = 1\n[seams]\nfile = "pocket.nc"\nwithin = 0.5\nframe = {{ position = {} }}\n'
)


def of_reading(wanted: list[Seam], job: sm.files.SeamJob) -> list[str]:
    """Return what is wrong with the paths of a job."""
    if len(wanted) != len(job.seams):
        return [f"has {len(job.seams)} cuts, expected {len(wanted)}"]
    found = []
    for seam, own in zip(job.seams, wanted, strict=True):

        def places(t: Array, path: sm.paths.Path = seam.path) -> Array:
            return 1e3 * (path.samples(t).translation - ZERO)

        found += [
            f"{seam.name}: {text}" for text in misses(own, places, seam.path.duration, seam.events)
        ]
    return found


def of_motion(wanted: list[Seam], job: sm.files.SeamJob) -> list[str]:
    """Return what is wrong with the arm's motion of a job, which is planned."""
    program = job.plan()
    if not program.verified:
        return [f"is not planned: {program.verdict}"]
    if "stock and engagement are not judged" not in program.verdict:
        return ["its verdict does not say what is not judged"]
    arm = Arm(job.robot)
    seams = [step for step in program.steps if step.is_seam]
    found = []
    for step, own in zip(seams, wanted, strict=True):

        def places(t: Array, motion: sm.Trajectory = step.motion) -> Array:
            return 1e3 * (arm.place(arm.tool, along(motion, t, 0))[1] - ZERO)

        found += [
            f"{step.name}: {text}" for text in misses(own, places, step.duration, step.events)
        ]
    return found


def main(
    many: Annotated[int, typer.Option(help="Programs.")] = 200,
    planned: Annotated[int, typer.Option(help="Of these the first ones are planned.")] = 5,
    seed: Annotated[int, typer.Option(help="Of random numbers.")] = 0,
) -> None:
    """Read random programs, and hold them against the interpreter."""
    console, wrong, cuts, began = Console(), 0, 0, time.perf_counter()
    robot_named("panda")
    for number in range(many):
        text = random_program(np.random.default_rng([seed, number]))
        wanted = Interpreter().run(text)
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "pocket.nc").write_text(text)
            file = Path(folder, "job.toml")
            file.write_text(JOB.format(list(ZERO)))
            job = sm.files.read_seam_job(file)
            found = of_reading(wanted, job)
            if number < planned and not found:
                found = of_motion(wanted, job)
        cuts += len(wanted)
        wrong += bool(found)
        for what in found:
            console.print(f"program {number}: {what}", markup=False)
    seconds = time.perf_counter() - began
    console.print(
        f"{many} programs with {cuts} cuts, {planned} of them planned: {wrong} are not what the "
        f"interpreter says ({seconds:.0f} s)"
    )
    raise SystemExit(wrong > 0)


if __name__ == "__main__":
    typer.run(main)

"""Programs of controllers, judged by what they were made from."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import NamedTuple

import numpy as np

from selfmotion.basics import FileFormatError
from selfmotion.certificate import Tolerance
from selfmotion.constraints import Constraint, JointAccelerationLimits, JointJerkLimits
from selfmotion.formats.controller_program import ControllerProgram
from selfmotion.formats.program_files import read_program
from selfmotion.job import Program
from selfmotion.motion import Trajectory
from selfmotion.result import Move


class JudgedStep(NamedTuple):
    """What a certificate says of the targets of a seam or move.

    Attributes
    ----------
    name : str
    verified : bool
    verdict : str
    """

    name: str
    verified: bool
    verdict: str


def stated_deviation(file: FilePath) -> Tolerance | None:
    """Return how far off its path a program of a controller says it is; None where it does not."""
    miss = read_program(file).miss.path
    sound = np.isfinite([miss.position, miss.rotation]).all() and miss.position > 0.0
    return Tolerance(miss.position, max(miss.rotation, _LEAST)) if sound else None


def judged_steps(
    file: FilePath, job: Program, within: Tolerance | None = None
) -> tuple[JudgedStep, ...]:
    """Judge a controller's program by the job that it is of: each seam and each move.

    Seams by all that their plans had to keep, at the deviation that the file states; moves by all
    of theirs. Accelerations are the controller's, and not judged.

    Raises
    ------
    FileFormatError
        The file cannot be read, or is of another job.
    """
    program = read_program(file)
    within = within or stated_deviation(file)
    found = []
    for step, motion in zip(job.steps, _pieces(file, program, job), strict=True):
        made = step.made
        if isinstance(made, Move):
            verdict = Move(made.robot, what_targets_keep(made.constraints), motion)
            found.append(JudgedStep(step.name, verdict.verified, verdict.verdict))
        else:
            problem = replace(made.problem, constraints=what_targets_keep(made.problem.constraints))
            certificate = problem.certify(motion, within or made.tolerance)
            found.append(JudgedStep(step.name, certificate.verified, certificate.verdict))
    return tuple(found)


def what_targets_keep(constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
    """Return what targets can keep: how a controller accelerates between them is its own."""
    own = (JointAccelerationLimits, JointJerkLimits)
    return tuple(item for item in constraints if not isinstance(item, own))


def _pieces(file: FilePath, program: ControllerProgram, job: Program) -> Iterator[Trajectory]:
    """Yield the motion of each step of a job."""
    names = job.robot.joint_names
    known = [axis.joint for axis in program.axes]
    if sorted(known) != sorted(names):
        raise FileFormatError(f"{file}: has joints {', '.join(known)}, expected {', '.join(names)}")
    left = list(program.stretches)
    for step in job.steps:
        taken, seconds = [], 0.0
        while left and seconds < step.motion.duration - _MOMENT:
            taken.append(left.pop(0))
            seconds += float(taken[-1].t[-1])
        if abs(seconds - step.motion.duration) > _MOMENT:
            raise FileFormatError(
                f"{file}: its targets of '{step.name}' take {seconds:.6g} s, the job's "
                f"{step.motion.duration:.6g} s: it is of another one"
            )
        yield replace(program, stretches=tuple(taken)).trajectory.of_joints(names)
    if left:
        raise FileFormatError(f"{file}: goes on with '{left[0].name}' when the job has ended")


# Files have so many digits of time [s], and of angles [rad].
_MOMENT, _LEAST = 1e-4, 1e-6

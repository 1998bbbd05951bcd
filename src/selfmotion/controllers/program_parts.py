"""A controller's program cut into the steps of its job, and slow motions in between judged."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import NamedTuple

from selfmotion.basics import FileFormatError
from selfmotion.controllers.controller_program import ControllerProgram
from selfmotion.controllers.pieces import what_targets_keep
from selfmotion.controllers.read_stretches import SLOWLY
from selfmotion.controllers.stretches import Stretch
from selfmotion.job import Program
from selfmotion.motion import Trajectory
from selfmotion.result import Move, Piece

# Files have so many digits of time [s].
_MOMENT = 1e-4


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


class ProgramParts(NamedTuple):
    """What of a program each step of its job is.

    Attributes
    ----------
    motions : list of Trajectory
        Of each step; of a seam at the pace of its path.
    slow : sequence of (int, Trajectory)
        Slow motions to where a shifted program goes on: before which step, and what.
    """

    motions: list[Trajectory]
    slow: Sequence[tuple[int, Trajectory]]


def parts_of(file: FilePath, program: ControllerProgram, job: Program) -> ProgramParts:
    """Return what of a program each step of its job is.

    Raises
    ------
    FileFormatError
        It is of another job.
    """
    names = job.robot.joint_names
    known = [axis.joint for axis in program.axes]
    if sorted(known) != sorted(names):
        raise FileFormatError(f"{file}: has joints {', '.join(known)}, expected {', '.join(names)}")
    left, found = list(program.stretches), ProgramParts([], slow := [])

    def part(stretches: Sequence[Stretch]) -> ControllerProgram:
        return replace(program, stretches=tuple(stretches))

    for number, step in enumerate(job.steps):
        taken, seconds = [], 0.0
        while left and left[0].name == SLOWLY:
            slow.append((number, part([left.pop(0)]).trajectory.of_joints(names)))
        while left and seconds < step.motion.duration - _MOMENT:
            taken.append(left.pop(0))
            seconds += taken[-1].duration
        if abs(seconds - step.motion.duration) > _MOMENT:
            raise FileFormatError(
                f"{file}: its targets of '{step.name}' take {seconds:.6g} s, the job's "
                f"{step.motion.duration:.6g} s: it is of another one"
            )
        own, made = part(taken), step.made
        motion = own.trajectory if isinstance(made, Move) else own.along(made.problem.path)
        found.motions.append(motion.of_joints(names))
    if left:
        raise FileFormatError(f"{file}: goes on with '{left[0].name}' when the job has ended")
    return found


def slow_steps(
    parts: ProgramParts, job: Program
) -> tuple[tuple[JudgedStep, ...], Mapping[int, Sequence[Piece]]]:
    """Return what is found of slow motions, and these by the step that they are before.

    Each has to keep what the nearest free move has to.
    """
    moves = [(k, step.made) for k, step in enumerate(job.steps) if isinstance(step.made, Move)]
    steps, pieces = list[JudgedStep](), dict[int, list[Piece]]()
    for number, motion in parts.slow:
        name = f"slowly to '{job.steps[number].name}'"
        pieces.setdefault(number, []).append(Piece(name, motion))
        if not moves:
            steps.append(JudgedStep(name, False, "not verified: the job has no free moves"))
            continue
        _, near = min(moves, key=lambda move: abs(move[0] - number))
        judged = Move(near.robot, what_targets_keep(near.constraints), motion)
        steps.append(JudgedStep(name, judged.verified, judged.verdict))
    return tuple(steps), pieces

"""The segments of a program that each step of its job is."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import NamedTuple

from selfmotion.basics import FileFormatError
from selfmotion.model.motion import Trajectory
from selfmotion.planning.result import Move
from selfmotion.shop.controllers.controller_program import ControllerProgram
from selfmotion.shop.controllers.segments import PoseSegment, Segment
from selfmotion.work.job import Program

# Rounding of times in files [s].
_MOMENT = 1e-4


class ProgramParts(NamedTuple):
    """The part of a program that each step of its job is.

    Attributes
    ----------
    motions : list of list of Trajectory
        Of each step, by each interpolation that a controller may use; of a seam at the pace
        of its path.
    slow : sequence of (int, list of Trajectory)
        Slow motions to where a shifted program goes on: before which step, and what.
    by_poses : list of bool
        Whether a step has targets that are poses, or rests.
    """

    motions: list[list[Trajectory]]
    slow: Sequence[tuple[int, list[Trajectory]]]
    by_poses: list[bool]


def parts_of(file: FilePath, program: ControllerProgram, job: Program) -> ProgramParts:
    """Return the part of a program that each step of its job is.

    Raises
    ------
    FileFormatError
        It is of another job.
    """
    names = job.robot.joint_names
    known = [axis.joint for axis in program.axes]
    if sorted(known) != sorted(names):
        raise FileFormatError(f"{file}: has joints {', '.join(known)}, expected {', '.join(names)}")
    left, found = list(program.segments), ProgramParts([], slow := [], [])

    def part(segments: Sequence[Segment]) -> ControllerProgram:
        return replace(program, segments=tuple(segments))

    for number, step in enumerate(job.steps):
        taken, seconds = [], 0.0
        while left and left[0].is_slow:
            own = part([left.pop(0)])
            slow.append((number, [motion.of_joints(names) for motion in own.motions()]))
        while left and seconds < step.motion.duration - _MOMENT:
            taken.append(left.pop(0))
            seconds += taken[-1].duration
        if abs(seconds - step.motion.duration) > _MOMENT:
            raise FileFormatError(
                f"{file}: its targets of '{step.name}' take {seconds:.6g} s, the job's "
                f"{step.motion.duration:.6g} s: it is of another one"
            )
        own, planned = part(taken), step.made
        path = None if isinstance(planned, Move) else planned.problem.path
        found.motions.append([motion.of_joints(names) for motion in own.motions(path)])
        # Where the arm rests, it is where the poses around have it.
        moving = [item for item in taken if not item.is_rest]
        posed = not moving or any(isinstance(item, PoseSegment) for item in moving)
        found.by_poses.append(posed)
    if left:
        raise FileFormatError(f"{file}: goes on with '{left[0].name}' when the job has ended")
    return found

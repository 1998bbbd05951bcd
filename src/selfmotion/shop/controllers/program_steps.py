"""Segments of a controller's program, assigned to the steps of its job."""

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import NamedTuple

from selfmotion.basics import FileFormatError
from selfmotion.model.motion import Trajectory
from selfmotion.model.path import Path
from selfmotion.planning.result import Move
from selfmotion.shop.controllers.controller_program import ControllerProgram
from selfmotion.shop.controllers.pose_numbers import TIME_TOLERANCE
from selfmotion.shop.controllers.pose_segments import PoseSegment
from selfmotion.shop.controllers.segments import Segment
from selfmotion.work.job import Program, Step


class StepMotions(NamedTuple):
    """Motions of a program by the steps of its job.

    Attributes
    ----------
    motions : list of list of Trajectory
        For each step, one motion per interpolation of the controller; of a seam at the pace of its
        path.
    slow : sequence of (int, list of Trajectory)
        Inserted slow motions of a shifted program, with the number of the step they precede.
    by_poses : list of bool
        For each step, whether its targets are poses or it is at rest.
    """

    motions: list[list[Trajectory]]
    slow: Sequence[tuple[int, list[Trajectory]]]
    by_poses: list[bool]


def step_motions(file: FilePath, program: ControllerProgram, job: Program) -> StepMotions:
    """Assign the segments of a program to the steps of its job, by their durations.

    Raises
    ------
    FileFormatError
        The program belongs to another job.
    """
    names = job.robot.joint_names
    _check_joints(file, program, names)

    def motions_of(segments: Sequence[Segment], path: Path | None = None) -> list[Trajectory]:
        with_segments = replace(program, segments=tuple(segments))
        return [motion.of_joints(names) for motion in with_segments.motions(path)]

    remaining = deque(program.segments)
    motions, slow, by_poses = list[list[Trajectory]](), list[tuple[int, list[Trajectory]]](), []
    for number, step in enumerate(job.steps):
        while remaining and remaining[0].is_slow:
            slow.append((number, motions_of([remaining.popleft()])))
        segments = _take_step(file, remaining, step)
        path = None if isinstance(step.made, Move) else step.made.problem.path
        motions.append(motions_of(segments, path))
        by_poses.append(_is_by_poses(segments))
    if remaining:
        raise FileFormatError(f"{file}: goes on with '{remaining[0].name}' when the job has ended")
    return StepMotions(motions, slow, by_poses)


def _check_joints(file: FilePath, program: ControllerProgram, names: Sequence[str]) -> None:
    """Raise FileFormatError if a program has other joints than the arm."""
    program_joints = [axis.joint for axis in program.axes]
    if sorted(program_joints) != sorted(names):
        raise FileFormatError(
            f"{file}: has joints {', '.join(program_joints)}, expected {', '.join(names)}"
        )


def _take_step(file: FilePath, remaining: deque[Segment], step: Step) -> list[Segment]:
    """Remove the segments of a step from the front of the remaining ones, and return them."""
    segments, duration = list[Segment](), 0.0
    while remaining and duration < step.motion.duration - TIME_TOLERANCE:
        segments.append(remaining.popleft())
        duration += segments[-1].duration
    if abs(duration - step.motion.duration) > TIME_TOLERANCE:
        raise FileFormatError(
            f"{file}: its targets of '{step.name}' take {duration:.6g} s, the job's "
            f"{step.motion.duration:.6g} s: a time, a wait or a step was changed, or the program "
            f"belongs to another job; change it in the job, and write the program again"
        )
    return segments


def _is_by_poses(segments: Sequence[Segment]) -> bool:
    """Whether targets of a step are poses, or it is at rest.

    A rest within a step counts as the segments around it.
    """
    moving = [item for item in segments if not item.is_rest]
    return not moving or any(isinstance(item, PoseSegment) for item in moving)

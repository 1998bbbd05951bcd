"""A controller's program, or a motion, judged by its job.

A job is a program of planned steps: seams and free moves. A file that was written from it, and
perhaps changed since, is judged in two parts. Each step has to keep the constraints that its plan
had to keep (`step_judging`). The whole has to begin, end and switch its outputs as the job does.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path as FilePath

import numpy as np

from selfmotion.basics import ProblemError, RobotError
from selfmotion.certificate import Certificate, Tolerance
from selfmotion.model.motion import Trajectory, part_of_motion
from selfmotion.model.robot import RobotModel
from selfmotion.planning.result import (
    CheckedMotion,
    Plan,
    continuity_faults,
    end_position_faults,
)
from selfmotion.problem.constraints import Constraint
from selfmotion.shop.controllers.controller_program import ControllerProgram
from selfmotion.shop.controllers.pose_numbers import JOINT_ROUNDING, TIME_TOLERANCE
from selfmotion.shop.controllers.pose_segments import PoseSegment
from selfmotion.shop.controllers.program_draft import constraints_of
from selfmotion.shop.controllers.program_facts import check_load
from selfmotion.shop.controllers.program_files import program_deviation, read_program
from selfmotion.shop.controllers.program_steps import StepMotions, step_motions
from selfmotion.shop.controllers.program_verdicts import ProgramVerdict
from selfmotion.shop.controllers.shifted_work_objects import shift_note, shifted_move_faults
from selfmotion.shop.controllers.step_judging import (
    slow_motion_name,
    slow_motion_verdicts,
    step_verdicts,
    worst_certificate,
)
from selfmotion.shop.controllers.switching_faults import switching_faults
from selfmotion.shop.controllers.target_constraints import (
    constraints_of_targets,
    problem_of_targets,
)
from selfmotion.work.job import Program

# Rounding of angles in files [rad].
_ANGLE_ROUNDING = 1e-6
# Rounding of the ends of a program in poses, as joint positions [rad or m].
_POSE_ROUNDING = 1e-5
# Rounding of deviations that a file states [m, rad].
_DEVIATION_ROUNDING = 1e-9


def judge_program(
    file: FilePath, job: Program, seam_tolerance: Tolerance | None = None
) -> ProgramVerdict:
    """Judge a controller's program by its job: each step, and the whole.

    A seam has to keep the constraints of its plan, within the tolerance that the file states; a
    move has to keep its own. The controller sets the accelerations: they are not judged. The whole
    has to begin and end where the job does, and to switch what the job's events say, at their
    times: one output or comment for each event, the same for all events of one name, and no other.

    Where the work object was shifted, seams have to follow their paths shifted with it, and the
    whole begins and ends elsewhere. A slow motion to the shifted place has to keep what the nearest
    move has to.

    Parameters
    ----------
    file : Path
    job : Program
    seam_tolerance : Tolerance, optional
        Allowed deviation of seams from their paths; by default the one that the file states, or
        that of each plan if it states none.

    Raises
    ------
    FileFormatError
        The file cannot be read, or is of another job.
    """
    program = read_program(file, job.robot)
    seam_tolerance = seam_tolerance or stated_tolerance(program)
    motions = step_motions(file, program, job)
    steps = step_verdicts(job, motions, constraints_of_targets, seam_tolerance, program)
    slow_motions = slow_motion_verdicts(job, motions)
    sequence, rounding = _motion_sequence(job, motions), _end_rounding(program)
    failures = (
        *_job_faults(job),
        *continuity_faults(job.robot, sequence, rounding),
        *_end_faults(job, sequence, rounding, _unshifted_ends(program)),
        *([program.start_fault] if program.start_fault else []),
        *switching_faults(program, job),
        *_move_faults(file, program, job, motions),
        *header_faults(program, job.robot, constraints_of(job)),
    )
    return ProgramVerdict(
        (*steps, *slow_motions),
        failures,
        seam_tolerance,
        shift_note(program, obstacles=_has_obstacles(job)),
        unjudged_note(program),
    )


def judged_by_plan(program: ControllerProgram, plan: Plan) -> Certificate:
    """Return the worst certificate of the motions of a program, by all that its plan has to keep.

    Within the deviation that the program states. Its work object is where it was planned.
    """
    problem = problem_of_targets(plan.problem)
    allowed, ending = stated_tolerance(program) or plan.tolerance, plan.report.ending
    certificate, _ = worst_certificate(
        problem,
        program.motions(problem.path),
        lambda each, motion: each.certify(motion, allowed, ending),
    )
    return certificate


def judge_motion(motion: Trajectory, job: Program) -> ProgramVerdict:
    """Judge a joint motion by its job: each step, and the whole.

    It has to keep all that the job asks for, except the outputs, which a motion does not have.

    Raises
    ------
    FileFormatError
        It is of other joints.
    """
    whole = motion.of_joints(job.robot.joint_names)
    if abs(whole.duration - job.duration) > TIME_TOLERANCE:
        failure = f"it lasts {whole.duration:.6g} s, the job {job.duration:.6g} s"
        return ProgramVerdict((), (failure,))
    times = pairwise([*job.begins, job.duration])
    parts = [[part_of_motion(whole, begin, end)] for begin, end in times]
    motions = StepMotions(parts, slow=(), by_poses=[False] * len(parts))
    steps = step_verdicts(job, motions, constraint_filter=tuple)
    sequence = _motion_sequence(job, motions)
    failures = (
        *_job_faults(job),
        *continuity_faults(job.robot, sequence),
        *_end_faults(job, sequence, JOINT_ROUNDING),
    )
    return ProgramVerdict(steps, failures)


def _has_obstacles(job: Program) -> bool:
    """Return whether a job keeps clear of obstacles."""
    return any(
        requirement.obstacles
        for step in job.steps
        if isinstance(step.made, Plan)
        for requirement in step.made.requirements
    )


def _job_faults(job: Program) -> Iterator[str]:
    """Yield the faults of the job by which a program is judged."""
    for failure in job.failures:
        yield f"the job itself: {failure}"


def _motion_sequence(job: Program, motions: StepMotions) -> list[CheckedMotion]:
    """Return the smooth motions of all steps in order, each after the slow motions before it."""
    sequence = list[CheckedMotion]()
    for number, (step, step_motion) in enumerate(zip(job.steps, motions.motions, strict=True)):
        sequence += [
            CheckedMotion(slow_motion_name(job, number), slow_motion[0])
            for next_step, slow_motion in motions.slow
            if next_step == number
        ]
        sequence.append(CheckedMotion(f"'{step.name}'", step_motion[0]))
    return sequence


def _end_rounding(program: ControllerProgram) -> float:
    """Return how far apart joint positions may be that are equal but for digits [rad or m].

    Between poses and joint targets the digits of both count; the arm's kinematics may magnify them.
    """
    has_poses = any(isinstance(segment, PoseSegment) for segment in program.segments)
    return _POSE_ROUNDING if has_poses else JOINT_ROUNDING


def _unshifted_ends(program: ControllerProgram) -> tuple[bool, bool]:
    """Return whether the begin and the end of a program stay where its job has them.

    A shifted work object takes poses with it; joint targets stay.
    """
    if program.shift is None:
        return True, True
    moving = [segment for segment in program.segments if not segment.is_rest]
    if not moving:
        return False, False
    begin, end = (not isinstance(segment, PoseSegment) for segment in (moving[0], moving[-1]))
    return begin, end


def _end_faults(
    job: Program,
    sequence: Sequence[CheckedMotion],
    rounding: float,
    judged_ends: tuple[bool, bool] = (True, True),
) -> Iterator[str]:
    """Yield where motions do not begin or end as their job does, for the ends that are judged."""
    if not sequence:
        return
    for end, is_judged in zip((0, -1), judged_ends, strict=True):
        if is_judged:
            planned = job.steps[end].motion.q[end]
            yield from end_position_faults(job.robot, sequence[end], end, planned, rounding)


def _move_faults(
    file: FilePath, program: ControllerProgram, job: Program, motions: StepMotions
) -> Iterator[str]:
    """Yield how far free moves are off those of the job, if it is farther than the file states."""
    if program.shift is not None:
        yield from shifted_move_faults(program, job, motions)
        return
    _, stated, measured = program_deviation(job, file, program)
    pairs = zip(measured.moves, stated.moves, strict=True)
    if any(deviation > limit + _DEVIATION_ROUNDING for deviation, limit in pairs):
        yield (
            f"free moves are up to {1e3 * measured.moves.position:.4g} mm, joints "
            f"{measured.moves.joint:.4g} rad or m off those of the job, the file states "
            f"{1e3 * stated.moves.position:.4g} mm and {stated.moves.joint:.4g}"
        )


def header_faults(
    program: ControllerProgram, robot: RobotModel, constraints: Sequence[Constraint]
) -> Iterator[str]:
    """Yield what the header of a program states and this cell has otherwise.

    A program depends on its held joints, its flange and its load. Torques were verified with one
    load, which `constraints` name.
    """
    facts = program.facts
    if facts is None:
        yield (
            "its head does not state what its targets rest on (flange, held joints, outputs, with "
            "a checksum): write the program again"
        )
        return
    yield from facts.against(robot, program.load)
    try:
        check_load(program.load, robot, constraints, facts.flange)
    except (ProblemError, RobotError) as error:
        yield str(error)


def stated_tolerance(program: ControllerProgram) -> Tolerance | None:
    """Return how far off its path a program states that it is; None where it states nothing."""
    if program.feed_tolerance is not None:
        return program.feed_tolerance
    deviation = program.deviation.path
    is_finite = np.isfinite([deviation.position, deviation.rotation]).all()
    if not is_finite or deviation.position <= 0.0:
        return None
    return Tolerance(deviation.position, max(deviation.rotation, _ANGLE_ROUNDING))


def unjudged_note(program: ControllerProgram) -> str:
    """Return in words what the controller decides about a program, so that it is not judged."""
    if program.feed_tolerance is None:
        return "accelerations are the controller's, and not judged"
    return (
        "seams at their feeds are judged with the ramps of the plan: how the controller runs up "
        "and down, and so when it is where, is its own, and not judged"
    )

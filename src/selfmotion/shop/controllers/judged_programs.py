"""Programs of controllers and motions, judged by the jobs that they are of."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path as FilePath
from typing import NamedTuple

import numpy as np

from selfmotion.basics import ProblemError, RobotError
from selfmotion.certificate import Certificate, Tolerance
from selfmotion.model.motion import Trajectory, part_of_motion
from selfmotion.model.robot import RobotModel
from selfmotion.planning.result import CheckedMotion, Move, elsewhere, gaps
from selfmotion.problem.constraints import Constraint
from selfmotion.shop.controllers.controller_program import ControllerProgram
from selfmotion.shop.controllers.pose_numbers import JOINT_ROUNDING, TIME_TOLERANCE
from selfmotion.shop.controllers.pose_segments import PoseSegment
from selfmotion.shop.controllers.program_draft import constraints_of
from selfmotion.shop.controllers.program_facts import check_load
from selfmotion.shop.controllers.program_files import program_deviation, read_program
from selfmotion.shop.controllers.program_steps import StepMotions, step_motions
from selfmotion.shop.controllers.shifted_work_objects import (
    as_shifted,
    shift_note,
    shifted_move_faults,
)
from selfmotion.shop.controllers.switched_outputs import switching_faults
from selfmotion.shop.controllers.target_constraints import (
    constraints_of_lines,
    constraints_of_targets,
)
from selfmotion.work.job import Program

# The constraints of a step → those that a program of targets, or a motion, has to keep.
_KeptConstraints = Callable[[Sequence[Constraint]], tuple[Constraint, ...]]
# Rounding of angles in files [rad].
_ANGLE_ROUNDING = 1e-6
# Rounding of the ends of a program in poses, as joint positions [rad or m].
_POSE_ROUNDING = 1e-5
# Rounding of deviations that a file states [m, rad].
_ROUNDING = 1e-9
# Said of a verdict on straight motions between targets instead of a smooth one through them.
_BY_LINES = " (where the controller goes straight between targets, or rounds their corners)"


class JudgedStep(NamedTuple):
    """The certificate of the targets of a seam or move.

    Attributes
    ----------
    name : str
    verified : bool
    verdict : str
    """

    name: str
    verified: bool
    verdict: str


class JudgedProgram(NamedTuple):
    """Verdict on a controller's program, by the job that it is of.

    Attributes
    ----------
    steps : tuple of JudgedStep
    failures : tuple of str
        What is wrong with the program as a whole: its ends, its order, its outputs, its job.
    within : Tolerance or None
        Allowed deviation of seams from their paths, where it is not the job's own.
    shifted : str
        How far the work object was shifted, in words; "" for not at all.
    unjudged : str
        What the controller decides, and no certificate covers, in words.
    """

    steps: tuple[JudgedStep, ...]
    failures: tuple[str, ...]
    within: Tolerance | None = None
    shifted: str = ""
    unjudged: str = ""

    @property
    def verified(self) -> bool:
        """Whether each step is, and nothing is wrong with the whole."""
        return all(step.verified for step in self.steps) and not self.failures

    @property
    def verdict(self) -> str:
        """One line: verified, or how many steps are not, and what is wrong with the whole."""
        if self.verified:
            remarks = f"{self._tolerance_remark}{self._shift_remark}"
            own = f"; {self.unjudged}" if self.unjudged else ""
            return f"verified: each step, and the whole{remarks}{own}"
        count = sum(not step.verified for step in self.steps)
        reasons = [*([f"{count} of {len(self.steps)} steps"] if count else []), *self.failures]
        return f"not verified: {'; '.join(reasons)}{self._shift_remark}"

    @property
    def _shift_remark(self) -> str:
        return f"; {self.shifted}" if self.shifted else ""

    @property
    def _tolerance_remark(self) -> str:
        if self.within is None:
            return ""
        return (
            f"; seams within {1e3 * self.within.position:.3g} mm and {self.within.rotation:.2g} "
            f"rad of their paths"
        )


def judged_program(file: FilePath, job: Program, within: Tolerance | None = None) -> JudgedProgram:
    """Judge a controller's program by the job that it is of: each step, and the whole.

    A seam is judged by all that its plan had to keep, at the deviation that the file states; a move
    by all of its own. Accelerations are the controller's, and not judged. The whole has to begin
    and end where the job does, and to switch what its events say, when they say it: an output or a
    comment for each, the same for each event of one name, and nothing else.

    Where the work object was shifted, seams have to be on their paths shifted with it, and the
    whole begins and ends elsewhere; a slow motion to where it goes on has to keep what the nearest
    move has to.

    Raises
    ------
    FileFormatError
        The file cannot be read, or is of another job.
    """
    program = read_program(file, job.robot)
    allowed = within or stated_deviation(program)
    parts = step_motions(file, program, job)
    steps, checked = _judged_steps(job, parts.motions, allowed, constraints_of_targets, program)
    slow, between = _judged_slow_motions(parts, job)
    in_order = [item for k, own in enumerate(checked) for item in (*between.get(k, ()), own)]
    # From axis targets to poses there are digits of both, which the arm's kinematics may magnify.
    has_poses = any(isinstance(segment, PoseSegment) for segment in program.segments)
    rounding = _POSE_ROUNDING if has_poses else JOINT_ROUNDING
    failures = (
        *(f"the job itself: {text}" for text in job.failures),
        *gaps(job.robot, in_order, rounding),
        *_elsewhere(job, in_order, rounding, program),
        *([program.start_fault] if program.start_fault else []),
        *switching_faults(program, job),
        *_off_moves(file, program, job, parts),
        *differing_facts(program, job.robot, constraints_of(job)),
    )
    every = (*steps, *slow)
    return JudgedProgram(every, failures, allowed, shift_note(program), controller_note(program))


def judged_motion(motion: Trajectory, job: Program) -> JudgedProgram:
    """Judge a motion that was read by the job that it is of: each step, and the whole.

    By all that the job asks for, except its outputs, which a motion does not have.

    Raises
    ------
    FileFormatError
        It is of other joints.
    """
    whole = motion.of_joints(job.robot.joint_names)
    if abs(whole.duration - job.duration) > TIME_TOLERANCE:
        failure = f"it lasts {whole.duration:.6g} s, the job {job.duration:.6g} s"
        return JudgedProgram((), (failure,))
    ends = [*job.begins, job.duration]
    motions = [[part_of_motion(whole, first, last)] for first, last in pairwise(ends)]
    steps, checked = _judged_steps(job, motions, None, tuple)
    failures = (
        *(f"the job itself: {text}" for text in job.failures),
        *gaps(job.robot, checked),
        *_elsewhere(job, checked),
    )
    return JudgedProgram(steps, failures)


def _judged_steps(
    job: Program,
    motions: Sequence[Sequence[Trajectory]],
    within: Tolerance | None,
    kept: _KeptConstraints,
    program: ControllerProgram | None = None,
) -> tuple[tuple[JudgedStep, ...], list[CheckedMotion]]:
    """Return the verdicts on the steps of a job, and their motions.

    Parameters
    ----------
    job : Program
    motions : sequence of sequence of Trajectory
        For each step, one motion per interpolation of the controller.
    within : Tolerance or None
        Allowed deviation of seams from their paths; by default that of each plan.
    kept : callable
        The constraints of a step → those by which it is judged.
    program : ControllerProgram, optional
        Whose work object may be shifted.
    """
    judged_steps, checked = list[JudgedStep](), list[CheckedMotion]()
    for step, own in zip(job.steps, motions, strict=True):
        planned = step.made
        if isinstance(planned, Move):
            judged_steps.append(_judged_move(step.name, planned, own, kept))
        else:
            problem = replace(planned.problem, constraints=kept(planned.problem.constraints))
            if program is not None:
                problem = as_shifted(problem, program, own[0].q[0])
            lines = replace(problem, constraints=constraints_of_lines(problem.constraints))
            tolerance = within or planned.tolerance
            certificate, _ = judged_interpolations(
                own,
                partial(problem.certify, tolerance=tolerance),
                partial(lines.certify, tolerance=tolerance),
            )
            judged_steps.append(JudgedStep(step.name, certificate.verified, certificate.verdict))
        checked.append(CheckedMotion(f"'{step.name}'", own[0]))
    return tuple(judged_steps), checked


def _judged_move(
    name: str,
    move: Move,
    motions: Sequence[Trajectory],
    kept: _KeptConstraints,
) -> JudgedStep:
    """Return the verdict on the first interpolation of a move that fails, or that all hold."""
    smooth = kept(move.constraints)
    lines = constraints_of_lines(smooth)
    moves = [Move(move.robot, lines if k else smooth, motion) for k, motion in enumerate(motions)]
    worst = next((move for move in moves if not move.verified), moves[0])
    interpolation = "" if worst is moves[0] else _BY_LINES
    return JudgedStep(name, worst.verified, f"{worst.verdict}{interpolation}")


def judged_interpolations(
    motions: Sequence[Trajectory],
    judge: Callable[[Trajectory], Certificate],
    judge_lines: Callable[[Trajectory], Certificate] | None = None,
) -> tuple[Certificate, Trajectory]:
    """Return the worst certificate of the motions that a controller may make of targets.

    And that motion. The first motion is smooth, the others go straight (`constraints_of_lines`).
    The worst is the first that is not verified; where all are, that with the largest position
    error.
    """
    worst: tuple[Certificate, Trajectory] | None = None
    for number, motion in enumerate(motions):
        certificate = (judge if judge_lines is None or not number else judge_lines)(motion)
        if not certificate.verified:
            said = (
                *certificate.failures[:-1],
                f"{certificate.failures[-1]}{_BY_LINES if number else ''}",
            )
            return replace(certificate, failures=said), motion
        if worst is None or certificate.position_error.value > worst[0].position_error.value:
            worst = certificate, motion
    if worst is None:
        raise ProblemError("there is no motion to judge")
    return worst


def _judged_slow_motions(
    parts: StepMotions, job: Program
) -> tuple[tuple[JudgedStep, ...], Mapping[int, Sequence[CheckedMotion]]]:
    """Return the verdicts on slow motions, and these motions by the step that they precede.

    Each has to keep what the nearest free move of the job has to.
    """
    moves = [(k, step.made) for k, step in enumerate(job.steps) if isinstance(step.made, Move)]
    steps, checked = list[JudgedStep](), dict[int, list[CheckedMotion]]()
    for number, motions in parts.slow:
        name = f"slowly to '{job.steps[number].name}'"
        checked.setdefault(number, []).append(CheckedMotion(name, motions[0]))
        if not moves:
            steps.append(JudgedStep(name, False, "not verified: the job has no free moves"))
            continue
        _, near = min(moves, key=lambda move: abs(move[0] - number))
        steps.append(_judged_move(name, near, motions, constraints_of_targets))
    return tuple(steps), checked


def _elsewhere(
    job: Program,
    checked: Sequence[CheckedMotion],
    rounding: float = JOINT_ROUNDING,
    program: ControllerProgram | None = None,
) -> Iterator[str]:
    """Yield where a program does not begin or end as its job does.

    Poses of a shifted work object are elsewhere, joint targets are not.
    """
    for end in (0, -1) if checked else ():
        if program is not None and program.shift is not None:
            moving = [item for item in program.segments if not item.is_rest]
            if not moving or isinstance(moving[end], PoseSegment):
                continue
        wanted = job.steps[end].motion.q[end]
        yield from elsewhere(job.robot, checked[end], end, wanted, rounding)


def _off_moves(
    file: FilePath, program: ControllerProgram, job: Program, parts: StepMotions
) -> Iterator[str]:
    """Yield how far free moves are off those of the job, where the file does not state it."""
    if program.shift is not None:
        yield from shifted_move_faults(program, job, parts)
        return
    _, stated, deviations = program_deviation(job, file, program)
    pairs = zip(deviations.moves, stated.moves, strict=True)
    if any(one > other + _ROUNDING for one, other in pairs):
        yield (
            f"free moves are up to {1e3 * deviations.moves.position:.4g} mm, joints "
            f"{deviations.moves.joint:.4g} rad or m off those of the job, the file states "
            f"{1e3 * stated.moves.position:.4g} mm and {stated.moves.joint:.4g}"
        )


def stated_deviation(program: ControllerProgram) -> Tolerance | None:
    """Return how far off its path a program says that it is; None where it does not."""
    if program.within is not None:
        return program.within
    deviation = program.deviation.path
    sound = np.isfinite([deviation.position, deviation.rotation]).all() and deviation.position > 0.0
    return (
        Tolerance(deviation.position, max(deviation.rotation, _ANGLE_ROUNDING)) if sound else None
    )


def differing_facts(
    program: ControllerProgram, robot: RobotModel, constraints: Sequence[Constraint]
) -> Iterator[str]:
    """Yield what a program rests on and finds otherwise here: its held joints, its load."""
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


def controller_note(program: ControllerProgram) -> str:
    """Return the parts of a program that the controller decides, and that are not judged."""
    if program.within is None:
        return "accelerations are the controller's, and not judged"
    return (
        "seams at their feeds are judged with the ramps of the plan: how the controller runs up "
        "and down, and so when it is where, is its own, and not judged"
    )

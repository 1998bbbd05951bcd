"""Verdicts on the steps of a job, by the motions that a controller may make of them.

A controller may interpolate between targets in several ways. So a step has several motions: the
first one is smooth (the spline through its targets, or a motion that is given by samples), the
others go straight between targets. All of them have to keep the constraints of the step, and the
worst one decides. Along straight lines only those constraints count that corners can keep
(`constraints_of_lines`).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

from selfmotion.basics import ProblemError
from selfmotion.certificate import Certificate, Tolerance
from selfmotion.model.motion import Trajectory
from selfmotion.planning.result import Move
from selfmotion.problem.constraints import Constraint
from selfmotion.problem.problem import Problem
from selfmotion.shop.controllers.controller_program import ControllerProgram
from selfmotion.shop.controllers.program_steps import StepMotions
from selfmotion.shop.controllers.program_verdicts import StepVerdict
from selfmotion.shop.controllers.shifted_work_objects import as_shifted
from selfmotion.shop.controllers.target_constraints import (
    constraints_of_lines,
    constraints_of_targets,
)
from selfmotion.work.job import Program

# Planned constraints of a step → those that a program of targets, or a sampled motion, can keep.
ConstraintFilter = Callable[[Sequence[Constraint]], tuple[Constraint, ...]]
# Addition to a verdict on straight motions between targets.
_LINES_REMARK = " (where the controller goes straight between targets, or rounds their corners)"


def step_verdicts(
    job: Program,
    step_motions: StepMotions,
    constraint_filter: ConstraintFilter,
    seam_tolerance: Tolerance | None = None,
    program: ControllerProgram | None = None,
) -> tuple[StepVerdict, ...]:
    """Return the verdict on each step of a job.

    Parameters
    ----------
    job : Program
    step_motions : StepMotions
        For each step, one motion per interpolation of the controller.
    constraint_filter : callable
        Planned constraints of a step → those by which it is judged.
    seam_tolerance : Tolerance, optional
        Allowed deviation of seams from their paths; by default that of each plan.
    program : ControllerProgram, optional
        The program of these motions, whose work object may be shifted.
    """
    verdicts = []
    for step, motions in zip(job.steps, step_motions.motions, strict=True):
        planned = step.made
        if isinstance(planned, Move):
            constraints = constraint_filter(planned.constraints)
            verdicts.append(_move_verdict(step.name, planned, constraints, motions))
            continue
        constraints = constraint_filter(planned.problem.constraints)
        problem = replace(planned.problem, constraints=constraints)
        if program is not None:
            problem = as_shifted(problem, program, motions[0].q[0])
        tolerance = seam_tolerance or planned.tolerance
        verdicts.append(_seam_verdict(step.name, problem, tolerance, motions))
    return tuple(verdicts)


def slow_motion_verdicts(job: Program, step_motions: StepMotions) -> tuple[StepVerdict, ...]:
    """Return the verdict on each inserted slow motion.

    A slow motion is in no plan: it has to keep the constraints of the nearest free move of the job.
    """
    moves = {k: step.made for k, step in enumerate(job.steps) if isinstance(step.made, Move)}
    verdicts = []
    for next_step, motions in step_motions.slow:
        name = slow_motion_name(job, next_step)
        if not moves:
            verdicts.append(StepVerdict(name, False, "not verified: the job has no free moves"))
            continue
        nearest = moves[min(moves, key=lambda number: abs(number - next_step))]
        constraints = constraints_of_targets(nearest.constraints)
        verdicts.append(_move_verdict(name, nearest, constraints, motions))
    return tuple(verdicts)


def slow_motion_name(job: Program, next_step: int) -> str:
    """Return the name of a slow motion to the beginning of a step."""
    return f"slowly to '{job.steps[next_step].name}'"


def _seam_verdict(
    name: str, problem: Problem, tolerance: Tolerance, motions: Sequence[Trajectory]
) -> StepVerdict:
    """Return the verdict on the worst motion of a seam."""
    certificate, _ = worst_certificate(
        problem, motions, lambda each, motion: each.certify(motion, tolerance)
    )
    return StepVerdict(name, certificate.verified, certificate.verdict)


def _move_verdict(
    name: str, move: Move, constraints: tuple[Constraint, ...], motions: Sequence[Trajectory]
) -> StepVerdict:
    """Return the verdict on the first motion of a move that fails, or that all of them hold."""
    smooth = Move(move.robot, constraints, motions[0])
    on_lines = constraints_of_lines(constraints)
    straight = [Move(move.robot, on_lines, motion) for motion in motions[1:]]
    worst = next((each for each in (smooth, *straight) if not each.verified), smooth)
    remark = "" if worst is smooth else _LINES_REMARK
    return StepVerdict(name, worst.verified, f"{worst.verdict}{remark}")


def worst_certificate(
    problem: Problem,
    motions: Sequence[Trajectory],
    certify: Callable[[Problem, Trajectory], Certificate],
) -> tuple[Certificate, Trajectory]:
    """Return the worst certificate of the motions of a seam, and that motion.

    The worst is the first that is not verified. If all are verified, it is the one with the largest
    position error.

    Parameters
    ----------
    problem : Problem
        What a program of targets has to keep.
    motions : sequence of Trajectory
        One per interpolation of the controller: first the smooth one, then those on straight lines,
        which keep less (`constraints_of_lines`).
    certify : callable
        Returns the certificate of a motion of a problem.

    Raises
    ------
    ProblemError
        There is no motion.
    """
    on_lines = replace(problem, constraints=constraints_of_lines(problem.constraints))
    worst: tuple[Certificate, Trajectory] | None = None
    for number, motion in enumerate(motions):
        certificate = certify(on_lines if number else problem, motion)
        if not certificate.verified:
            return _with_lines_remark(certificate) if number else certificate, motion
        if worst is None or certificate.position_error.value > worst[0].position_error.value:
            worst = certificate, motion
    if worst is None:
        raise ProblemError("there is no motion to judge")
    return worst


def _with_lines_remark(certificate: Certificate) -> Certificate:
    """Return a failed certificate whose last failure says that the motion went straight."""
    *others, last = certificate.failures
    return replace(certificate, failures=(*others, f"{last}{_LINES_REMARK}"))

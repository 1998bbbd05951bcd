"""Verification of written files: whether the motion, read back, still satisfies its plan."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

import selfmotion as sm
from selfmotion.model.motion import part_of_motion
from selfmotion.shell.cli.file_kinds import is_readable, is_target_program
from selfmotion.shop import controllers

Planned = sm.Plan | sm.Parts | sm.Move | sm.Program


class FileVerdict(NamedTuple):
    """The verdict on a file that was read back.

    Attributes
    ----------
    verified : bool
        Whether the motion in the file is verified.
    text : str
        In words; "" where the file cannot be read back.
    """

    verified: bool
    text: str


def verify_file(
    planned: Planned,
    target: Path,
    form: str | None,
    rate: float | None,
    settings: sm.files.ProgramSettings | None,
    *,
    whole: bool,
) -> FileVerdict:
    """Return whether the motion in a file is still the planned one: `whole` verdict, or summary.

    Parameters
    ----------
    planned : Plan, Parts, Move or Program
        What was written.
    target : path
        The file.
    form : str, optional
        Its format, whatever the suffix.
    rate : float, optional
        Of its samples [Hz].
    settings : ProgramSettings, optional
    whole : bool
        Whether the text is the whole verdict.
    """
    is_program = is_target_program(target, form, settings)
    if is_program and target.suffix.lower() in controllers.READ_PROGRAMS:
        return _verify_program(planned, target)
    if not is_readable(target, form):
        return FileVerdict(is_verified(planned), "")
    motion = sm.files.read_motion(target)
    match planned:
        case sm.Plan():
            return verify_motion(planned, motion, whole=whole)
        case sm.Move():
            read = sm.Move(
                planned.robot, planned.constraints, motion.of_joints(planned.robot.joint_names)
            )
            return FileVerdict(read.verified and planned.verified, f"read back: {read.verdict}")
        case sm.Program() | sm.Parts() if rate is not None:
            # Steps meet between its samples: there is no motion of each that rests at its ends.
            text = _sampling_text(planned.trajectory, motion, rate)
            return FileVerdict(is_verified(planned), text)
        case sm.Program():
            verdict = controllers.judge_motion(motion, planned)
            return FileVerdict(verdict.verified, f"read back: {verdict.verdict}")
    return _verify_parts(planned, motion, whole=whole)


def is_verified(planned: Planned) -> bool:
    """Whether a planned motion is verified."""
    return planned.certificate.verified if isinstance(planned, sm.Plan) else planned.verified


def verify_motion(plan: sm.Plan, motion: sm.Trajectory, *, whole: bool) -> FileVerdict:
    """Return whether a motion satisfies a plan's problem."""
    certificate = plan.problem.certify(motion, plan.tolerance, plan.report.ending)
    return FileVerdict(
        certificate.verified and not plan.altered, _verdict_text(certificate, whole=whole)
    )


def _verify_program(planned: Planned, target: Path) -> FileVerdict:
    """Return whether a controller's program deviates from its plan by no more than it states."""
    program = controllers.read_program(target, planned.robot)
    count, stated, measured = controllers.program_deviation(planned, target, program)
    faults = (
        *controllers.switching_faults(program, planned),
        *_between_targets(planned, target, program),
    )
    keeps_stated = controllers.keeps_stated(measured, stated)
    deviations = [
        f"{1e3 * deviation.position:.3g} mm and {deviation.rotation:.2g} rad {where} "
        f"({1e3 * limit.position:.3g} mm are stated in the file)"
        for deviation, limit, where in zip(
            measured, stated, ("off the plan", "in free moves"), strict=True
        )
        if deviation.position > 0.0
    ]
    targets = f"{count} {'target' if count == 1 else 'targets'}"
    if deviations:
        targets += f", between which the tool is at most {', and '.join(deviations)}"
    remarks = [f"a seam has times all the same: {reason}" for reason in program.timed_reasons]
    if program.feed_tolerance is not None:
        remarks.insert(0, "seams are at their feeds, with ramps of the controller's own")
    if program.remark:
        remarks.append(f"they are joints, as poses do not keep the motion: {program.remark}")
    return FileVerdict(
        is_verified(planned) and keeps_stated and not faults,
        f"read back: {'; '.join((targets, *remarks, *faults))}",
    )


def _between_targets(
    planned: Planned, target: Path, program: controllers.ControllerProgram
) -> list[str]:
    """Return what a program breaks of what was planned, as `check` judges it.

    Of a job this is judged where targets are joints and a seam has a feed: between such targets a
    controller may be faster or slower.
    """
    has_joints = program.feed_tolerance is None
    if isinstance(planned, sm.Plan):
        certificate = controllers.judged_by_plan(program, planned)
        failures = [] if certificate.verified else [certificate.verdict]
        feeds = bool(planned.problem.path.feeds)
    elif isinstance(planned, sm.Program):
        seams = [step.made.problem.path for step in planned.steps if isinstance(step.made, sm.Plan)]
        feeds = any(path.feeds for path in seams)
        judged = controllers.judge_program(target, planned) if feeds and has_joints else None
        steps = () if judged is None else judged.steps
        failures = [f"{step.name}: {step.verdict}" for step in steps if not step.verified]
    else:
        return []
    if failures and feeds and has_joints:
        failures.append(
            "where it is in run-up or run-down, give the path a smaller acceleration, as "
            "path.acceleration=0.3; or write linear motions (--set targets=poses), which have "
            "the feed as their speed"
        )
    return failures


def _verify_parts(planned: sm.Parts, motion: sm.Trajectory, *, whole: bool) -> FileVerdict:
    """Return whether a motion satisfies the problem of parts, part by part and move by move."""
    ordered = motion.of_joints(planned.robot.joint_names)
    begins = np.append(planned.begins, planned.trajectory.duration)
    plans, moves = [], []
    for k, (plan, begin) in enumerate(zip(planned.plans, planned.begins, strict=True)):
        end = begin + plan.trajectory.duration
        read = replace(plan, trajectory=part_of_motion(ordered, begin, end))
        plans.append(replace(read, certificate=read.check()))
        if k < len(planned.moves):
            part = part_of_motion(ordered, end, float(begins[k + 1]))
            moves.append(sm.Move(planned.robot, planned.moves[k].constraints, part))
    parts = replace(planned, plans=tuple(plans), moves=tuple(moves))
    return FileVerdict(parts.verified, _verdict_text(parts, whole=whole))


def _verdict_text(verdict: sm.Certificate | sm.Parts, *, whole: bool) -> str:
    return f"read back: {verdict.verdict if whole else verdict.summary}"


def _sampling_text(motion: sm.Trajectory, read: sm.Trajectory, rate: float) -> str:
    """Return, in words, how far samples at a rate [Hz] leave the whole motion."""
    t = np.append(motion.t, motion.t[:-1] + 0.5 * np.diff(motion.t))
    difference = read.of_joints(motion.joint_names)(np.clip(t, None, read.t[-1])) - motion(t)
    return (
        f"at {rate:g} Hz up to {np.abs(difference).max():.3g} rad or m off the motion; "
        "its steps are judged only without a rate"
    )


def straight_line_text(deviation: controllers.LinearDeviation) -> str:
    """Return, in words, how far straight lines between samples leave the motion."""
    rate = "no --rate keeps" if deviation.rate is None else f"--rate {deviation.rate:.0f} keeps"
    return (
        f"joined by straight lines, the samples stay within {deviation.position:.2g} m and "
        f"{deviation.rotation:.2g} rad of the motion; {rate} the plan's tolerance so (controllers "
        f"of ROS 2 join by cubics or quintics, which are nearer)"
    )


def message_rate_text(rate: float) -> str:
    """Return, in words, the rate [Hz] that messages have where none is asked for."""
    return (
        f"at {rate:g} Hz: the coarsest rate at which straight lines between samples keep the "
        f"plan's tolerance"
    )

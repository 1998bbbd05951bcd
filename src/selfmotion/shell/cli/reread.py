"""Verification of written motions: whether, read back, they still satisfy the plan."""

from dataclasses import replace
from pathlib import Path

import numpy as np

import selfmotion as sm
from selfmotion.model.motion import part_of_motion
from selfmotion.shop import controllers

Planned = sm.Plan | sm.Parts | sm.Move | sm.Program


def is_message(target: Path, form: str | None) -> bool:
    """Whether a file is a message of ROS, which has as few samples as straight lines allow."""
    return (form or controllers.SUFFIXES.get(target.suffix.lower())) in controllers.MESSAGES


def is_program(target: Path, form: str | None, asked: sm.files.ProgramSettings | None) -> bool:
    """Whether a file is a program of targets, which has no rate."""
    name = form or controllers.SUFFIXES.get(target.suffix.lower())
    linear = asked is not None and asked.by_poses
    return name in controllers.PROGRAMS.values() or (name == "urscript" and linear)


def is_of_controller(target: Path, form: str | None) -> bool:
    """Whether a file is run by a controller itself, and has settings."""
    name = form or controllers.SUFFIXES.get(target.suffix.lower())
    return name == "urscript" or name in controllers.PROGRAMS.values()


def is_readable(target: Path, form: str | None) -> bool:
    """Whether a file can be read back as a motion."""
    return form in controllers.READABLE or (
        form is None and target.suffix.lower() not in (".xml", ".script")
    )


def read_back(
    planned: Planned,
    target: Path,
    form: str | None,
    rate: float | None,
    asked: sm.files.ProgramSettings | None,
    *,
    whole: bool,
) -> tuple[bool, str]:
    """Return whether what was written is still the motion, and what there is to say.

    The `whole` verdict, or its summary.
    """
    if is_program(target, form, asked) and target.suffix.lower() in controllers.READ_PROGRAMS:
        return _confirmed(planned, target)
    if not is_readable(target, form):
        return verified(planned), ""
    motion = sm.files.read_motion(target)
    match planned:
        case sm.Plan():
            return judged(planned, motion, whole=whole)
        case sm.Move():
            read = sm.Move(
                planned.robot, planned.constraints, motion.of_joints(planned.robot.joint_names)
            )
            return read.verified and planned.verified, f"read back: {read.verdict}"
        case sm.Program() | sm.Parts() if rate is not None:
            # Steps meet between its samples: there is no motion of each that rests at its ends.
            return verified(planned), _samples_text(planned.trajectory, motion, rate)
        case sm.Program():
            found = controllers.judge_motion(motion, planned)
            return found.verified, f"read back: {found.verdict}"
    return _judged_parts(planned, motion, whole=whole)


def _samples_text(motion: sm.Trajectory, read: sm.Trajectory, rate: float) -> str:
    """Return how far a motion leaves the whole that it was sampled from, in words."""
    t = np.append(motion.t, motion.t[:-1] + 0.5 * np.diff(motion.t))
    off = read.of_joints(motion.joint_names)(np.clip(t, None, read.t[-1])) - motion(t)
    return (
        f"at {rate:g} Hz up to {np.abs(off).max():.3g} rad or m off the motion; "
        "its steps are judged only without a rate"
    )


def _judged_parts(planned: sm.Parts, motion: sm.Trajectory, *, whole: bool) -> tuple[bool, str]:
    """Return whether a motion is still that of parts, part by part and move by move."""
    every = motion.of_joints(planned.robot.joint_names)
    stops = np.append(planned.begins, planned.trajectory.duration)
    plans, moves = [], []
    for k, (plan, begin) in enumerate(zip(planned.plans, planned.begins, strict=True)):
        end = begin + plan.trajectory.duration
        read = replace(plan, trajectory=part_of_motion(every, begin, end))
        plans.append(replace(read, certificate=read.check()))
        if k < len(planned.moves):
            after = stops[k + 1]
            part = part_of_motion(every, end, float(after))
            moves.append(sm.Move(planned.robot, planned.moves[k].constraints, part))
    found = replace(planned, plans=tuple(plans), moves=tuple(moves))
    return found.verified, _verdict_text(found, whole)


def _confirmed(planned: Planned, target: Path) -> tuple[bool, str]:
    """Return whether a program keeps what it states, and that in words."""
    read = controllers.read_program(target, planned.robot)
    count, stated, found = controllers.program_deviation(planned, target, read)
    told, kept = [], verified(planned) and controllers.keeps_stated(found, stated)
    for deviation, said, where in zip(
        found, stated, ("off the plan", "in free moves"), strict=True
    ):
        # The file states nine digits.
        kept &= all(one <= other + 1e-9 for one, other in zip(deviation, said, strict=True))
        if deviation.position > 0.0:
            told.append(
                f"{1e3 * deviation.position:.3g} mm and {deviation.rotation:.2g} rad {where} "
                f"({1e3 * said.position:.3g} mm are stated in the file)"
            )
    switched = controllers.switching_faults(read, planned)
    kept &= not switched
    far = f", between which the tool is at most {', and '.join(told)}" if told else ""
    remark, at_feeds = read.remark, read.within is not None
    targets = "target" if count == 1 else "targets"
    paced = ["seams are at their feeds, with ramps of the controller's own"] if at_feeds else []
    paced += [f"a seam has times all the same: {reason}" for reason in read.timed]
    why = (f"they are joints, as poses do not keep the motion: {remark}",) if remark else ()
    return kept, f"read back: {'; '.join((f'{count} {targets}{far}', *paced, *why, *switched))}"


def verified(planned: Planned) -> bool:
    """Whether what was made is verified."""
    return planned.certificate.verified if isinstance(planned, sm.Plan) else planned.verified


def judged(plan: sm.Plan, motion: sm.Trajectory, *, whole: bool) -> tuple[bool, str]:
    """Return whether a motion is still that of a plan, and its verdict in words."""
    found = plan.problem.certify(motion, plan.tolerance, plan.report.ending)
    return found.verified and not plan.altered, _verdict_text(found, whole)


def _verdict_text(found: sm.Certificate | sm.Parts, whole: bool) -> str:
    return f"read back: {found.verdict if whole else found.summary}"


def straight_text(deviation: controllers.LinearDeviation) -> str:
    """Return what straight lines between samples cost, in words."""
    rate = "no --rate keeps" if deviation.rate is None else f"--rate {deviation.rate:.0f} keeps"
    return (
        f"joined by straight lines, the samples stay within {deviation.position:.2g} m and "
        f"{deviation.rotation:.2g} rad of the motion; {rate} the plan's tolerance so (controllers "
        f"of ROS 2 join by cubics or quintics, which are nearer)"
    )


def coarsest_text(rate: float) -> str:
    """Return at which rate messages are, in words."""
    return (
        f"at {rate:g} Hz: the coarsest rate at which straight lines between samples keep the "
        f"plan's tolerance"
    )

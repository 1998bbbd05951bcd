"""Programs of controllers, judged by the jobs that they are of."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations, pairwise
from pathlib import Path as FilePath
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, FileFormatError, ProblemError, RobotError
from selfmotion.certificate import Certificate, Tolerance
from selfmotion.model.motion import Trajectory
from selfmotion.model.path import Placed
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import log3
from selfmotion.planning.result import CheckedMotion, Move, Plan, elsewhere, gaps
from selfmotion.problem.constraints import Constraint
from selfmotion.problem.problem import Problem
from selfmotion.shop.controllers.controller_program import ControllerProgram, Switch
from selfmotion.shop.controllers.pose_numbers import TIME_TOLERANCE
from selfmotion.shop.controllers.pose_segments import PoseSegment
from selfmotion.shop.controllers.program_draft import constraints_of
from selfmotion.shop.controllers.program_facts import check_load
from selfmotion.shop.controllers.program_files import program_deviation, read_program
from selfmotion.shop.controllers.program_steps import StepMotions, step_motions
from selfmotion.shop.controllers.program_texts import plain
from selfmotion.shop.controllers.target_constraints import (
    constraints_of_lines,
    constraints_of_targets,
)
from selfmotion.shop.controllers.work_objects import WORLD, carrier_in_reference
from selfmotion.work.job import Program, are_opposite

# Rounding of angles in files [rad].
_ANGLE_ROUNDING = 1e-6
# Rounding of the ends of a program in joints [rad or m].
_DIGITS = 1e-6
# Rounding of its ends in poses, as joints [rad or m].
_OF_POSES = 1e-5
# Tolerance of the times of outputs, which are switched at targets [s].
_PROMPT = 1e-3
# Distance of a slow motion's end from the end by the program's shift [m].
_EXPLAINED = 1e-3
# Difference of times that are the same [s].
_INSTANT = 1e-9


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


def slow_steps(
    parts: StepMotions, job: Program
) -> tuple[tuple[JudgedStep, ...], Mapping[int, Sequence[CheckedMotion]]]:
    """Return failures of slow motions, and these motions by the step that they are before.

    Each has to keep what the nearest free move has to.
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


def stated_deviation(program: ControllerProgram) -> Tolerance | None:
    """Return how far off its path a program of a controller says it is; None where it does not."""
    if program.within is not None:
        return program.within
    deviation = program.deviation.path
    sound = np.isfinite([deviation.position, deviation.rotation]).all() and deviation.position > 0.0
    return (
        Tolerance(deviation.position, max(deviation.rotation, _ANGLE_ROUNDING)) if sound else None
    )


class JudgedProgram(NamedTuple):
    """Verdict on a controller's program, by the job that it is of.

    Attributes
    ----------
    steps : tuple of JudgedStep
    failures : tuple of str
        What speaks against the whole: its ends, its order, its outputs, the job itself.
    within : Tolerance or None
        What seams may miss their paths by, where that is not the job's own.
    shifted : str
        By how much the work object was shifted, in words; empty for not at all.
    unjudged : str
        What of a program that is verified is the controller's own, in words.
    """

    steps: tuple[JudgedStep, ...]
    failures: tuple[str, ...]
    within: Tolerance | None = None
    shifted: str = ""
    unjudged: str = ""

    @property
    def verified(self) -> bool:
        """Whether each step is, and nothing speaks against the whole."""
        return all(step.verified for step in self.steps) and not self.failures

    @property
    def verdict(self) -> str:
        """One line: verified, or how many steps are not, and what speaks against the whole."""
        if self.verified:
            own = f"; {self.unjudged}" if self.unjudged else ""
            return f"verified: each step, and the whole{self._allowed}{self._shift_note}{own}"
        count = sum(not step.verified for step in self.steps)
        reasons = [*([f"{count} of {len(self.steps)} steps"] if count else []), *self.failures]
        return f"not verified: {'; '.join(reasons)}{self._shift_note}"

    @property
    def _shift_note(self) -> str:
        return f"; {self.shifted}" if self.shifted else ""

    @property
    def _allowed(self) -> str:
        if self.within is None:
            return ""
        return (
            f"; seams within {1e3 * self.within.position:.3g} mm and {self.within.rotation:.2g} "
            f"rad of their paths"
        )


def _judged_move(
    name: str,
    move: Move,
    motions: Sequence[Trajectory],
    judged: Callable[[Sequence[Constraint]], tuple[Constraint, ...]],
) -> JudgedStep:
    """Return the verdict on a move by each interpolation: the first that fails."""
    smooth, lines = judged(move.constraints), constraints_of_lines(judged(move.constraints))
    moves = [Move(move.robot, lines if k else smooth, motion) for k, motion in enumerate(motions)]
    worst = next((move for move in moves if not move.verified), moves[0])
    interpolation = "" if worst is moves[0] else _STRAIGHT
    return JudgedStep(name, worst.verified, f"{worst.verdict}{interpolation}")


def judged_interpolations(
    motions: Sequence[Trajectory],
    judge: Callable[[Trajectory], Certificate],
    judge_lines: Callable[[Trajectory], Certificate] | None = None,
) -> tuple[Certificate, Trajectory]:
    """Return the worst certificate of what a controller may make of targets, and its motion.

    The first motion is smooth, the others go straight (`constraints_of_lines`).

    That is the first which is not verified; else the one with the largest error of the path.
    """
    worst: tuple[Certificate, Trajectory] | None = None
    for number, motion in enumerate(motions):
        certificate = (judge if judge_lines is None or not number else judge_lines)(motion)
        if not certificate.verified:
            said = (
                *certificate.failures[:-1],
                f"{certificate.failures[-1]}{_STRAIGHT if number else ''}",
            )
            return replace(certificate, failures=said), motion
        if worst is None or certificate.position_error.value > worst[0].position_error.value:
            worst = certificate, motion
    if worst is None:
        raise ProblemError("there is no motion to judge")
    return worst


# Said of a motion that is not smooth through its targets.
_STRAIGHT = " (where the controller goes straight between targets, or rounds their corners)"


def judged_program(file: FilePath, job: Program, within: Tolerance | None = None) -> JudgedProgram:
    """Judge a controller's program by the job that it is of: each step, and the whole.

    Seams by all that their plans had to keep, at the deviation that the file states; moves by all
    of theirs. Accelerations are the controller's, and not judged. The whole has to begin and end
    where the job does, and to switch what its events say, when they say it: an output or a comment
    for each, the same for each event of one name, and nothing else. Where the work object was
    shifted, seams have to be on their paths shifted with it, and the whole begins and ends
    elsewhere; slow motions to where it goes on have to keep what the move beside them has to.

    Raises
    ------
    FileFormatError
        The file cannot be read, or is of another job.
    """
    program = read_program(file, job.robot)
    allowed = within or stated_deviation(program)
    parts = step_motions(file, program, job)
    steps, checked = _judged_steps(job, parts.motions, allowed, constraints_of_targets, program)
    slow, between = slow_steps(parts, job)
    checked = [item for k, own in enumerate(checked) for item in (*between.get(k, ()), own)]
    # From axis targets to poses there are digits of both, which the arm's kinematics may magnify.
    digits = _OF_POSES if any(isinstance(s, PoseSegment) for s in program.segments) else _DIGITS
    failures = (
        *(f"the job itself: {text}" for text in job.failures),
        *gaps(job.robot, checked, digits),
        *_elsewhere(job, checked, digits, program),
        *([program.start_fault] if program.start_fault else []),
        *switching_faults(program, job),
        *_off_moves(file, program, job, parts),
        *differing_facts(program, job.robot, constraints_of(job)),
    )
    left = controller_note(program)
    return JudgedProgram((*steps, *slow), failures, allowed, shift_note(program), left)


def _shifted_moves(program: ControllerProgram, job: Program, parts: StepMotions) -> Iterator[str]:
    """Yield what of a shifted program is elsewhere without the shift's doing.

    Moves by joint targets, which know no work object; and slow motions that go farther than from
    where a joint target is to where the shifted pose of it is, or back.
    """
    stated = program.deviation.moves.joint
    for step, motions, is_shifted in zip(job.steps, parts.motions, parts.by_poses, strict=True):
        if isinstance(step.made, Plan) or is_shifted:
            continue
        t = np.union1d(step.motion.t, step.motion.t[:-1] + 0.5 * np.diff(step.motion.t))
        here = step.motion(t)
        for motion in motions:
            off = np.abs(motion(np.minimum(t - t[0], motion.t[-1])) - here).max()
            if off > stated + _DIGITS:
                yield (
                    f"'{step.name}' has joints {off:.4g} rad or m off the move of the job, the "
                    f"file states {stated:.4g}; a work object that is shifted moves no joint target"
                )
                break
    shift = program.shift
    frame = carrier_in_reference(job.robot, program.carrier)
    if shift is None or frame is None:
        return
    for number, motions in parts.slow:
        ends = [job.robot.chain.place(q) for q in motions[0].q[[0, -1]]]
        first, last = (np.asarray(frame.actInv(end.translation)) for end in ends)
        explained = min(
            np.linalg.norm(np.asarray(shift.act(first)) - last),
            np.linalg.norm(np.asarray(shift.act(last)) - first),
        )
        if explained > _EXPLAINED:
            yield (
                f"before '{job.steps[number].name}' it goes slowly to where neither the job is nor "
                f"the shift of its work object takes it ({1e3 * explained:.3g} mm)"
            )


def _off_moves(
    file: FilePath, program: ControllerProgram, job: Program, parts: StepMotions
) -> Iterator[str]:
    """Yield by how much free moves leave those of the job, beyond what the file states."""
    if program.shift is not None:
        yield from _shifted_moves(program, job, parts)
        return
    _, stated, deviations = program_deviation(job, file, program)
    if any(one > other + 1e-9 for one, other in zip(deviations.moves, stated.moves, strict=True)):
        yield (
            f"free moves are up to {1e3 * deviations.moves.position:.4g} mm, joints "
            f"{deviations.moves.joint:.4g} rad or m off those of the job, the file states "
            f"{1e3 * stated.moves.position:.4g} mm and {stated.moves.joint:.4g}"
        )


def differing_facts(
    program: ControllerProgram, robot: RobotModel, constraints: Sequence[Constraint]
) -> Iterator[str]:
    """Yield what a program rests on that is not so where it is judged: held joints, its load."""
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


def shift_note(program: ControllerProgram) -> str:
    """Return by how much the work object is elsewhere than planned, in words; empty for not."""
    if program.shift is None:
        return ""
    distance = 1e3 * float(np.linalg.norm(program.shift.translation))
    turn = float(np.degrees(np.linalg.norm(log3(program.shift.rotation))))
    return (
        f"the work object is {distance:.4g} mm and {turn:.3g}° from where it was planned: judged "
        f"along the path shifted with it"
    )


def as_shifted(problem: Problem, program: ControllerProgram, begin: Array) -> Problem:
    """Return a problem whose path is shifted as the work object of a program is.

    Parameters
    ----------
    problem : Problem
    program : ControllerProgram
    begin : (n,)
        Where the motion begins.

    Raises
    ------
    FileFormatError
        The path is given in a frame that moves past the work object.
    """
    if program.shift is None:
        return problem
    robot = problem.robot
    place = carrier_in_reference(robot, program.carrier)
    if place is None or problem.also:
        raise FileFormatError(
            f"its work object is shifted, and the path is given in '{robot.reference or WORLD}', "
            f"which moves past it: plan again with the part where it is"
        )
    path = Placed(problem.path, place * program.shift * place.inverse())
    start = None if problem.start is None else begin
    return replace(problem, path=path, start=start)


def switching_faults(program: ControllerProgram, planned: object) -> tuple[str, ...]:
    """Return the differences between the outputs of a controller's program and its job's events.

    A plan, parts or a move have no events.
    """
    if isinstance(planned, Program):
        return tuple(_otherwise_switched(planned, program))
    return tuple(
        f"'{switch.output}' is switched at {switch.at:.4f} s, and the motion has no events"
        for switch in program.switches
    )


def judged_motion(motion: Trajectory, job: Program) -> JudgedProgram:
    """Judge a motion that was read by the job that it is of: each step, and the whole.

    By all that the job asks for; its outputs are none of a motion's.

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
    motions = [[part_of(whole, first, last)] for first, last in pairwise(ends)]
    steps, checked = _judged_steps(job, motions, None, tuple)
    failures = (
        *(f"the job itself: {text}" for text in job.failures),
        *gaps(job.robot, checked),
        *_elsewhere(job, checked),
    )
    return JudgedProgram(steps, failures)


def part_of(motion: Trajectory, first: float, last: float) -> Trajectory:
    """Return the part of a motion from one of its times to another [s], from t = 0 on."""
    first, last = motion.t[0] + first, min(motion.t[0] + last, motion.t[-1])
    inside = motion.t[(motion.t > first + _INSTANT) & (motion.t < last - _INSTANT)]
    t = np.concatenate([[first], inside, [last]])
    faster = None if motion.qdd is None else motion(t, 2)
    return Trajectory(t - first, motion(t), motion(t, 1), motion.joint_names, faster)


def _judged_steps(
    job: Program,
    motions: Sequence[Sequence[Trajectory]],
    within: Tolerance | None,
    judged: Callable[[Sequence[Constraint]], tuple[Constraint, ...]],
    program: ControllerProgram | None = None,
) -> tuple[tuple[JudgedStep, ...], list[CheckedMotion]]:
    """Return the certificates of the motions of a job's steps, by the limits that are `judged`."""
    judged_steps, checked = list[JudgedStep](), list[CheckedMotion]()
    for step, own in zip(job.steps, motions, strict=True):
        planned = step.made
        if isinstance(planned, Move):
            judged_steps.append(_judged_move(step.name, planned, own, judged))
        else:
            problem = replace(planned.problem, constraints=judged(planned.problem.constraints))
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


def _elsewhere(
    job: Program,
    checked: Sequence[CheckedMotion],
    digits: float = _DIGITS,
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
        yield from elsewhere(job.robot, checked[end], end, wanted, digits)


def _otherwise_switched(job: Program, program: ControllerProgram) -> Iterator[str]:
    """Yield what of a job's events a program does not switch, or switches otherwise."""
    events = sorted(job.events, key=lambda event: event[0])
    switched = sorted(program.switches, key=lambda switch: switch.at)
    stated = None if program.facts is None else program.facts.outputs
    if events and stated is None:
        yield "its head does not say which output each event switches: write the program again"
    if len(events) != len(switched):
        yield f"it switches {len(switched)} times, the job {len(events)} times"
        return
    switches: dict[str, Switch] = {}
    for (at, seam, event), switch in zip(events, switched, strict=True):
        if abs(at - switch.at) > _PROMPT:
            yield (
                f"event '{event}' of '{seam}' is at {at:.4f} s, but '{switch.output}' is switched "
                f"at {switch.at:.4f} s"
            )
        if switch.value is None and switch.output != plain(event):
            yield f"event '{event}' of '{seam}' is called '{switch.output}'"
        if stated is not None and plain(event) in stated:
            meant = stated[plain(event)]
            if meant is None and switch.value is not None:
                yield f"event '{event}' is a comment only, but '{switch.output}' is switched"
            if meant is not None and meant != (switch.output, switch.value):
                yield (
                    f"event '{event}' switches '{switch.output}' to {switch.value} at "
                    f"{switch.at:.4f} s, it was written to switch '{meant[0]}' to {meant[1]}"
                )
        elif stated is not None:
            yield f"its head does not say which output event '{event}' switches"
        before = switches.setdefault(event, switch)
        if before[1:] != switch[1:]:
            yield (
                f"event '{event}' switches '{before.output}' to {before.value} once, and "
                f"'{switch.output}' to {switch.value} at {switch.at:.4f} s"
            )
    for (one, first), (other, second) in combinations(switches.items(), 2):
        if first.value is not None and first[1:] == second[1:] and are_opposite(one, other):
            yield f"events '{one}' and '{other}' both switch '{first.output}' to {first.value}"

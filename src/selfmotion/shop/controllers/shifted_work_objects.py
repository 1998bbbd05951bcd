"""Programs whose work object was shifted: the path goes with it, joint targets do not."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from selfmotion.basics import Array, FileFormatError
from selfmotion.model.path import Path, Placed
from selfmotion.model.task import log3
from selfmotion.planning.result import Plan
from selfmotion.problem.problem import Problem
from selfmotion.shop.controllers.controller_program import ControllerProgram
from selfmotion.shop.controllers.pose_numbers import JOINT_ROUNDING
from selfmotion.shop.controllers.program_steps import StepMotions
from selfmotion.shop.controllers.work_objects import WORLD, carrier_in_reference
from selfmotion.work.job import Program

# Largest distance from the end of a slow motion to where the shift puts that end [m].
_SHIFT_TOLERANCE = 1e-3


def shift_note(program: ControllerProgram, *, moved: bool = True, obstacles: bool = False) -> str:
    """Return how far the work object is from where it was planned, in words; "" for not at all.

    Parameters
    ----------
    program : ControllerProgram
    moved : bool
        Whether it is judged along the path shifted with it, see `is_nearer`.
    obstacles : bool
        Whether there are obstacles, which are not shifted.
    """
    if program.shift is None:
        return ""
    distance = 1e3 * float(np.linalg.norm(program.shift.translation))
    turn = float(np.degrees(np.linalg.norm(log3(program.shift.rotation))))
    off = f"the work object is {distance:.4g} mm and {turn:.3g}° from where it was planned"
    if not moved:
        return f"{off}: judged along the path where the file has it, as the program goes there"
    text = f"{off}: judged along the path shifted with it"
    if not obstacles:
        return text
    return (
        f"{text}, and by obstacles where they were planned; where some moved with the part, judge "
        f"it by a problem file with the part where it is now (--robot)"
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


def is_nearer(problem: Problem, shifted: Problem, ends: Array) -> bool:
    """Return whether a motion goes where a problem's path is, and not where the shifted one is.

    That is so where the part is where it is now in the file of the problem. A path of a plan or a
    job is where it was planned, and is shifted whatever the motion.

    Parameters
    ----------
    problem, shifted : Problem
        See `as_shifted`.
    ends : (2, n)
        Where the motion begins and ends.
    """
    distances = [_distance(problem, path, ends) for path in (problem.path, shifted.path)]
    return distances[0] < distances[1] - _SHIFT_TOLERANCE


def _distance(problem: Problem, path: Path, ends: Array) -> float:
    """Return how far the tool is from both ends of a path, in all [m]."""
    places = [problem.robot.chain.place(q).translation for q in ends]
    wanted = [path.pose(time).translation for time in (0.0, path.duration)]
    return float(np.linalg.norm(np.array(places) - np.array(wanted), axis=1).sum())


def shifted_move_faults(
    program: ControllerProgram, job: Program, parts: StepMotions
) -> Iterator[str]:
    """Yield the motions between seams that are elsewhere for another reason than the shift.

    Joint targets do not shift, so moves by them have to be those of the job. A slow motion has to
    lead from a joint target to where the shift puts its pose, or back.
    """
    stated = program.deviation.moves.joint
    for step, motions, is_shifted in zip(job.steps, parts.motions, parts.by_poses, strict=True):
        if isinstance(step.made, Plan) or is_shifted:
            continue
        t = np.union1d(step.motion.t, step.motion.t[:-1] + 0.5 * np.diff(step.motion.t))
        planned_q = step.motion(t)
        for motion in motions:
            off = np.abs(motion(np.minimum(t - t[0], motion.t[-1])) - planned_q).max()
            if off > stated + JOINT_ROUNDING:
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
        distance = min(
            np.linalg.norm(np.asarray(shift.act(first)) - last),
            np.linalg.norm(np.asarray(shift.act(last)) - first),
        )
        if distance > _SHIFT_TOLERANCE:
            yield (
                f"before '{job.steps[number].name}' it goes slowly to where neither the job is nor "
                f"the shift of its work object takes it ({1e3 * distance:.3g} mm)"
            )

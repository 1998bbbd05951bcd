"""Motions that are shown before there is a plan, or in place of one; nothing of them is proved."""

from collections.abc import Mapping, Sequence

import numpy as np

from selfmotion.basics import Array, Flags, RobotError
from selfmotion.model.motion import Trajectory
from selfmotion.model.robot import RobotModel
from selfmotion.planning.result import Plan
from selfmotion.planning.search import Manifold
from selfmotion.problem.problem import Problem
from selfmotion.shell.documents import SeamJob
from selfmotion.shell.replay import Mark, SequenceReplay, stand_in, unproved
from selfmotion.work.job import Program, Step, backwards

# Times of a coarse motion.
_TIMES = 41
# How long a move that was not found is drawn as a straight one [s].
_GAP = 1.0
_PLANNING = "planning …"


def coarse(problem: Problem, before: Trajectory) -> Plan:
    """Return the motion before, put onto the path of a problem time by time; nothing is proved.

    Its message says where it cannot be: where Newton's method finds no configuration near, which
    stays where it was then.
    """
    motion, arrived = _put(problem, before)
    words = _PLANNING
    if not arrived.all():
        first = motion.t[~arrived][0]
        words = f"{_PLANNING}; out of reach near the motion before, from t = {first:.3g} s"
    return unproved(problem, motion, words)


def _put(problem: Problem, before: Trajectory) -> tuple[Trajectory, Flags]:
    """Return a motion put onto a path, and at which of its times it could be."""
    robot, follows, path = problem.robot, problem.follows, problem.path
    share = np.linspace(0.0, 1.0, _TIMES)
    times = share * path.duration
    near = before(before.t[0] + share * (before.t[-1] - before.t[0]))
    manifold = Manifold(follows, robot.lower, robot.upper)
    reached, arrived = manifold.project(near, follows.targets(times), held=follows.held(times))
    q = np.where(arrived[:, None], reached, near)
    return Trajectory(times, q, np.gradient(q, times, axis=0), robot.joint_names), arrived


def standing(problem: Problem, last: Plan | None, words: str) -> Plan:
    """Return a plan in which the arm stands, for a page that has no motion to show.

    It stands where the motion before began, else where the problem does; its certificate says why.
    """
    robot = problem.robot
    if problem.given_start is not None:
        q = problem.given_start
    elif last is not None and last.robot.joint_names == robot.joint_names:
        q = last.trajectory.q[0]
    else:
        q = _somewhere(robot)
    return unproved(problem, _still(robot, q, problem.path.duration), words)


def _somewhere(robot: RobotModel) -> Array:
    """Return the home of an arm, or of one without a known home the middle of its limits."""
    try:
        return robot.home
    except RobotError:
        middle = 0.5 * (robot.lower + robot.upper)
        return np.where(np.isfinite(middle), middle, 0.0)


def _still(robot: RobotModel, q: Array, seconds: float) -> Trajectory:
    q = np.tile(q, (2, 1))
    return Trajectory(np.array([0.0, seconds]), q, np.zeros_like(q), robot.joint_names)


def coarse_program(job: SeamJob, before: Program) -> SequenceReplay:
    """Return a program put onto the paths of a job, seam by seam; moves are bent after it."""
    problems = dict(zip((seam.name for seam in job.seams), job.problems, strict=True))
    put, unreached = dict[int, Trajectory](), list[str]()
    for number, step in enumerate(before.steps):
        if step.is_seam and step.name in problems:
            problem = problems[step.name]
            problem = backwards(problem) if step.turned else problem
            put[number], arrived = _put(problem, step.motion)
            unreached += [] if arrived.all() else [f"'{step.name}'"]
    words = _PLANNING
    if unreached:
        words = f"{_PLANNING}; out of reach near the motion before: {', '.join(unreached)}"
    return _joined(before.steps, put, next(iter(problems.values())), words)


def standing_program(job: SeamJob, last: Program | None, words: str) -> SequenceReplay:
    """Return an arm that stands, for a job of which no seam has a motion."""
    robot, problem = job.robot, job.problems[0]
    known = list[Array]()
    if last is not None and last.robot.joint_names == robot.joint_names:
        known = [step.motion.q[0] for step in last.steps if not step.is_missing]
    q = known[0] if known else _somewhere(robot)
    motion = _still(robot, q, _GAP)
    return _unproved(problem, motion, (Mark(0.0, _GAP, "no motion", False),), words)


def shown_program(program: Program) -> SequenceReplay:
    """Return a program as a page shows it; moves that were not found are straight in joints."""
    if not any(step.is_missing for step in program.steps):
        return SequenceReplay.of(program)
    problem = next(iter(program.plans.values())).problem
    return _joined(program.steps, {}, problem, program.verdict)


def shown_as_written(program: Program, written: Sequence[Trajectory], words: str) -> SequenceReplay:
    """Return a program with the motions (one for each step) that a controller makes of it."""
    problem = next(iter(program.plans.values())).problem
    return _joined(program.steps, dict(enumerate(written)), problem, words)


def _joined(
    steps: Sequence[Step], put: Mapping[int, Trajectory], problem: Problem, words: str
) -> SequenceReplay:
    """Return steps with some of their motions put elsewhere; moves are bent so that all meet.

    The bodies are those of a problem.
    """
    given = [
        put.get(number, None if step.is_missing else step.motion)
        for number, step in enumerate(steps)
    ]
    marks, times, places = list[Mark](), [np.zeros(1)], list[Array]()
    for number, (step, motion) in enumerate(zip(steps, given, strict=True)):
        before = given[number - 1] if number > 0 else None
        after = given[number + 1] if number + 1 < len(steps) else None
        ends = None if before is None else before.q[-1], None if after is None else after.q[0]
        if motion is None:
            t, q = np.array([0.0, _GAP]), np.array([end for end in ends if end is not None])
            q = q if len(q) > 1 else np.repeat(q, 2, axis=0)
        else:
            t, q = motion.t - motion.t[0], motion.q
            q = q if step.is_seam else _bent(t / t[-1], q, ends)
        begin = times[-1][-1]
        marks.append(Mark(float(begin), float(begin + t[-1]), step.name, step.is_seam))
        times.append(begin + t[1:])
        places += [q[1:]] if places else [q[:1], q[1:]]
    t, q = np.concatenate(times), np.concatenate(places)
    robot = problem.robot
    motion = Trajectory(t, q, np.gradient(q, t, axis=0), robot.joint_names)
    return _unproved(problem, motion, tuple(marks), words)


def _bent(share: Array, q: Array, ends: tuple[Array | None, Array | None]) -> Array:
    """Return a motion (K, n) by shares of its time (K,), led to where its ends have to be."""
    first, last = (
        np.zeros_like(own) if end is None else end - own
        for own, end in zip((q[0], q[-1]), ends, strict=True)
    )
    return np.asarray(q + np.outer(1.0 - share, first) + np.outer(share, last))


def _unproved(
    problem: Problem, motion: Trajectory, marks: tuple[Mark, ...], words: str
) -> SequenceReplay:
    plan = stand_in(problem.robot, motion, problem.all_constraints)
    bodies = {body.name: body for item in problem.requirements for body in item.obstacles}
    return SequenceReplay(plan, marks, words, False, (), tuple(bodies.values()), False)

"""Several motions along one path from different start configurations."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from selfmotion.basics import Array, Progress, SelfmotionError, presses, silent
from selfmotion.model.follow import within_limits
from selfmotion.planning.formulation import on_path
from selfmotion.planning.optimise import Status
from selfmotion.planning.planner.effort import Search
from selfmotion.planning.planner.grids import rough_grid
from selfmotion.planning.planner.rough import wound_back
from selfmotion.planning.planner.run import plan
from selfmotion.planning.result import Plan
from selfmotion.planning.search import carried, start_candidates
from selfmotion.planning.transfer import Room
from selfmotion.problem.problem import Problem, envelope_of_problem

# Starts that are tried for each requested branch.
_BRANCH_TRIES = 4
# Limit of evaluations of each plan.
_BRANCH_EVALUATIONS = 60
# Plans with both ends nearer than this are the same [rad or m].
_SAME_ENDS = 0.2


def branches(
    problem: Problem,
    count: int,
    rng: np.random.Generator,
    allowed: Problem | None = None,
    progress: Progress = silent,
) -> tuple[list[Plan], str]:
    """Return up to `count` verified plans of a problem with distant starts.

    Each starts at an allowed configuration on the start of the path, the next one as far as
    possible from those before. If none of these leads to a verified plan, the result is that of
    `plan`.

    Parameters
    ----------
    problem : Problem
    count : int
    rng : Generator
    allowed : Problem, optional
        The same with more that stands there, which the starts keep clear of; the plans need not.
        With it nothing more is tried.
    progress : callable, optional

    Returns
    -------
    plans : list of Plan
        Different ones at both ends; empty where there are none.
    reason : str
        Why not, where there are none.
    """
    found: list[Plan] = []
    reason, failed = "", 0
    for number, start in enumerate(_spread(allowed or problem, rng), 1):
        if len(found) == count or failed == _BRANCH_TRIES or number > _BRANCH_TRIES * count:
            break
        progress("branch", number, _BRANCH_TRIES * count)
        planned, why = from_start(problem, start)
        failed += planned is None
        reason = reason or why
        if planned is not None and all(
            _end_distance(planned, other) > _SAME_ENDS for other in found
        ):
            found.append(planned)
    if found or allowed is not None:
        return found, "" if found else reason or _nowhere(allowed or problem)
    try:
        planned = _whole(lambda: plan(problem, search=Search(rng=rng), progress=progress))
    except SelfmotionError as error:
        return [], str(error)
    if planned.certificate.verified:
        return [planned], ""
    return [], reason or planned.certificate.verdict


def like_before(problem: Problem, before: Plan) -> Plan | None:
    """Return the verified plan of a warm start at another one's motion, or None."""
    start = near_start(problem, before.trajectory.q[0])
    return None if start is None else from_start(problem, start, before)[0]


def from_start(
    problem: Problem, start: Array, before: Plan | None = None
) -> tuple[Plan | None, str]:
    """Return the verified plan from a start (n,), or None and the cause.

    `before` may be a warm start.
    """
    given = replace(problem, start=start)
    try:
        most = _BRANCH_EVALUATIONS
        planned = _whole(lambda: plan(given, warm_start=before, max_evaluations=most))
    except SelfmotionError as error:
        return None, str(error)
    if planned.certificate.verified:
        return planned, ""
    return None, planned.certificate.verdict


def _whole(make: Callable[[], Plan]) -> Plan:
    """Make a plan; KeyboardInterrupt of an interrupted one is raised again, whatever it found."""
    pressed = presses()
    planned = make()
    if presses() > pressed or planned.report.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    return planned


def near_start(problem: Problem, q: Array) -> Array | None:
    """Return the start of a problem's path (n,) that Newton's method finds from a configuration.

    None where it finds none that is allowed.
    """
    robot = envelope_of_problem(problem).arm(problem.robot)
    try:
        start = robot.inverse_kinematics(problem.path.pose(0.0), problem.task, seed=q, attempts=1)
    except SelfmotionError:
        return None
    return start if _room(problem).free(start[None])[0] else None


def _room(problem: Problem) -> Room:
    return Room(envelope_of_problem(problem), problem.robot)


def _spread(problem: Problem, rng: np.random.Generator) -> list[Array]:
    """Return allowed starts, each as far as any from those before, the first in the middle."""
    allowed = envelope_of_problem(problem)
    follows = within_limits(problem.follows, allowed.lower, allowed.upper)
    own, room = follows.coordinates, _room(problem)
    try:
        starts = np.array(start_candidates(follows, Search().starts, rng, room.free))
    except SelfmotionError:
        return []
    starts = starts[room.free(starts)]
    if not len(starts):
        return []
    # Wrists start near their usual angle, not a turn away.
    motions, arrived = carried(follows, starts, rough_grid(on_path(problem)).nodes)
    back = np.array([wound_back(own, motion)[0] for motion in motions])
    starts = np.where((arrived & room.free(back))[:, None], back, starts)
    distances = np.abs(starts[:, None] - starts) @ own.weights
    lower, upper = own.finite_limits()
    order = [int(np.argmin(np.abs(starts - 0.5 * (lower + upper)) @ own.weights))]
    while len(order) < len(starts):
        nearest = distances[order].min(axis=0)
        nearest[order] = -1.0
        order.append(int(np.argmax(nearest)))
    return [starts[k] for k in order]


def _end_distance(one: Plan, other: Plan) -> float:
    """Return the larger distance of both ends of two plans."""
    ends = one.trajectory.q[[0, -1]] - other.trajectory.q[[0, -1]]
    return float(np.abs(ends).max(axis=1).max())


def _nowhere(problem: Problem) -> str:
    """Return the cause why a path has no start."""
    allowed, follows = envelope_of_problem(problem), problem.follows
    try:
        starts = np.array(start_candidates(follows, _BRANCH_TRIES, np.random.default_rng(0)))
    except SelfmotionError as error:
        return str(error)
    for model, far in allowed.bodies:
        near = model.worst(starts)
        if near.value < far:
            return (
                f"no configuration was found that puts the tool on its start and meets nothing: of "
                f"{len(starts)} one has {near.first} and {near.second} {near.value * 1e3:.2f} mm "
                f"apart (wanted: {far * 1e3:.2f} mm)"
            )
    return "no configuration was found that puts the tool on its start and keeps what is asked"

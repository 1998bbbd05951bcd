"""From a problem to a plan."""

from dataclasses import replace

from selfmotion.basics import (
    PlanError,
    ProblemError,
    Progress,
    as_called,
    as_number,
    as_whole,
    held_interruption,
    one_blas_thread,
    shown,
    silent,
    was_interrupted,
)
from selfmotion.certificate import Tolerance
from selfmotion.optimise import Callback, Optimizer, Status
from selfmotion.planning.effort import Deadline, Effort
from selfmotion.planning.grids import is_published
from selfmotion.planning.outcome import gathered
from selfmotion.planning.planner import Planner
from selfmotion.planning.search import Search
from selfmotion.planning.settings import DAMPED_EVALUATIONS
from selfmotion.planning.steps import go_through
from selfmotion.planning.warm_start import check_warm_start
from selfmotion.problem import Problem, check_feeds_of, check_problem
from selfmotion.result import Plan
from selfmotion.search import SequenceGuide


def plan(
    problem: Problem,
    *,
    optimizer: Optimizer | None = None,
    search: Search | None = None,
    warm_start: Plan | None = None,
    tolerance: Tolerance | None = None,
    max_evaluations: int | None = None,
    deadline: float | None = None,
    callback: Callback | None = None,
    progress: Progress = silent,
) -> Plan:
    """Plan the joint motion that follows the path exactly and minimises the costs.

    Parameters
    ----------
    problem : Problem
    optimizer : Optimizer, optional
        Minimises by the published method: over the coefficients of the problem's null motion, a
        cubic by default, with nothing asked but given ends and closure. By default Newton's method
        on nodes keeps all constraints, and `QuasiNewton` serves where a null motion or damping
        asks for the published method.
    search : Search, optional
        How to search where the start is free, and whether to compare with a global search.
    warm_start : Plan, optional
        A plan of this problem or of one like it: its null motion is the initial guess, unless the
        minimum-norm motion is better. Where the start is free, its start too; others are tried only
        if that falls short.
    tolerance : Tolerance, optional
        Allowed deviation from the path, between samples as well. The number of steps
        follows from it.
    max_evaluations : int, optional
        Limit on evaluations of the cost while optimising one start; the finished motion is
        evaluated a few times more. By default none, but 400 with damping and 150 on each part of
        the path (30 where the start is free), where limits of joint speed often cannot be met and
        trying would take minutes.
    deadline : float, optional
        After so many seconds planning stops with the best motion so far: no worse than the
        minimum-norm motion, or than what the search began with. It is then judged like any other
        plan, which takes some more time.
    callback : callable, optional
        Called with each `Iteration`; returning True stops, keeping the best so far.
    progress : callable, optional
        Told the stage, how much of it has begun, and of how many: ``("start", 3, 24)``; of 0, news:
        that no motion passes a pose is told at once, before the part of the path that can be
        followed is planned. It may raise `KeyboardInterrupt` to stop.

    Returns
    -------
    Plan
        Also where the search fell short: `Plan.report` and `Plan.certificate` say so, and
        `Plan.require` raises. Where the path leaves the workspace, within the joint limits, or no
        motion passes a singular pose: the motion on the largest part [0, t] that was found, never
        verified, with t and the reason in its verdict. After an interruption (Ctrl-C) the best
        plan that was known by then, checked like any other; its status says so.

    Raises
    ------
    BreakdownError
        The minimum-norm motion runs into a singular pose, from every start, so early that no part
        of the path is worth a plan.
    InverseKinematicsError
        The start is free and no configuration reaches the start of the path.
    FeedError
        The path asks for a feed that it cannot have, whatever the arm; before anything is planned.
    NoSequenceError
        The global search finds that no motion follows the path; says where it ends and why.
    PlanError
        The deadline came before there was a complete motion.
    ProblemError
        An argument is not what it should be, or has no effect on this problem.
    KeyboardInterrupt
        The interruption came before there was a complete motion.
    """
    _check(problem, search, max_evaluations)
    if warm_start is not None:
        check_warm_start(warm_start, problem)
    is_one = callable(getattr(optimizer, "minimize", None)) and not isinstance(optimizer, type)
    if optimizer is not None and not is_one:
        raise ProblemError(f"optimizer is {shown(optimizer)}, expected one such as QuasiNewton()")
    if callback is not None:
        as_called(callback, "callback")
    check_feeds_of(problem)
    seconds = None if deadline is None else as_number(deadline, "deadline", above=0.0)
    clock = Deadline.after(seconds)
    if problem.damping is not None and max_evaluations is None:
        max_evaluations = DAMPED_EVALUATIONS
    effort = Effort(optimizer, callback, max_evaluations, clock)
    if problem.relaxations and is_published(problem, effort):
        raise ProblemError(
            "relaxations: the published method keeps nothing but given ends, so that the tool "
            "would leave its tolerances; leave null_motion out, optimizer and damping too"
        )
    search, problem = search or Search(), problem.augmented
    if warm_start is not None:
        known = problem.with_own(warm_start.trajectory, warm_start.path)
        warm_start = replace(warm_start, trajectory=known)
    planner = Planner(
        problem,
        effort,
        search,
        Tolerance.of(tolerance),
        clock.checked_by(progress),
        warm_start=warm_start,
    )
    try:
        with one_blas_thread(), held_interruption():
            return _planned(planner, clock)
    except KeyboardInterrupt:
        if not clock.passed:
            raise
        raise PlanError(
            f"the deadline of {deadline} s came before there was a complete motion; allow more "
            f"time, or give a start"
        ) from None


def plan_along(
    problem: Problem, guide: SequenceGuide, tolerance: Tolerance, progress: Progress
) -> Plan:
    """Plan as `plan` does, but try a motion first that is known, near which there should be one."""
    clock = Deadline()
    effort = Effort(None, None, None, clock)
    problem, chain = problem.augmented, guide.sequence
    guide = SequenceGuide(replace(chain, q=problem.at(chain.t, chain.q)))
    planner = Planner(problem, effort, Search(), tolerance, progress, guide=guide)
    with one_blas_thread(), held_interruption():
        return _planned(planner, clock)


def _planned(planner: Planner, clock: Deadline) -> Plan:
    """Return the plan, told of an interruption that came when all was done."""
    go_through(planner)
    found = gathered(planner, clock)
    return told_of(found, Status.INTERRUPTED) if was_interrupted() else found


def told_of(plan: Plan, status: Status) -> Plan:
    """Return a plan whose report says what kept another one from being tried to the end."""
    message = f"{status.message}; before: {plan.report.message}"
    return replace(plan, report=replace(plan.report, status=status, message=message))


def _check(problem: Problem, search: Search | None, max_evaluations: int | None) -> None:
    check_problem(problem)
    if search is not None and not isinstance(search, Search):
        raise ProblemError(f"search is {shown(search)}, expected Search(mode=…, starts=…, …)")
    if search is not None and problem.given_start is not None and not search.compare:
        raise ProblemError(
            "search= has no effect, since the problem's start is given; leave one of them out, or "
            "ask for Search(compare=True)"
        )
    redundancy = problem.follows.redundancy
    if search is not None and search.compare and redundancy != 1:
        raise ProblemError(
            f"compare: the global search needs redundancy 1, but {problem.robot.name} has "
            f"{redundancy} for task '{problem.task.value}'"
        )
    if max_evaluations is not None:
        as_whole(max_evaluations, "max_evaluations", least=1, most=10**9)

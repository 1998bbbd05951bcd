"""From a problem to a plan and its report."""

import time
from collections import abc
from dataclasses import replace

import numpy as np

from selfmotion.basics import (
    DeadlineError,
    ProblemError,
    Progress,
    as_called,
    as_whole,
    held_interruption,
    one_blas_thread,
    read_only,
    shown,
    silent,
    was_interrupted,
)
from selfmotion.certificate import Certificate, Tolerance
from selfmotion.model.follow import completed
from selfmotion.model.motion import FreeNullMotion
from selfmotion.planning.formulation import Formulation, arm_motion, motion_of_all
from selfmotion.planning.optimise import Callback, Optimizer, QuasiNewton, Status
from selfmotion.planning.planner.effort import Deadline, Effort, Search
from selfmotion.planning.planner.guess import check_warm_start
from selfmotion.planning.planner.judging import Judged
from selfmotion.planning.planner.planner import Planner
from selfmotion.planning.planner.setup import Setup
from selfmotion.planning.planner.solution import have_one_start
from selfmotion.planning.planner.steps import go_through
from selfmotion.planning.result import Gap, Plan, Report
from selfmotion.planning.search import SPACING, Sequence
from selfmotion.problem.problem import Problem, check_feeds_of, check_problem

# Limit of evaluations of the cost of a damped motion.
_DAMPED_EVALUATIONS = 400


def gathered(planner: Planner, deadline: Deadline) -> Plan:
    """Return the plan.

    Raises
    ------
    KeyboardInterrupt
        The interruptions left no time for a proof.
    """
    judged = planner.judged
    if judged is None:
        raise KeyboardInterrupt
    part, motion, minimum_norm, check = (
        judged.part,
        judged.motion,
        judged.minimum_norm,
        judged.certificate,
    )
    solution = part.solution
    if deadline.passed and solution.status is Status.INTERRUPTED:
        solution = solution.ended_by(Status.DEADLINE)
    counts, facts = solution.guess.effort.counts, solution.outcome.facts()
    status = status_of(solution.status, check)
    report = Report(
        cost=motion.cost,
        initial_cost=minimum_norm.cost,
        terms=motion.terms,
        initial_terms=minimum_norm.terms,
        evaluations=counts.evaluations,
        gradient_evaluations=counts.gradients,
        jacobian_evaluations=counts.jacobians,
        steps=len(motion.trajectory.t) - 1,
        iterations=len([one for one in solution.history if one.step > 0.0]),
        history=solution.history,
        status=status,
        message=message_of(
            status,
            solution.violations,
            check,
            ending=part.ending,
            notes=planner.notes,
            published=not planner.effort.keeps_conditions,
        ),
        seconds=time.perf_counter() - planner.began,
        gap=_gap(planner, judged),
        ending=part.ending,
        active=facts.active,
        null_motion=facts.null_motion,
        remaining=facts.remaining,
        attempts=tuple(planner.attempts),
        obstruction=planner.stops,
        remedy=planner.advice,
    )
    return Plan(
        problem=planner.formulation.problem,
        trajectory=arm_motion(planner.formulation, motion.trajectory),
        initial_trajectory=arm_motion(planner.formulation, minimum_norm.trajectory),
        coefficients=read_only(facts.coefficients),
        report=report,
        certificate=report.explained(check),
    )


def _gap(planner: Planner, judged: Judged) -> Gap | None:
    """Compare a plan with the global search; None without one."""
    if not planner.sequences or judged.part.solution is not planner.incumbent:
        return None
    motion, rival, rival_cost = judged.motion, planner.rival, judged.rival_cost
    shortest = min(planner.sequences, key=lambda each: each.length)
    weights = planner.formulation.coordinates.weights
    best = planner.incumbent
    if rival is not None and have_one_start(rival, best) and not rival.violations:
        rival_cost = motion.cost
    return Gap(
        cost=motion.cost,
        best_cost=rival_cost,
        length=float((weights * np.abs(np.diff(motion.trajectory(shortest.t), axis=0))).sum()),
        best_length=shortest.length,
        spacing=SPACING,
        sequences=len(planner.sequences),
    )


def status_of(status: Status, certificate: Certificate) -> Status:
    """Return the status of the optimisation; a verified motion is not infeasible."""
    kept = status is Status.INFEASIBLE and certificate.verified
    return Status.PRECISION if kept else status


def message_of(
    status: Status,
    violations: abc.Sequence[str],
    certificate: Certificate,
    *,
    ending: str = "",
    notes: abc.Sequence[str] = (),
    published: bool = False,
) -> str:
    """Return the status of the optimisation and its result in words."""
    said = status.message
    if status is Status.GRADIENT and not certificate.on_path:
        least = certificate.smallest_singular_value
        said = (
            f"the motion passes a singular pose near t = {least.time:.4g} s (smallest singular "
            f"value {least.value:.2g}), next to which its cost cannot be lowered"
        )
    parts = [said] if status.is_cut_short or published or not violations else []
    if violations and certificate.verified:
        # Such as the clearance of bodies, whose convex hulls are planned with.
        parts.append(
            f"violated by the optimiser's bounds, kept by the motion: {'; '.join(violations)}"
        )
    elif violations and published:
        parts.append(
            f"the published method keeps nothing but given ends, and this is not kept: "
            f"{'; '.join(violations)}; without null_motion, optimizer and damping it is asked for"
        )
    elif violations:
        parts.append(f"not all constraints could be met: {'; '.join(violations)}")
    if certificate.failures and not (violations or ending):
        parts.append(f"but {certificate.verdict}")
    message = "; ".join(text for text in (ending, *parts, *notes) if text)
    if certificate.damped:
        stretches = " and ".join(map(str, certificate.damped))
        message += f"; the inverse was damped {stretches}"
    return message


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
        cubic by default, with given ends and closure as the only constraints. By default Newton's
        method on nodes satisfies all constraints, and `QuasiNewton` is used where a null motion or
        damping selects the published method.
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
        Time after which planning stops with the best motion so far [s]: no worse than the
        minimum-norm motion, or the warm start. It is then judged like any other plan, which takes
        additional time.
    callback : callable, optional
        Called with each `Iteration`; returning True stops, keeping the best so far.
    progress : callable, optional
        Called with the stage, its item and their number: ``("start", 3, 24)``; of 0, news: a pose
        that no motion passes is reported at once, before the reachable part of the path is planned.
        It may raise `KeyboardInterrupt` to stop.

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
        The path has a feed that is impossible for any arm; before any planning.
    NoSequenceError
        The global search finds that no motion follows the path; says where it ends and why.
    DeadlineError
        The deadline came before there was a complete motion.
    ProblemError
        An argument is invalid, or has no effect on this problem.
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
    clock = Deadline.after(deadline)
    if problem.damping is not None and max_evaluations is None:
        max_evaluations = _DAMPED_EVALUATIONS
    optimizer = _published_optimizer(problem, optimizer)
    effort = Effort(optimizer, callback, max_evaluations, clock)
    formulation = Formulation.of(problem)
    if problem.relaxations and optimizer is not None:
        raise ProblemError(
            "relaxations: the published method keeps nothing but given ends, so that the tool "
            "would leave its tolerances; leave null_motion out, optimizer and damping too"
        )
    if warm_start is not None:
        known = motion_of_all(formulation, warm_start.trajectory, warm_start.path)
        warm_start = replace(warm_start, trajectory=known)
    setup = Setup(
        formulation,
        search or Search(),
        Tolerance.of(tolerance),
        clock.checked_by(progress),
        warm_start=warm_start,
    )
    planner = Planner(setup, effort)
    try:
        with one_blas_thread(), held_interruption():
            return _planned(planner, clock)
    except KeyboardInterrupt:
        if not clock.passed:
            raise
        raise DeadlineError(
            f"the deadline of {deadline} s came before there was a complete motion; allow more "
            f"time, or give a start"
        ) from None


def plan_along(problem: Problem, guide: Sequence, tolerance: Tolerance, progress: Progress) -> Plan:
    """Plan as `plan` does, but try a motion first that is known, near which there should be one."""
    clock = Deadline()
    effort = Effort(_published_optimizer(problem, None), None, None, clock)
    formulation = Formulation.of(problem)
    guide = replace(guide, q=completed(formulation.follows, guide.t, guide.q))
    planner = Planner(Setup(formulation, Search(), tolerance, progress, guide=guide), effort)
    with one_blas_thread(), held_interruption():
        return _planned(planner, clock)


def _published_optimizer(problem: Problem, optimizer: Optimizer | None) -> Optimizer | None:
    """Return the optimiser of the published method; None where Newton's method on nodes is used.

    The published method is requested by an optimiser, by a null motion, or by damping.
    """
    is_free = isinstance(problem.null_motion, FreeNullMotion)
    if optimizer is None and is_free and problem.damping_law is None:
        return None
    return QuasiNewton() if optimizer is None else optimizer


def _planned(planner: Planner, clock: Deadline) -> Plan:
    """Return the plan, with an interruption at its end in the report."""
    go_through(planner)
    found = gathered(planner, clock)
    return with_ending(found, Status.INTERRUPTED) if was_interrupted() else found


def with_ending(plan: Plan, status: Status) -> Plan:
    """Return a plan whose report has the cause why another one was not completed."""
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

"""From a problem to a plan."""

import time
from dataclasses import replace
from functools import cache, partial

import numpy as np

from selfmotion.baselines import Method, plan_by
from selfmotion.basics import (
    Array,
    BreakdownError,
    NoSequenceError,
    ProblemError,
    Progress,
    read_only,
    silent,
)
from selfmotion.certificate import Tolerance
from selfmotion.optimise import Callback, QuasiNewton, Status
from selfmotion.planning.candidates import Effort, Selection
from selfmotion.planning.finish import Checked, checked_motion, within
from selfmotion.planning.largest_part import Part, largest_part
from selfmotion.planning.session import Counts, Guide, Session
from selfmotion.plans import Gap, Plan, Problem, Report
from selfmotion.search import SPACING, Reach, reachable

# Evaluations of the cost that a damped motion may take, and each of many on parts of the path.
_PATIENCE, _PART_PATIENCE = 400, 150


def plan(
    problem: Problem,
    *,
    optimizer: QuasiNewton | None = None,
    initial_metric: str = "gauss-newton",
    max_evaluations: int | None = None,
    callback: Callback | None = None,
    tolerance: Tolerance | None = None,
    starts: int = 24,
    finalists: int = 4,
    rng: np.random.Generator | int | None = 0,
    search: str = "auto",
    compare: bool = False,
    method: Method | None = None,
    progress: Progress = silent,
) -> Plan:
    """Plan the joint motion that follows the path exactly and minimises the costs.

    Parameters
    ----------
    problem : Problem
    optimizer : QuasiNewton, optional
    initial_metric : {"gauss-newton", "identity"}
        H0: the inverse Gauss-Newton matrix of the motion at x = 0, or the paper's identity.
    max_evaluations : int, optional
        Limit on evaluations of the cost while optimising one start; the finished motion is
        evaluated a few times more. By default none, but 400 with damping and 150 on each part of
        the path, where limits of joint speed often cannot be met and trying would take minutes.
    callback : callable, optional
        Called with each `Iteration`; returning True stops, keeping the best so far.
    tolerance : Tolerance, optional
        What the motion may miss the path by, between samples as well. The number of steps
        follows from it.
    starts : int
        Where the start is free: seeds of the inverse kinematics.
    finalists : int
        Where the start is free: how many of the starts found are optimised, those of the best
        motions at x = 0.
    rng : Generator or int
        Where the start is free: shifts the seeds; the same one gives the same plan.
    search : {"auto", "local", "global"}
        Where the start is free: optimise from many starts (local), or, where the redundancy is 1,
        from the best sequences over all self-motions (`best_sequences`). ``"auto"``: from many
        starts first, and from sequences where none of them leads to a motion that keeps the
        constraints.
    compare : bool
        Search globally whatever the other search finds, so that `Report.gap` tells how far the
        plan is from the best motion of all. Needs redundancy 1.
    method : Method, optional
        Another work's way to resolve the redundancy, instead of the optimisation: then the options
        of the optimiser have no effect.
    progress : callable, optional
        Told the stage, how much of it has begun, and of how many: ``("start", 3, 24)``. It may
        raise `KeyboardInterrupt` to stop.

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
        The motion at x = 0 runs into a singular pose, from every start, so early that no part of
        the path is worth a plan.
    InverseKinematicsError
        The start is free and no configuration reaches the start of the path.
    NoSequenceError
        The global search finds that no motion follows the path; says where it ends and why.
    KeyboardInterrupt
        The interruption came before there was a complete motion.
    """
    if method is not None:
        if problem.damping is not None:
            raise ProblemError(
                "the problem's damping is for the optimised motion; leave it out with method=, or "
                "take method=DampedLeastSquares(…)"
            )
        if problem.relaxations:
            raise ProblemError(
                "other works' methods follow the path exactly; leave the relaxations out with "
                "method="
            )
        return plan_by(problem, method, tolerance)
    if initial_metric not in ("gauss-newton", "identity"):
        raise ProblemError(
            f"initial_metric is '{initial_metric}', expected 'gauss-newton' or 'identity'"
        )
    if max_evaluations is not None and max_evaluations < 1:
        raise ProblemError(f"max_evaluations is {max_evaluations}, expected at least 1")
    if problem.damping is not None and max_evaluations is None:
        max_evaluations = _PATIENCE
    began = time.perf_counter()
    use_metric, wanted = initial_metric == "gauss-newton", tolerance or Tolerance()
    optimizer, counts = optimizer or QuasiNewton(), Counts()

    @cache
    def reach(suspect: float) -> Reach:
        progress("reach", 1, 1)
        return reachable(problem, suspect, starts, np.random.default_rng(rng))

    def part(suspect: float, notes: list[str]) -> Plan | None:
        limit = _PART_PATIENCE if max_evaluations is None else max_evaluations
        make = partial(_session, optimizer, callback, limit, counts)
        known = reach(suspect)
        progress("largest part", 1, 1)
        found = largest_part(problem, known, make, use_metric)
        if found is None:
            return None
        _settle(found.session, None, progress)
        checked = checked_motion(problem, found, wanted, progress)
        return _finish(problem, found, checked, None, notes, began)

    selection = Selection(
        problem,
        partial(Session, problem, optimizer, callback, max_evaluations, counts),
        use_metric,
        Effort(starts, finalists, search, compare, rng),
        progress,
        reach,
    )
    try:
        best = selection.run()
    except (BreakdownError, NoSequenceError) as error:
        # Chains of configurations end at obstacles and step limits as well: these stay errors.
        blocked = isinstance(error, NoSequenceError) and not reach(error.time).reason
        shorter = None if blocked else part(error.time, selection.notes)
        if shorter is None:
            raise
        return shorter
    rival_cost = _settle(best, selection.rival, progress)
    whole = Part(problem, best, "")
    checked = checked_motion(problem, whole, wanted, progress)
    gap = _gap(selection, rival_cost, checked)
    result = _finish(problem, whole, checked, gap, selection.notes, began)
    no_more = best.cut_short or best.status is Status.MAX_EVALUATIONS
    check = result.certificate
    out_of_limits = bool(best.violations) and check.limit_margin.value < 0.0
    held = within((check.position_error.value, check.rotation_error.value), wanted)
    # With damping the motion goes on where the path cannot be followed: so it was asked for.
    if (held and not out_of_limits) or no_more or problem.damping is not None:
        return result
    try:
        suspect = check.position_error.time
        # Where single poses are in reach, the constraints that are not met say more than a part.
        return (part(suspect, selection.notes) if reach(suspect).reason else None) or result
    except KeyboardInterrupt:
        best.end(Status.INTERRUPTED)
        return _finish(problem, whole, checked, None, selection.notes, began)


def _session(
    optimizer: QuasiNewton,
    callback: Callback | None,
    limit: int,
    counts: Counts,
    part: Problem,
    start: Array,
    guide: Guide | None,
) -> Session:
    """Return the session of a part of the problem, with the settings of the whole."""
    free = part.given_start is None
    return Session(part, optimizer, callback, limit, counts, start, free=free, guide=guide)


def _settle(best: Session, rival: Session | None, progress: Progress) -> float | None:
    """Go on to finer grids, also with what the best one is compared with; return its cost."""
    try:
        progress("finer grid", 1, 1)
        best.refine_until_settled()
        if rival is not None and rival is not best and not best.cut_short:
            rival.refine_until_settled()
            return None if rival.violations else rival.score[1]
    except KeyboardInterrupt:
        best.end(Status.INTERRUPTED)
    return None


def _finish(
    problem: Problem,
    part: Part,
    checked: Checked,
    gap: Gap | None,
    notes: list[str],
    began: float,
) -> Plan:
    """Gather everything."""
    session = part.session
    terms, violations, counts = checked.terms, session.violations, session.counts
    parts = [session.status.message] if session.cut_short or not violations else []
    if violations:
        parts.append(f"not all constraints could be met: {'; '.join(violations)}")
    failures = checked.certificate.failures
    if failures and not (violations or part.ending):
        parts.append(f"but {checked.certificate.verdict}")
    message = "; ".join(text for text in (part.ending, *parts, *notes) if text)
    if checked.certificate.damped:
        stretches = " and ".join(map(str, checked.certificate.damped))
        message += f"; the inverse was damped {stretches}"
    report = Report(
        cost=sum(terms.values()),
        initial_cost=sum(checked.initial_terms.values()),
        terms=terms,
        initial_terms=checked.initial_terms,
        evaluations=counts.evaluations,
        gradient_evaluations=counts.gradients,
        jacobian_evaluations=counts.jacobians,
        steps=len(checked.trajectory.t) - 1,
        iterations=sum(iteration.step > 0.0 for iteration in session.history),
        history=tuple(session.history),
        status=session.status,
        message=message,
        seconds=time.perf_counter() - began,
        gap=gap,
    )
    return Plan(
        robot=problem.robot,
        path=problem.path,
        task=problem.rows,
        trajectory=checked.trajectory,
        initial_trajectory=checked.initial_trajectory,
        coefficients=read_only(session.coefficients),
        report=report,
        certificate=checked.certificate,
        requirements=replace(problem.requirements, collision=None, ending=part.ending),
        clearance=problem.clearance,
        tolerance=checked.tolerance,
    )


def _gap(selection: Selection, rival_cost: float | None, checked: Checked) -> Gap | None:
    """Compare a plan with what the global search knows; None where it knows nothing."""
    if not selection.sequences:
        return None
    cost, shortest = sum(checked.terms.values()), selection.sequences[0].sequence
    rival = selection.rival
    if rival is not None and rival is selection.best and not rival.violations:
        rival_cost = cost
    return Gap(
        cost=cost,
        best_cost=rival_cost,
        length=float(np.abs(np.diff(checked.trajectory(shortest.t), axis=0)).sum()),
        best_length=shortest.length,
        spacing=SPACING,
        sequences=len(selection.sequences),
    )

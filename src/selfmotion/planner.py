"""From a problem to a plan."""

import time
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from selfmotion.arrays import read_only
from selfmotion.baselines import Method, plan_by
from selfmotion.certificate import Certificate, Tolerance, certify
from selfmotion.errors import ProblemError
from selfmotion.plan import Gap, Plan, Report
from selfmotion.problem import Problem
from selfmotion.progress import Progress, silent
from selfmotion.quasi_newton import Callback, QuasiNewton, Status
from selfmotion.selection import Effort, Selection
from selfmotion.sequences import SPACING
from selfmotion.session import MOST_HALVINGS, Counts, Session
from selfmotion.trajectory import Trajectory


class _Checked(NamedTuple):
    """A motion, the one at x = 0 on the same grid, what they cost, and the check."""

    terms: dict[str, float]
    trajectory: Trajectory
    certificate: Certificate
    initial_terms: dict[str, float]
    initial_trajectory: Trajectory


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
        evaluated a few times more.
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
        `Plan.require` raises. After an interruption (Ctrl-C) the best plan that was known by then,
        checked like any other; its status says so.

    Raises
    ------
    BreakdownError
        The motion at x = 0 runs into a singular pose, from every start.
    InverseKinematicsError
        The start is free and no configuration reaches the start of the path.
    NoSequenceError
        The global search finds that no motion follows the path; says where it ends and why.
    KeyboardInterrupt
        The interruption came before there was a complete motion.
    """
    if method is not None:
        return plan_by(problem, method, tolerance)
    if initial_metric not in ("gauss-newton", "identity"):
        raise ProblemError(
            f"initial_metric is '{initial_metric}', expected 'gauss-newton' or 'identity'"
        )
    if max_evaluations is not None and max_evaluations < 1:
        raise ProblemError(f"max_evaluations is {max_evaluations}, expected at least 1")
    began = time.perf_counter()
    selection = Selection(
        problem,
        partial(Session, problem, optimizer or QuasiNewton(), callback, max_evaluations, Counts()),
        initial_metric == "gauss-newton",
        Effort(starts, finalists, search, compare, rng),
        progress,
    )
    best = selection.run()
    rival_cost = _settle(best, selection.rival, progress)
    checked = _checked(problem, best, tolerance or Tolerance(), progress)
    gap = _gap(selection, rival_cost, checked)
    return _finish(problem, best, checked, gap, selection.notes, began)


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
    session: Session,
    checked: _Checked,
    gap: Gap | None,
    notes: list[str],
    began: float,
) -> Plan:
    """Gather everything."""
    terms, violations, counts = checked.terms, session.violations, session.counts
    parts = [session.status.message] if session.cut_short or not violations else []
    if violations:
        parts.append(f"not all constraints could be met: {'; '.join(violations)}")
    message = "; ".join([*parts, *notes])
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
        requirements=replace(problem.requirements, collision=None),
        clearance=problem.clearance,
    )


def _checked(
    problem: Problem, session: Session, tolerance: Tolerance, progress: Progress
) -> _Checked:
    """Return what there is on the first grid on which the motion holds the tolerance."""
    checked = None
    for _ in range(MOST_HALVINGS):
        try:
            progress("checking", 1, 1)
            checked = _check(problem, session, tolerance)
            position = checked.certificate.position_error.value
            rotation = checked.certificate.rotation_error.value
            if position <= tolerance.position and rotation <= tolerance.rotation:
                break
            session.refine()
        except KeyboardInterrupt:
            session.end(Status.INTERRUPTED)
            break
    # No plan goes without a certificate, interrupted or not.
    return checked or _check(problem, session, tolerance)


def _check(problem: Problem, session: Session, tolerance: Tolerance) -> _Checked:
    terms, trajectory = session.terms(), session.trajectory()
    certificate = certify(
        problem.robot, problem.path, problem.rows, trajectory, tolerance, problem.requirements
    )
    initial_terms = session.initial_terms()
    return _Checked(terms, trajectory, certificate, initial_terms, session.trajectory())


def _gap(selection: Selection, rival_cost: float | None, checked: _Checked) -> Gap | None:
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

"""From a problem to a plan."""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from selfmotion.arrays import Array, read_only
from selfmotion.baselines import Method, plan_by
from selfmotion.certificate import Tolerance, certify
from selfmotion.errors import BreakdownError, NoSequenceError, ProblemError, SelfmotionError
from selfmotion.feasible import Maker, Part, largest_part
from selfmotion.guides import guides
from selfmotion.plan import Plan, Report
from selfmotion.problem import Problem
from selfmotion.quasi_newton import Callback, QuasiNewton, Status
from selfmotion.reach import Reach, reachable
from selfmotion.search import start_candidates
from selfmotion.session import MOST_HALVINGS, Counts, Guide, Session
from selfmotion.trajectory import Trajectory

_Settings = tuple[Problem, QuasiNewton, Callback | None, int | None, Counts]

# Where no start leads to a motion that keeps the constraints, this many times more are tried.
_SECOND_EFFORT = 4
# Evaluations of the cost that a damped motion may take, or one of many on a part of the path.
_PATIENCE = 400


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
    method: Method | None = None,
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
        evaluated a few times more. By default none, but 400 with damping and on parts of the path,
        where limits of joint speed often cannot be met and trying would take minutes.
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
    method : Method, optional
        Another work's way to resolve the redundancy, instead of the optimisation: then the options
        of the optimiser have no effect.

    Returns
    -------
    Plan
        Also where the search fell short: `Plan.report` and `Plan.certificate` say so, and
        `Plan.require` raises. Where the path leaves the workspace, within the joint limits, or no
        motion passes a singular pose: the motion on the largest part [0, t] that was found, never
        verified, with t and the reason in its verdict.

    Raises
    ------
    BreakdownError
        The motion at x = 0 runs into a singular pose, from every start, so early that no part of
        the path is worth a plan.
    InverseKinematicsError
        The start is free and no configuration reaches the start of the path.
    """
    if method is not None:
        if problem.damping is not None:
            raise ProblemError(
                "the problem's damping is for the optimised motion; leave it out with method=, or "
                "take method=DampedLeastSquares(…)"
            )
        return plan_by(problem, method, tolerance)
    if initial_metric not in ("gauss-newton", "identity"):
        raise ProblemError(
            f"initial_metric is '{initial_metric}', expected 'gauss-newton' or 'identity'"
        )
    if max_evaluations is not None and max_evaluations < 1:
        raise ProblemError(f"max_evaluations is {max_evaluations}, expected at least 1")
    if search not in ("auto", "local", "global"):
        raise ProblemError(f"search is '{search}', expected 'auto', 'local' or 'global'")
    began = time.perf_counter()
    if problem.damping is not None and max_evaluations is None:
        max_evaluations = _PATIENCE
    counts = Counts()
    settings = (problem, optimizer or QuasiNewton(), callback, max_evaluations, counts)
    use_metric = initial_metric == "gauss-newton"
    wanted = tolerance or Tolerance()

    @cache
    def reach(suspect: float) -> Reach:
        return reachable(problem, suspect, starts, np.random.default_rng(rng))

    def part(suspect: float) -> Plan | None:
        found = largest_part(problem, reach(suspect), _maker(settings), use_metric)
        if found is None:
            return None
        found.session.refine_until_settled()
        return _finish(problem, found, wanted, began)

    try:
        if problem.given_start is not None:
            best = Session(*settings, problem.given_start, free=False)
            best.minimize(use_metric)
        else:
            best = _search(settings, starts, finalists, rng, use_metric, search, reach)
    except (BreakdownError, NoSequenceError) as error:
        # Chains of configurations end at obstacles and step limits as well: these stay errors.
        blocked = isinstance(error, NoSequenceError) and not reach(error.time).reason
        shorter = None if blocked else part(error.time)
        if shorter is None:
            raise
        return shorter
    best.refine_until_settled()
    result = _finish(problem, Part(problem, best, ""), wanted, began)
    cut_short = best.status in (Status.INTERRUPTED, Status.STOPPED, Status.MAX_EVALUATIONS)
    check = result.certificate
    out_of_limits = bool(best.violations) and check.limit_margin.value < 0.0
    held = _within((check.position_error.value, check.rotation_error.value), wanted)
    # With damping the motion goes on where the path cannot be followed: so it was asked for.
    if (held and not out_of_limits) or cut_short or problem.damping is not None:
        return result
    return part(check.position_error.time) or result


def _maker(settings: _Settings) -> Maker:
    """Return what makes sessions of parts of the problem, with the settings of the whole."""
    _, optimizer, callback, limit, counts = settings
    limit = _PATIENCE if limit is None else limit

    def make(part: Problem, start: Array, guide: Guide | None) -> Session:
        free = part.given_start is None
        return Session(part, optimizer, callback, limit, counts, start, free=free, guide=guide)

    return make


def _search(
    settings: _Settings,
    starts: int,
    finalists: int,
    rng: np.random.Generator | int | None,
    use_metric: bool,
    search: str,
    reach: Callable[[float], Reach],
) -> Session:
    """Return the best session of a free start: from many starts, or from global sequences."""
    problem = settings[0]
    best: Session | None = None
    failure: SelfmotionError | None = None
    can_search = problem.robot.redundancy(problem.rows) == 1
    if search != "global" or not can_search:
        try:
            best = _search_starts(settings, starts, finalists, rng, use_metric, reach)
        except BreakdownError as error:
            if reach(error.time).reason:
                raise
            failure = error
    fell_short = best is None or bool(best.violations)
    cut_short = best is not None and best.status in (Status.INTERRUPTED, Status.STOPPED)
    if can_search and search != "local" and fell_short and not cut_short:
        try:
            for guide in guides(problem, rng):
                try:
                    session = Session(*settings, guide.start, free=True, guide=guide)
                except BreakdownError as error:
                    failure = error
                    continue
                session.minimize(use_metric)
                if best is None or session.score < best.score:
                    best = session
        except NoSequenceError as error:
            failure = error
    if best is None:
        raise failure or ProblemError(f"finalists is {finalists}, expected at least 1")
    if best.violations and isinstance(failure, NoSequenceError):
        best.violations = (*best.violations, f"global search: {failure}")
    return best


def _search_starts(
    settings: _Settings,
    starts: int,
    finalists: int,
    rng: np.random.Generator | int | None,
    use_metric: bool,
    reach: Callable[[float], Reach],
) -> Session:
    """Return the best session of a free start; more starts where the first ones fall short."""
    problem = settings[0]
    generator = np.random.default_rng(rng)
    best: Session | None = None
    failure: BreakdownError | None = None
    for effort in (1, _SECOND_EFFORT):
        candidates = start_candidates(
            problem.robot, problem.path, problem.rows, effort * starts, generator
        )
        try:
            found = _best_start(settings, candidates, effort * finalists, use_metric)
        except BreakdownError as error:
            failure = error
            if reach(error.time).reason:
                # A pose that is out of reach is so from any start.
                break
            continue
        if best is None or found.score < best.score:
            best = found
        if not best.violations or best.status in (Status.INTERRUPTED, Status.STOPPED):
            break
    if best is not None:
        return best
    raise failure or ProblemError(f"finalists is {finalists}, expected at least 1")


def _best_start(
    settings: _Settings, candidates: list[Array], finalists: int, use_metric: bool
) -> Session:
    """Return the session of the start whose optimised motion is best."""
    sessions, failure = [], None
    for candidate in candidates:
        try:
            sessions.append(Session(*settings, candidate, free=True))
        except BreakdownError as error:
            failure = error
    if failure is not None and not sessions:
        raise failure
    sessions.sort(key=lambda session: session.initial_score)
    best: Session | None = None
    for session in sessions[:finalists]:
        session.minimize(use_metric)
        if best is None or session.score < best.score:
            best = session
        if session.status in (Status.INTERRUPTED, Status.STOPPED):
            break
    if best is None:
        raise ProblemError(f"finalists is {finalists}, expected at least 1")
    return best


def _finish(problem: Problem, part: Part, tolerance: Tolerance, began: float) -> Plan:
    """Refine the motion until it holds the tolerance, and gather everything."""
    session = part.session
    requirements = replace(problem.requirements, ending=part.ending)
    coarse: Trajectory | None = None
    misses: list[float] = []
    for _ in range(MOST_HALVINGS):
        terms = session.terms()
        trajectory = session.trajectory()
        certificate = certify(
            problem.robot, problem.path, problem.rows, trajectory, tolerance, requirements
        )
        errors = certificate.position_error.value, certificate.rotation_error.value
        if _within(errors, tolerance):
            break
        # What damping costs stays on any grid: there, the motion stands when the tool does.
        if coarse is not None and _within(_largest_change(problem, coarse, trajectory), tolerance):
            break
        coarse = trajectory if session.damped else None
        # What is out of reach is so on any grid.
        misses.append(sum(errors))
        if coarse is None and len(misses) > 2 and misses[-1] > 0.5 * misses[-3]:
            break
        session.refine()
    violations = session.violations
    x = session.coefficients
    initial_terms = session.initial_terms()
    initial_trajectory = session.trajectory()
    counts = session.counts
    message = session.status.message
    if violations:
        message = f"not all constraints could be met: {'; '.join(violations)}"
    if part.ending:
        message = f"{part.ending}; {message}"
    if certificate.damped:
        message += f"; the inverse was damped {' and '.join(map(str, certificate.damped))}"
    report = Report(
        cost=sum(terms.values()),
        initial_cost=sum(initial_terms.values()),
        terms=terms,
        initial_terms=initial_terms,
        evaluations=counts.evaluations,
        gradient_evaluations=counts.gradients,
        jacobian_evaluations=counts.jacobians,
        steps=len(trajectory.t) - 1,
        iterations=sum(iteration.step > 0.0 for iteration in session.history),
        history=tuple(session.history),
        status=session.status,
        message=message,
        seconds=time.perf_counter() - began,
    )
    return Plan(
        robot=problem.robot,
        path=problem.path,
        task=problem.rows,
        trajectory=trajectory,
        initial_trajectory=initial_trajectory,
        coefficients=read_only(x),
        report=report,
        certificate=certificate,
        requirements=replace(requirements, collision=None),
        clearance=problem.clearance,
    )


def _within(errors: tuple[float, float], tolerance: Tolerance) -> bool:
    return errors[0] <= tolerance.position and errors[1] <= tolerance.rotation


def _largest_change(problem: Problem, coarse: Trajectory, fine: Trajectory) -> tuple[float, float]:
    """Return how far apart two motions put the tool in the prescribed rows, at most [m, rad]."""
    robot, task = problem.robot, problem.rows
    pairs = zip(coarse(fine.t), fine.q, strict=True)
    misses = np.array([task.miss(robot.pose(first), robot.pose(second)) for first, second in pairs])
    position, rotation = misses.max(axis=0)
    return float(position), float(rotation)

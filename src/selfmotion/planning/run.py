"""From a problem to a plan."""

import time
from dataclasses import replace
from math import inf
from typing import NamedTuple

import numpy as np

from selfmotion.basics import (
    BreakdownError,
    InverseKinematicsError,
    NoSequenceError,
    PlanError,
    ProblemError,
    Progress,
    SelfmotionError,
    as_number,
    as_whole,
    one_blas_thread,
    read_only,
    shown,
    silent,
)
from selfmotion.certificate import Tolerance
from selfmotion.optimise import Callback, Optimizer, QuasiNewton, Status
from selfmotion.planning.candidates import Candidates
from selfmotion.planning.deadline import Deadline, TimedCounts
from selfmotion.planning.effort import Effort
from selfmotion.planning.finish import Finished, finish
from selfmotion.planning.largest_part import LargestPart, largest_part
from selfmotion.planning.refusal import begins_off_path, looked_at, no_way
from selfmotion.planning.search import Search
from selfmotion.planning.session import Session
from selfmotion.planning.settings import (
    DAMPED_EVALUATIONS,
    FREE_PART_EVALUATIONS,
    PART_EVALUATIONS,
)
from selfmotion.planning.warm_start import check_warm_start
from selfmotion.problem import Problem, check_problem
from selfmotion.result import Gap, Plan, Report
from selfmotion.search import SPACING, Obstruction, Reach, SequenceGuide, reachable

# After these no other way is tried.
_ENDED = (Status.INTERRUPTED, Status.DEADLINE, Status.STOPPED)


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
        By default `QuasiNewton`. It minimises the cost as long as constraints are kept; where
        they begin to count, `SequentialQuadratic` goes on.
    search : Search, optional
        How to search where the start is free, and whether to compare with a global search.
    warm_start : Plan, optional
        A plan of this problem or of one like it, whose null motion is begun with, unless x = 0 is
        better. Where the start is free, its start too; others are tried only if that falls short.
    tolerance : Tolerance, optional
        What the motion may miss the path by, between samples as well. The number of steps
        follows from it.
    max_evaluations : int, optional
        Limit on evaluations of the cost while optimising one start; the finished motion is
        evaluated a few times more. By default none, but 400 with damping and 150 on each part of
        the path (30 where the start is free), where limits of joint speed often cannot be met and
        trying would take minutes.
    deadline : float, optional
        After so many seconds the best so far has to do: no worse than x = 0, or what the search
        began with. It is judged like any other plan, which takes some time more.
    callback : callable, optional
        Called with each `Iteration`; returning True stops, keeping the best so far.
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
    clock = Deadline(inf)
    if deadline is not None:
        clock = Deadline.after(as_number(deadline, "deadline", above=0.0))
    if problem.damping is not None and max_evaluations is None:
        max_evaluations = DAMPED_EVALUATIONS
    counts = TimedCounts(deadline=clock)
    effort = Effort(optimizer or QuasiNewton(), callback, max_evaluations, counts)
    settings = _Settings(Tolerance.of(tolerance), clock.telling(progress), warm_start, clock)
    try:
        with one_blas_thread():
            return _plan(problem, effort, search or Search(), settings)
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
    clock = Deadline(inf)
    effort = Effort(QuasiNewton(), None, None, TimedCounts(deadline=clock))
    settings = _Settings(tolerance, progress, None, clock, guide)
    with one_blas_thread():
        return _plan(problem, effort, Search(), settings)


class _Settings(NamedTuple):
    """What all attempts at one plan have in common."""

    tolerance: Tolerance
    progress: Progress
    warm_start: Plan | None
    deadline: Deadline
    guide: SequenceGuide | None = None


def _plan(problem: Problem, effort: Effort, search: Search, settings: _Settings) -> Plan:
    free = problem.given_start is None and settings.guide is None and settings.warm_start is None
    blocked = looked_at(problem, search) if free else None
    found = _Planning(problem, effort, search, settings, blocked).plan()
    # Few motions take an arm into itself: the others need not wait for distances.
    hopeless = blocked is not None or found.report.status in _ENDED
    if not _overlaps(found) or hopeless:
        return found
    efforts = [(replace(effort, apart=True), search)]
    if problem.given_start is None and search.mode == "auto":
        # Hulls that overlap by themselves tell the optimiser nothing; nodes of the search are free.
        whole = replace(search, mode="global")
        efforts += [(effort, whole), (replace(effort, apart=True), whole)]
    for another, how in efforts:
        try:
            rival = _Planning(problem, another, how, settings).plan()
        except SelfmotionError:
            return found
        except KeyboardInterrupt:
            passed = settings.deadline.passed
            return _told(found, Status.DEADLINE if passed else Status.INTERRUPTED)
        if rival.report.status in _ENDED:
            return _better(found, rival)
        found = rival
        if not _overlaps(found):
            return found
    return found


def _better(before: Plan, cut_short: Plan) -> Plan:
    """Return the one of which less is wrong, then the cheaper; its report says what cut it."""
    if _standing(cut_short) < _standing(before):
        return cut_short
    return _told(before, cut_short.report.status)


def _told(plan: Plan, status: Status) -> Plan:
    """Return a plan whose report says what kept another one from being tried to the end."""
    message = f"{status.message}; before: {plan.report.message}"
    return replace(plan, report=replace(plan.report, status=status, message=message))


def _standing(plan: Plan) -> tuple[int, float]:
    return len(plan.certificate.failures), plan.report.cost


def _overlaps(plan: Plan) -> bool:
    """Whether the arm meets itself where only the default asks it not to."""
    asked = plan.problem.own_collision is not None
    return asked and not plan.certificate.findings[-1].kept


def _check(problem: Problem, search: Search | None, max_evaluations: int | None) -> None:
    check_problem(problem)
    if search is not None and not isinstance(search, Search):
        raise ProblemError(f"search is {shown(search)}, expected Search(mode=…, starts=…, …)")
    if search is not None and problem.given_start is not None and not search.compare:
        raise ProblemError(
            "search= has no effect, since the problem's start is given; leave one of them out, or "
            "ask for Search(compare=True)"
        )
    if max_evaluations is not None:
        as_whole(max_evaluations, "max_evaluations", least=1, most=10**9)


class _Planning:
    """What the stages of one plan share."""

    def __init__(
        self,
        problem: Problem,
        effort: Effort,
        search: Search,
        settings: _Settings,
        blocked: Obstruction | None = None,
    ) -> None:
        self._blocked = blocked
        self._problem, self._effort, self._search = problem, effort, search
        self._tolerance, self._progress = settings.tolerance, settings.progress
        self._deadline = settings.deadline
        self._began = time.perf_counter()
        self._known_reach: dict[float, Reach] = {}
        self._candidates = Candidates(
            problem,
            effort,
            search,
            settings.progress,
            self._reach,
            settings.warm_start,
            settings.guide,
        )

    def plan(self) -> Plan:
        """Return the plan of the whole path, or of the largest part of it."""
        candidates = self._candidates
        if self._blocked is not None and not self._blocked.is_met:
            return self._up_to(self._blocked)
        try:
            best = candidates.run()
            shorter = self._shorter(best)
            if shorter is not None:
                return shorter
            best = self._met(best)
        except (BreakdownError, NoSequenceError) as error:
            # Chains of configurations end at obstacles and step limits as well: these stay errors.
            blocked = isinstance(error, NoSequenceError) and not self._reach(error.time).reason
            shorter = None if blocked else self._part(error.time)
            if shorter is None:
                raise
            return shorter
        rival_cost = self._settle(best, candidates.rival)
        whole = LargestPart(self._problem, best, "")
        finished = finish(self._problem, whole, self._tolerance, self._progress)
        if best.has_nodes and not finished.certificate.verified and best.status not in _ENDED:
            # Between nodes a limit may be passed that smooth functions keep.
            best.leave_nodes()
            best = self._met(best)
            rival_cost = self._settle(best, candidates.rival)
            whole = LargestPart(self._problem, best, "")
            finished = finish(self._problem, whole, self._tolerance, self._progress)
        result = self._gather(whole, finished, self._gap(rival_cost, finished))
        if self._stands(best, finished):
            return result
        try:
            suspect = finished.certificate.position_error.time
            # Where single poses are in reach, constraints that are not met say more than a part.
            return (self._part(suspect) if self._reach(suspect).reason else None) or result
        except KeyboardInterrupt:
            best.end(Status.INTERRUPTED)
            return self._gather(whole, finished, None)

    def _up_to(self, blocked: Obstruction) -> Plan:
        """Return the plan of what comes before a pose that is out of reach."""
        told = blocked.help.removeprefix("; ")
        self._candidates.notes += [told] if told else []
        # A part would begin on the path itself, which relaxed rows only let the arm be near.
        off = begins_off_path(self._problem, self._search)
        try:
            shorter = None if off else self._part(blocked.time)
        except InverseKinematicsError:
            shorter = None
        if shorter is None:
            raise no_way(self._problem, blocked)
        return shorter

    def _met(self, best: Session) -> Session:
        """Return a session of another null motion where one meets more of the constraints."""
        if not best.violations or best.status in (*_ENDED, Status.MAX_EVALUATIONS):
            return best
        for detour in best.detours():
            if detour.cut_short:
                best.end(detour.status)
            best = min(best, detour, key=lambda one: (bool(one.violations), one.merit()))
            if not best.violations or best.cut_short:
                break
        return best

    def _shorter(self, best: Session) -> Plan | None:
        """Return the plan of the largest part where violations are because poses are out of reach.

        None where there are no such: no other motion on finer grids would be better then.
        """
        ended = best.status in (*_ENDED, Status.MAX_EVALUATIONS)
        if not best.violations or ended or self._problem.damping is not None:
            return None
        try:
            return self._part() if self._reach().reason else None
        except KeyboardInterrupt:
            best.end(Status.INTERRUPTED)
            return None

    def _stands(self, best: Session, finished: Finished) -> bool:
        """Whether a part of the path is no better answer than this motion along all of it."""
        check = finished.certificate
        no_more = best.cut_short or best.status is Status.MAX_EVALUATIONS
        out_of_limits = bool(best.violations) and check.limit_margin.value < 0.0
        # With damping the motion goes on where the path cannot be followed: so it was asked for.
        return (check.on_path and not out_of_limits) or no_more or self._problem.damping is not None

    def _reach(self, suspect: float = 0.0) -> Reach:
        """Return how far single poses are in reach, after a closer look at a time [s].

        That is left out where something is known to be beyond.
        """
        for known in self._known_reach.values():
            if known.reason:
                return known
        if suspect not in self._known_reach:
            self._progress("reach", 1, 1)
            rng = np.random.default_rng(self._search.rng)
            found = reachable(self._problem, self._search.starts, rng, suspect)
            self._known_reach[suspect] = found
        return self._known_reach[suspect]

    def _part(self, suspect: float = 0.0) -> Plan | None:
        """Return the plan of the largest part, looking closely at a time [s]; None for none."""
        effort = self._effort
        if effort.max_evaluations is None:
            free = self._problem.given_start is None
            most = FREE_PART_EVALUATIONS if free else PART_EVALUATIONS
            effort = replace(effort, max_evaluations=most)
        known = self._reach(suspect)
        self._progress("largest part", 1, 1)
        found = largest_part(self._problem, known, effort)
        if found is None:
            return None
        self._settle(found.session, None)
        finished = finish(self._problem, found, self._tolerance, self._progress)
        return self._gather(found, finished, None)

    def _settle(self, best: Session, rival: Session | None) -> float | None:
        """Go on to finer grids, also with what the best one is compared with; return its cost."""
        try:
            self._progress("finer grid", 1, 1)
            best.settle()
            if rival is not None and rival is not best and not best.cut_short:
                rival.settle()
                if rival.cut_short:
                    best.end(rival.status)
                violated, cost = rival.score()
                return None if violated else cost
        except KeyboardInterrupt:
            best.end(Status.INTERRUPTED)
        return None

    def _gather(self, part: LargestPart, finished: Finished, gap: Gap | None) -> Plan:
        session, motion, still = part.session, finished.motion, finished.still
        if self._deadline.passed and session.status is Status.INTERRUPTED:
            session.end(Status.DEADLINE)
        counts = session.counts
        report = Report(
            cost=motion.cost,
            initial_cost=still.cost,
            terms=motion.terms,
            initial_terms=still.terms,
            evaluations=counts.evaluations,
            gradient_evaluations=counts.gradients,
            jacobian_evaluations=counts.jacobians,
            steps=len(motion.trajectory.t) - 1,
            iterations=sum(iteration.step > 0.0 for iteration in session.history),
            history=tuple(session.history),
            status=_status(session, finished),
            message=_message(part, finished, self._candidates.notes),
            seconds=time.perf_counter() - self._began,
            gap=gap,
            ending=part.ending,
            active=session.active,
            null_motion=session.null_motion,
            remaining=session.remaining,
        )
        return Plan(
            problem=self._problem,
            trajectory=motion.trajectory,
            initial_trajectory=still.trajectory,
            coefficients=read_only(session.coefficients),
            report=report,
            certificate=finished.certificate,
        )

    def _gap(self, rival_cost: float | None, finished: Finished) -> Gap | None:
        """Compare a plan with what the global search knows; None where it knows nothing."""
        candidates, motion = self._candidates, finished.motion
        if not candidates.sequences:
            return None
        shortest = min((each.sequence for each in candidates.sequences), key=lambda s: s.length)
        rival, weights = candidates.rival, self._problem.robot.joint_weights
        if rival is not None and rival is candidates.best and not rival.violations:
            rival_cost = motion.cost
        return Gap(
            cost=motion.cost,
            best_cost=rival_cost,
            length=float((weights * np.abs(np.diff(motion.trajectory(shortest.t), axis=0))).sum()),
            best_length=shortest.length,
            spacing=SPACING,
            sequences=len(candidates.sequences),
        )


def _status(session: Session, finished: Finished) -> Status:
    """Return how the optimisation ended; what the certificate finds kept is not infeasible."""
    kept = session.status is Status.INFEASIBLE and finished.certificate.verified
    return Status.PRECISION if kept else session.status


def _message(part: LargestPart, finished: Finished, notes: list[str]) -> str:
    """Return in words how the optimisation ended, and what came of it."""
    session, violations = part.session, part.session.violations
    certificate = finished.certificate
    said = session.status.message
    if session.status is Status.GRADIENT and not certificate.on_path:
        least = certificate.smallest_singular_value
        said = (
            f"the motion passes a singular pose near t = {least.time:.4g} s (smallest singular "
            f"value {least.value:.2g}), next to which its cost cannot be lowered"
        )
    parts = [said] if session.cut_short or not violations else []
    if violations and certificate.verified:
        # Such as the clearance of bodies, whose convex hulls are planned with.
        parts.append(f"what planning fell short of is kept by the motion: {'; '.join(violations)}")
    elif violations:
        parts.append(f"not all constraints could be met: {'; '.join(violations)}")
    if certificate.failures and not (violations or part.ending):
        parts.append(f"but {certificate.verdict}")
    message = "; ".join(text for text in (part.ending, *parts, *notes) if text)
    if certificate.damped:
        stretches = " and ".join(map(str, certificate.damped))
        message += f"; the inverse was damped {stretches}"
    return message

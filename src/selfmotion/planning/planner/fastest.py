"""The fastest motion along a path: pace and null motion, each in its turn."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    Array,
    DeadlineError,
    PathError,
    PlanError,
    Progress,
    held_interruption,
    silent,
)
from selfmotion.certificate import Tolerance
from selfmotion.planning.optimise import Status
from selfmotion.planning.planner.cost_limits import CostLimits
from selfmotion.planning.planner.effort import Deadline, Search
from selfmotion.planning.planner.repaced import PaceMap, repaced, same_pace, smoothed_pace
from selfmotion.planning.planner.run import plan, with_ending
from selfmotion.planning.result import Plan, check_no_feed, rate_limits, retime
from selfmotion.problem.constraints import JointPositionLimits, JointVelocityLimits
from selfmotion.problem.costs import LimitUse
from selfmotion.problem.problem import Problem, check_problem, envelope_of_problem

# Default deadline [s].
_DEADLINE = 60.0
# Rounds end at a relative gain below this …
_ROUND_GAIN = 2e-3
# … and after this number.
ROUNDS = 8
# Weight of limited costs, in multiples of the motion's time …
_COST_WEIGHT = 0.05
# … and its growth while they are exceeded.
_COST_WEIGHT_GROWTH = 4.0
# Power p of `LimitUse`: larger ones are nearer to the maximum, and harder to minimise.
_POWER = 16.0
# Distance of joint paths from where limits of speed by position are 0 [rad or m]: joints of an FR3
# may move at 0.1 rad/s there.
_MOVING_MARGIN = 5e-3
# Room beside a given start that is nearer [rad or m].
_START_MARGIN = 1e-4


@dataclass(frozen=True, eq=False)
class Fastest:
    """The fastest motion found, and its initial one.

    Attributes
    ----------
    plan : Plan
        The motion, from rest to rest.
    pseudo_inverse : float
        Time of the minimum-norm motion at its fastest [s]; inf if that violates other limits at any
        pace, or if there was no time to find out.
    retimed : float
        Likewise of the motion that is best by the problem's own costs.
    times : tuple of float
        Of the best motion after each round [s].
    status : Status
        `DEADLINE` or `INTERRUPTED` where more rounds might have gained more.
    """

    plan: Plan
    pseudo_inverse: float
    retimed: float
    times: tuple[float, ...]
    status: Status = Status.CONVERGED

    @property
    def duration(self) -> float:
        """Time of the motion [s]."""
        return self.plan.path.duration


def fastest(
    problem: Problem,
    acceleration: npt.ArrayLike | None = None,
    velocity: npt.ArrayLike | None = None,
    *,
    keep: Mapping[str, float] | None = None,
    search: Search | None = None,
    tolerance: Tolerance | None = None,
    deadline: float | None = _DEADLINE,
    progress: Progress = silent,
) -> Fastest:
    """Return the fastest motion along the problem's path, whatever its own pace and costs.

    The initial motions are the best one by the problem's costs and the minimum-norm motion, each at
    its fastest pace (`retime`). Then alternately the null motion minimises the use of limits at the
    present pace (`LimitUse`), and the pace is the fastest for that joint path; rounds go on while
    they gain. The best motion is returned: never slower than the first two.

    Parameters
    ----------
    problem : Problem
        Its constraints apply; its costs determine the initial motion alone.
    acceleration : (n,) or float, optional
        Limits [rad/s² or m/s²]; by default those of the arm's maker.
    velocity : (n,) or float, optional
        Limits [rad/s or m/s]; by default those of the problem, or the URDF's.
    keep : mapping of str to float, optional
        Largest multiple of a cost of the problem, by its kind or name, of that of the best motion
        by all costs: ``{"JointVelocity": 1.1}``. It is evaluated of the joint path at the time law
        of the problem's own path, since any motion costs more in less time.
    search : Search, optional
        See `plan`.
    tolerance : Tolerance, optional
        See `plan`.
    deadline : float, optional
        Time after which the best motion so far is returned [s]; None for as long as rounds gain. No
        step is started that would take longer, by its duration before; the first motion is judged
        whatever the time. Ctrl-C also returns the best so far.
    progress : callable, optional
        Called with ``("fastest", round, rounds)``, and with the stages of `plan` in between. It may
        raise `KeyboardInterrupt` to stop.

    Raises
    ------
    ProblemError
        No limits of acceleration are given or known; the problem has no such cost to keep, or its
        path has a feed.
    PlanError
        No motion that was found keeps all limits at any pace, or none was found in time; says the
        last verdict.
    KeyboardInterrupt
        The interruption came before there was a motion.
    """
    check_problem(problem)
    check_no_feed(problem)
    cost_limits = CostLimits.of(problem, {} if keep is None else keep)
    limits = rate_limits(problem, acceleration, velocity)
    clock = Deadline.after(deadline)
    rounds = _Rounds(problem, limits, cost_limits, search, tolerance, clock, progress)
    status = Status.CONVERGED
    try:
        with held_interruption():
            rounds.run()
    except KeyboardInterrupt:
        # A plan in between may have seen first that it is late.
        is_late = time.perf_counter() >= clock.end - rounds.longest_retiming
        status = Status.DEADLINE if is_late else Status.INTERRUPTED
        if rounds.best is None and not is_late:
            raise
    if rounds.best is None:
        if status is Status.DEADLINE:
            raise DeadlineError(
                f"no motion keeps all limits at any pace in {deadline} s: {rounds.verdict}"
            )
        raise PlanError(f"no motion keeps all limits at any pace: {rounds.verdict}")
    best = with_ending(rounds.best, status) if status.is_cut_short else rounds.best
    return Fastest(
        best, rounds.minimum_norm_time, rounds.least_cost_time, tuple(rounds.times), status
    )


class _Rounds:
    """Rounds of the search for the fastest motion.

    Parameters
    ----------
    problem : Problem
    limits : (n,), (n,)
        Of velocity and acceleration.
    cost_limits : CostLimits
    search : Search or None
    tolerance : Tolerance or None
    clock : Deadline
    progress : Progress

    Attributes
    ----------
    best : Plan or None
        The fastest motion so far that is verified, and within the limits of costs.
    verdict : str
        The last verdict.
    minimum_norm_time, least_cost_time : float
        Times of the two initial motions at their fastest [s]; inf where none is verified.
    times : list of float
        Of the best motion after each round [s].
    longest_retiming : float
        Longest time that the computation of a pace took so far [s].
    """

    def __init__(
        self,
        problem: Problem,
        limits: tuple[Array, Array],
        cost_limits: CostLimits,
        search: Search | None,
        tolerance: Tolerance | None,
        clock: Deadline,
        progress: Progress,
    ) -> None:
        self._problem, self._limits = problem, limits
        self._search, self._tolerance, self._clock = search, tolerance, clock
        self._progress = clock.checked_by(progress)
        self._cost_limits = cost_limits
        self._cost_bounds = np.full(len(cost_limits.costs), np.inf)
        self.best: Plan | None = None
        self.verdict = "nothing was planned yet"
        self.minimum_norm_time = self.least_cost_time = np.inf
        self.times: list[float] = []
        self.longest_retiming = 0.0

    def run(self) -> None:
        """Go on while rounds gain; KeyboardInterrupt where they were stopped."""
        geometric = _without_pace(self._problem)
        planned = self._plan(geometric)
        if not _reaches_end(planned):
            # Nor at any other pace: other violations do not matter.
            self.verdict = planned.report.ending or planned.certificate.verdict
            return
        costs = self._cost_limits.values(planned)
        self._cost_bounds = self._cost_limits.bounds(costs)
        retimed = self._retime(planned)
        self.least_cost_time = _verified_time(retimed)
        self._retime_minimum_norm(planned)
        _check_complete(planned)
        weight = 0.0
        pace: PaceMap = same_pace
        for number in range(ROUNDS):
            self._progress("fastest", number, ROUNDS)
            before = self._best_time
            limit_use = LimitUse(*self._limits, _POWER)
            limited = self._cost_limits.weighted(costs, weight * before) if weight else ()
            try:
                problem = repaced(replace(geometric, costs=(limit_use, *limited)), pace)
            except PathError:
                # No pace as smooth as the path is near the fastest one, which is the result.
                return
            planned = self._plan(problem, reserve=self.longest_retiming)
            self.verdict = planned.certificate.verdict
            if _reaches_end(planned):
                retimed = self._retime(planned)
            _check_complete(planned)
            self.times.append(self._best_time)
            is_within = self._is_within_cost_limits(planned)
            if number and is_within and self._best_time > (1.0 - _ROUND_GAIN) * before:
                return
            if not is_within:
                weight = max(_COST_WEIGHT, _COST_WEIGHT_GROWTH * weight)
            pace = smoothed_pace(self._problem.path, planned.path, retimed.path)

    def _plan(self, problem: Problem, reserve: float = 0.0) -> Plan:
        """Plan in the remaining time minus a reserve [s].

        KeyboardInterrupt after an interruption, or without time.
        """
        remaining = self._remaining(reserve)
        try:
            return plan(
                problem,
                search=self._search,
                tolerance=self._tolerance,
                deadline=remaining if np.isfinite(remaining) else None,
                progress=self._progress,
            )
        except PlanError:
            self._clock.check()
            raise

    def _remaining(self, reserve: float) -> float:
        """Return the remaining time minus a reserve [s]; KeyboardInterrupt for none."""
        self._clock.check()
        remaining = self._clock.end - time.perf_counter() - reserve
        if remaining <= 0.0:
            raise KeyboardInterrupt
        return remaining

    def _retime(self, planned: Plan) -> Plan:
        """Return a motion at its fastest within all constraints of the problem.

        It becomes the best one where it is verified, within the limits of costs, and faster.
        """
        began = time.perf_counter()
        constraints = tuple(self._problem.constraints)
        constrained = replace(planned, problem=replace(planned.problem, constraints=constraints))
        velocity, acceleration = self._limits
        retimed = retime(constrained, acceleration, velocity)
        self.longest_retiming = max(self.longest_retiming, time.perf_counter() - began)
        self.verdict = retimed.certificate.verdict
        is_faster = _verified_time(retimed) < self._best_time
        if is_faster and self._is_within_cost_limits(planned):
            self.best = retimed
        return retimed

    def _retime_minimum_norm(self, planned: Plan) -> None:
        """Take the minimum-norm motion at its fastest as well, if it is on the path."""
        minimum_norm = replace(planned, trajectory=planned.initial_trajectory)
        minimum_norm = replace(minimum_norm, certificate=minimum_norm.check())
        if minimum_norm.certificate.on_path:
            self._remaining(reserve=self.longest_retiming)
            self.minimum_norm_time = _verified_time(self._retime(minimum_norm))

    def _is_within_cost_limits(self, planned: Plan) -> bool:
        """Return whether the costs of a motion's joint path are within their limits."""
        return bool(np.all(self._cost_limits.values(planned) <= self._cost_bounds))

    @property
    def _best_time(self) -> float:
        return np.inf if self.best is None else self.best.path.duration


def _without_pace(problem: Problem) -> Problem:
    """Return a problem without its constraints on the pace: that of the motion is found later.

    Joints stay where limits of speed by position let them move at some pace.
    """
    geometric = (item for item in problem.constraints if not item.of_pace)
    any_speed = JointVelocityLimits(np.inf, replace=True)
    return replace(problem, constraints=(*geometric, *_movable_ranges(problem), any_speed))


def _movable_ranges(problem: Problem) -> Iterator[JointPositionLimits]:
    """Yield the ranges in which limits of speed by position are not 0.

    At no pace does a joint go where its limit of speed is 0.
    """
    start = problem.given_start
    for curves in envelope_of_problem(problem).curves:
        lower, upper = curves.resting[0] + _MOVING_MARGIN, curves.resting[1] - _MOVING_MARGIN
        if start is not None:
            # A given start is not moved.
            lower = np.minimum(lower, start - _START_MARGIN)
            upper = np.maximum(upper, start + _START_MARGIN)
        yield JointPositionLimits(lower, upper)


def _reaches_end(planned: Plan) -> bool:
    """Return whether a motion follows its path to the end."""
    return planned.certificate.on_path and not planned.report.ending


def _verified_time(retimed: Plan) -> float:
    """Return the time of a motion [s]; inf where it is not verified."""
    return retimed.path.duration if retimed.certificate.verified else np.inf


def _check_complete(planned: Plan) -> None:
    """Raise KeyboardInterrupt where planning was cut short."""
    if planned.report.status.is_cut_short:
        raise KeyboardInterrupt

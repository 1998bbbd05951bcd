"""The fastest motion along a path: pace and null motion, each in its turn."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    Array,
    DeadlineError,
    PathError,
    PlanError,
    ProblemError,
    Progress,
    as_number,
    held_interruption,
    shown,
    silent,
)
from selfmotion.certificate import Tolerance
from selfmotion.model.motion import Grid
from selfmotion.model.path import Pace, Path, Retimed, times_when
from selfmotion.planning.optimise import Status
from selfmotion.planning.planner.effort import Deadline, Search
from selfmotion.planning.planner.run import plan, with_ending
from selfmotion.planning.result import Plan, check_no_feed, rate_limits, retime
from selfmotion.problem.constraints import Constraint, JointPositionLimits, JointVelocityLimits
from selfmotion.problem.costs import Cost, LimitUse, Samples, Scaled
from selfmotion.problem.problem import (
    Problem,
    along_other_paths,
    check_problem,
    envelope_of_problem,
)

# Default deadline [s].
_FASTEST_DEADLINE = 60.0
# Distance of joint paths from where limits of speed by position are 0 [rad or m]: joints of an FR3
# may move at 0.1 rad/s there.
_FROM_REST = 5e-3
# Room beside a given start that is nearer [rad or m].
_BESIDE_START = 1e-4
# Rounds end at a relative gain below this …
_ROUND_GAIN = 2e-3
# … and after this number.
ROUNDS = 8
# Weight of limited costs, in multiples of the motion's time …
_KEPT_WEIGHT = 0.05
# … and its growth while they are exceeded.
_KEPT_GROWTH = 4.0
# Power p of `LimitUse`: larger ones are nearer to the maximum, and harder to minimise.
_POWER = 16.0
# Intervals of the pace of a round.
_COARSE = 32
# Degree of the pace.
_DEGREE = 5


# Smallest number of steps for the evaluation of costs.
_STEPS = 300


@dataclass(frozen=True, eq=False)
class _KeptCosts:
    """Costs of a problem, and by which factor a motion may cost more than the best by all costs.

    The cost of a motion depends on its pace, and faster ones cost more by their joint speeds. So
    joint paths are compared: each at the time law of the problem's own path.

    Attributes
    ----------
    problem : Problem
    costs : tuple of Cost
        Limited costs of the problem.
    factors : tuple of float
        Largest multiples, at least 1; of a negative cost, the allowed increase is this minus 1
        times its size.
    """

    problem: Problem
    costs: tuple[Cost, ...]
    factors: tuple[float, ...]

    @classmethod
    def of(cls, problem: Problem, keep: Mapping[str, float]) -> _KeptCosts:
        """Return those of kinds or names, ProblemError where the problem has no such cost."""
        if not isinstance(keep, Mapping):
            raise ProblemError(f"keep is {shown(keep)}, expected a factor for each kind of cost")
        costs, factors = [], []
        for key, factor in keep.items():
            found = [item for item in problem.costs if key in (item.kind, item.name)]
            if not found:
                known = ", ".join(dict.fromkeys(item.kind for item in problem.costs))
                raise ProblemError(f"keep: the problem has no cost {shown(key)}, but {known}")
            number = as_number(factor, f"keep: {key}", least=1.0)
            costs += found
            factors += [number] * len(found)
        return cls(problem, tuple(costs), tuple(factors))

    def values(self, plan: Plan) -> Array:
        """Return the costs of a plan's joint path at the time law of the problem's path, (K,).

        Parameters
        ----------
        plan : Plan
            Along the problem's path, or along a `Retimed` one of it.
        """
        motion, grid = plan.trajectory, Grid.aligned(self.problem.path.knots, _STEPS)
        paces = _paces(plan.path)
        t = grid.nodes
        for pace in paces[len(_paces(self.problem.path)) :]:
            t = times_when(pace, t, np.zeros(len(t)), np.full(len(t), pace.t[-1]))
        passed = motion(motion.t[0] + np.minimum(t, motion.duration))
        q, qd = _by(grid.nodes, passed, grid.stage_times)
        samples = Samples.along(self.problem.follows, grid.sampling, q, qd)
        return np.array([samples.weights @ cost.value(samples) for cost in self.costs])

    def bounds(self, best: Array) -> Array:
        """Return the limits of the costs, (K,), if the best motion by them costs `best`."""
        return np.asarray(best + (np.array(self.factors) - 1.0) * np.abs(best))

    def weighted(self, costs: Array, weight: float) -> tuple[Cost, ...]:
        """Return the costs scaled so that each has about a weight [s]."""
        sizes = np.maximum(np.abs(costs), 1e-12)
        each = zip(self.costs, sizes.tolist(), strict=True)
        return tuple(Scaled(cost, weight / size) for cost, size in each)


def _paces(path: Path) -> list[Pace]:
    """Return the paces of a path that is retimed, maybe again and again, the first one first."""
    return [*_paces(path.original), path.pace] if isinstance(path, Retimed) else []


def _by(nodes: Array, q: Array, t: Array) -> tuple[Array, Array]:
    """Return a motion through q (N, n) at nodes (N,), and its velocities, at times t (S,)."""
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(nodes, q)
    return np.asarray(spline(t)), np.asarray(spline(t, 1))


# Map of a path to another pace.
_Repaced = Callable[[Path], Path]


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
    deadline: float | None = _FASTEST_DEADLINE,
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
    kept = _KeptCosts.of(problem, {} if keep is None else keep)
    limits = rate_limits(problem, acceleration, velocity)
    clock = Deadline.after(deadline)
    rounds = _Rounds(problem, limits, kept, search, tolerance, clock, progress)
    status = Status.CONVERGED
    try:
        with held_interruption():
            rounds.run()
    except KeyboardInterrupt:
        # A plan in between may have seen first that it is late.
        late = time.perf_counter() >= clock.end - rounds.longest
        status = Status.DEADLINE if late else Status.INTERRUPTED
        if rounds.best is None and not late:
            raise
    if rounds.best is None:
        if status is Status.DEADLINE:
            raise DeadlineError(
                f"no motion keeps all limits at any pace in {deadline} s: {rounds.verdict}"
            )
        raise PlanError(f"no motion keeps all limits at any pace: {rounds.verdict}")
    found = rounds.retimed
    best = with_ending(rounds.best, status) if status.is_cut_short else rounds.best
    return Fastest(best, found["x = 0"], found["costs"], tuple(rounds.times), status)


class _Rounds:
    """Rounds of the search for the fastest motion.

    Parameters
    ----------
    problem : Problem
    limits : (n,), (n,)
        Of velocity and acceleration.
    kept : _KeptCosts
    search : Search or None
    tolerance : Tolerance or None
    clock : Deadline
    progress : Progress
    """

    def __init__(
        self,
        problem: Problem,
        limits: tuple[Array, Array],
        kept: _KeptCosts,
        search: Search | None,
        tolerance: Tolerance | None,
        clock: Deadline,
        progress: Progress,
    ) -> None:
        self._problem, (self._v, self._a) = problem, limits
        self._search, self._tolerance, self._clock = search, tolerance, clock
        self._progress = clock.checked_by(progress)
        self._kept, self._bounds = kept, np.full(len(kept.costs), np.inf)
        geometric = (item for item in problem.constraints if not item.of_pace)
        # Limits of speed apply at the final pace, not at this one.
        any_speed = JointVelocityLimits(np.inf, replace=True)
        places = _places_to_move(problem)
        self._free = replace(problem, constraints=(*geometric, *places, any_speed))
        self.best: Plan | None = None
        self.verdict = "nothing was planned yet"
        self.times: list[float] = []
        self.retimed = {"x = 0": np.inf, "costs": np.inf}
        # Longest time of a pace's computation so far [s].
        self.longest = 0.0

    def run(self) -> None:
        """Go on while rounds gain; KeyboardInterrupt where they were stopped."""
        planned = self._plan(self._free)
        if planned.report.ending or not planned.certificate.on_path:
            # At no pace can it be followed to its end: other violations do not matter.
            self.verdict = planned.report.ending or planned.certificate.verdict
            return
        costs = self._kept.values(planned)
        self._bounds = self._kept.bounds(costs)
        found = self._taken("costs", planned)
        minimum_norm = replace(planned, trajectory=planned.initial_trajectory)
        minimum_norm = replace(minimum_norm, certificate=minimum_norm.check())
        if minimum_norm.certificate.on_path:
            self._left(self.longest)
            self._taken("x = 0", minimum_norm)
        if planned.report.status.is_cut_short:
            raise KeyboardInterrupt
        use, weight = LimitUse(self._v, self._a, _POWER), 0.0
        pace: _Repaced = _own
        for number in range(ROUNDS):
            self._progress("fastest", number, ROUNDS)
            before = self._duration
            weighted = self._kept.weighted(costs, weight * self._duration) if weight else ()
            wanted = replace(self._free, costs=(use, *weighted))
            try:
                paced = _at_pace(wanted, pace)
            except PathError:
                # No pace as smooth as the path is near the one found: that one is the result.
                return
            planned = self._plan(paced, self.longest)
            self.verdict = planned.certificate.verdict
            if planned.certificate.on_path and not planned.report.ending:
                found = self._taken("rounds", planned)
            if planned.report.status.is_cut_short:
                raise KeyboardInterrupt
            self.times.append(self._duration)
            kept = self._keeps(planned)
            if number and kept and self._duration > (1.0 - _ROUND_GAIN) * before:
                return
            # Costs that are passed count more in the next round.
            weight = weight if kept else max(_KEPT_WEIGHT, _KEPT_GROWTH * weight)
            pace = _stand_in(self._problem.path, planned.path, found.path)

    def _left(self, kept: float = 0.0) -> float:
        """Return the remaining time minus a reserve [s]; KeyboardInterrupt for none."""
        self._clock.check()
        left = self._clock.end - time.perf_counter() - kept
        if left <= 0.0:
            raise KeyboardInterrupt
        return left

    def _plan(self, problem: Problem, kept: float = 0.0) -> Plan:
        """Plan in the remaining time minus a reserve for its pace [s].

        KeyboardInterrupt after an interruption, or without time.
        """
        left = self._left(kept)
        try:
            return plan(
                problem,
                search=self._search,
                tolerance=self._tolerance,
                deadline=left if np.isfinite(left) else None,
                progress=self._progress,
            )
        except PlanError:
            self._clock.check()
            raise

    @property
    def _duration(self) -> float:
        return np.inf if self.best is None else self.best.path.duration

    def _keeps(self, planned: Plan) -> bool:
        """Return whether the costs of a motion's joint path are within their limits."""
        return bool(np.all(self._kept.values(planned) <= self._bounds))

    def _taken(self, name: str, planned: Plan) -> Plan:
        """Return a motion at its fastest: the best so far unless it is faster within the costs."""
        began = time.perf_counter()
        found = _at_its_fastest(planned, self._problem, self._v, self._a)
        self.longest = max(self.longest, time.perf_counter() - began)
        self.verdict = found.certificate.verdict
        if found.certificate.verified:
            self.retimed[name] = found.path.duration
            if found.path.duration < self._duration and self._keeps(planned):
                self.best = found
        return found


def _places_to_move(problem: Problem) -> Iterator[JointPositionLimits]:
    """Yield where joints may be for limits of speed by position to let them move at some pace.

    At no pace does a joint go where its limit of speed is 0.
    """
    start = problem.given_start
    for curves in envelope_of_problem(problem).curves:
        lower, upper = curves.resting[0] + _FROM_REST, curves.resting[1] - _FROM_REST
        if start is not None:
            # It stands where it stands.
            lower = np.minimum(lower, start - _BESIDE_START)
            upper = np.maximum(upper, start + _BESIDE_START)
        yield JointPositionLimits(lower, upper)


def _at_its_fastest(planned: Plan, problem: Problem, v: Array, a: Array) -> Plan:
    """Return a motion at the fastest pace that satisfies the problem."""
    constraints: tuple[Constraint, ...] = tuple(problem.constraints)
    whole = replace(planned, problem=replace(planned.problem, constraints=constraints))
    return retime(whole, a, v)


def _at_pace(problem: Problem, pace: _Repaced) -> Problem:
    """Return a problem along a path at another pace, with the windows of its tolerances there."""
    path = pace(problem.path)
    when = path.when if isinstance(path, Retimed) else np.asarray
    return replace(problem, **along_other_paths(problem, pace, when))


def _own(path: Path) -> Path:
    return path


def _stand_in(original: Path, current: Path, found: Path) -> _Repaced:
    """Return the map of a path to about the pace of `found`, which is a pace of `current`.

    As smooth as the path: its accelerations do not jump from limit to limit.
    """
    from scipy.interpolate import make_interp_spline

    if not isinstance(found, Retimed):
        raise TypeError(f"a retimed motion has a {type(found).__name__}")
    t = np.linspace(0.0, found.duration, _COARSE + 1)
    sigma = np.clip(found.pace(t), 0.0, current.duration)
    if isinstance(current, Retimed) and current is not original:
        sigma = current.pace(sigma)
    sigma = np.maximum.accumulate(sigma)
    sigma[0], sigma[-1] = 0.0, original.duration
    minimum_norm: Any = [(1, 0.0), (2, 0.0)]
    spline = make_interp_spline(t, sigma, _DEGREE, bc_type=(minimum_norm, minimum_norm))
    rate, bend = np.maximum(spline(t, 1), 0.0), spline(t, 2)
    return lambda path: Retimed(path, t, sigma, rate, bend)

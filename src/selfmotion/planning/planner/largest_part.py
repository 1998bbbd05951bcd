"""The largest part of a path that the arm can follow, where it cannot follow all of it."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, BreakdownError, RedundancyError
from selfmotion.model.follow import completed, null_basis
from selfmotion.model.motion import Evaluation, Grid, Sampling
from selfmotion.model.path import Section, edges_of
from selfmotion.planning.formulation import Formulation, keeps_off_itself, with_windows_shut
from selfmotion.planning.optimise import Status
from selfmotion.planning.planner.effort import Effort, Search
from selfmotion.planning.planner.guess import Guess
from selfmotion.planning.planner.screening import ROUGH_MOTIONS
from selfmotion.planning.planner.solution import Solution
from selfmotion.planning.planner.solve import solve
from selfmotion.planning.rollout import Guide, MinimumNormMotion
from selfmotion.planning.search import Reach
from selfmotion.problem.problem import along_other_paths

# Share of the time to the edge of the workspace that is left out: joint speeds grow without bound
# there.
_EDGE_MARGIN = 1e-4
# Relative accuracy of the end of the part.
_END_AGREEMENT = 4e-3
# Smallest part, as a share of the path, and of its first segment.
_MIN_PART = 1e-2
# Largest number of ends that are tried.
_PROBES = 10
# Steps in which motions are followed …
_FOLLOWED_STEPS = 128
# … until their path error is above this share of the path's extent.
_OFF_PATH = 1e-2
# A part that is too rough near its end is shortened by this share.
_PART_BACK = 0.02
# Constant null motions in place of x = 0 where that breaks down: joint angles over the path [rad].
_PUSHES = (0.5, 2.0)
# Cause of an end that is at no violated limit.
_ROUGH = "beyond that it is off the path or past limits between its nodes"


_StartGuess = tuple[Array, Guide | None]
"""A start, and a null motion in place of x = 0."""


@dataclass(frozen=True, eq=False)
class Part:
    """A motion along the first part of a path, or all of it.

    Attributes
    ----------
    formulation : Formulation
        That of the part.
    solution : Solution
        Optimised.
    ending : str
        Why it goes no further; "" where the part is the whole.
    why : str
        The reasons alone.
    """

    formulation: Formulation
    solution: Solution
    ending: str = ""
    why: str = ""


@dataclass(frozen=True, eq=False)
class _Attempt:
    """Result of a start on a part: no solution at a breakdown; the extent without violations."""

    start_guess: _StartGuess
    formulation: Formulation
    solution: Solution | None
    kept_until: float
    found: Evaluation | None
    trouble: str = ""

    @property
    def arrived(self) -> bool:
        return self.solution is not None and not self.solution.violations

    @property
    def cost(self) -> float:
        return np.inf if self.found is None else self.found.cost

    @property
    def reason(self) -> str:
        """Cause of its failure."""
        if self.solution is None:
            return self.trouble
        return "; ".join(self.solution.violations)

    @property
    def cut_short(self) -> bool:
        """Whether the user ended the optimisation."""
        return self.solution is not None and self.solution.cut_short


def largest_part(formulation: Formulation, reach: Reach, effort: Effort) -> Part | None:
    """Return an optimised motion along the largest part [0, t] of the path that can be found.

    Motions up to where single poses are in reach, by the same optimiser as any; where none
    arrives, the end of the part is bisected. Conditions on the end of the motion do not apply to a
    part.

    Parameters
    ----------
    formulation : Formulation
        Of the whole path.
    reach : Reach
        Extent to which single poses are reachable.
    effort : Effort
        Options of the solutions.

    Returns
    -------
    Part or None
        None where nothing worth the name is left.
    """
    try:
        return _largest_part(formulation, reach, effort)
    except RedundancyError:
        # Before a tolerance's window, a part may have no self-motion.
        return None


def _largest_part(formulation: Formulation, reach: Reach, effort: Effort) -> Part | None:
    goal = reach.time * (1.0 - _EDGE_MARGIN) if reach.reason else reach.time
    if goal < _least(formulation):
        return None
    first = _until(formulation, goal)
    attempts = []
    given = formulation.given_start is not None
    few = reach.starts if given else reach.starts[:: -(-len(reach.starts) // ROUGH_MOTIONS)]
    few = [_start_of(first, formulation, q) for q in few]
    starts = _apart(first, few) if effort.apart else few
    for start_guess in _beginnings(first, starts)[: Search().finalists if given else 1]:
        attempts.append(_attempt(first, start_guess, effort))
        if attempts[-1].cut_short:
            return _part(formulation, attempts[-1], reach, "")
    arrived = [attempt for attempt in attempts if attempt.arrived]
    if arrived:
        return _part(formulation, min(arrived, key=lambda attempt: attempt.cost), reach, "")
    furthest = max(attempts, key=lambda attempt: attempt.kept_until)
    return _bisect(formulation, furthest, reach, effort)


def _least(formulation: Formulation) -> float:
    """Return the smallest duration of a part of a path [s]."""
    first = float(edges_of(formulation.path.knots)[1])
    return _MIN_PART * min(first, formulation.path.duration)


def _bisect(
    formulation: Formulation, failed: _Attempt, reach: Reach, effort: Effort
) -> Part | None:
    """Return the motion of a start on the largest part on which it arrives."""
    arrived: _Attempt | None = None
    low, high = 0.0, failed.formulation.path.duration
    back = _END_AGREEMENT
    for _ in range(_PROBES):
        if arrived is None:
            # The extent without violations is a good guess; if it fails, the next ones are shorter.
            probe = max(min(failed.kept_until, high * (1.0 - back)), 0.5 * high)
            back *= 2.0
        else:
            probe = 0.5 * (low + high)
        if probe < _least(formulation) or high - low < _END_AGREEMENT * high:
            break
        part = _until(formulation, probe)
        attempt = _attempt(part, _start_guess_of(part, failed), effort)
        if attempt.arrived or attempt.cut_short:
            arrived, low = attempt, probe
        else:
            failed, high = attempt, probe
        if attempt.cut_short:
            break
    return None if arrived is None else _part(formulation, arrived, reach, failed.reason)


def _part(formulation: Formulation, found: _Attempt, reach: Reach, further: str) -> Part:
    """Return the part, with the reason why nothing goes `further` in words."""
    if found.solution is None:
        raise RuntimeError("a part is made of a motion that was found")
    reasons = [reach.reason] if reach.reason else []
    reasons += [f"the next longer motion fails: {further}"] if further else []
    return _ending_at(formulation, found.formulation, found.solution, "; ".join(reasons))


def shorter_part(formulation: Formulation, part: Part, effort: Effort) -> Part | None:
    """Return a motion on a part that ends a little earlier; None where none is found.

    For one whose last bit is too rough: near a singular pose rates grow between its nodes.
    """
    first = _until(formulation, part.formulation.path.duration * (1.0 - _PART_BACK))
    start = _start_of(first, part.formulation, part.solution.evaluation.trajectory.q[0])
    attempt = _attempt(first, (start, None), effort)
    if attempt.solution is None or not attempt.arrived:
        return None
    return _ending_at(formulation, first, attempt.solution, part.why or _ROUGH)


def _ending_at(formulation: Formulation, part: Formulation, solution: Solution, why: str) -> Part:
    end, whole = part.path.duration, formulation.path.duration
    ending = f"the motion ends at t = {end:.6g} s of {whole:.6g} s: {why}"
    return Part(part, solution, ending if end < whole else "", why)


def _until(formulation: Formulation, time: float) -> Formulation:
    """Return the problem on [0, time], without conditions on the end."""
    if time >= formulation.path.duration:
        return formulation
    remaining = [item for item in formulation.problem.constraints if not item.ends.is_about(1)]
    shorter = along_other_paths(
        formulation.problem,
        lambda path: Section(path, 0.0, time, crowding=True),
        lambda t: np.minimum(t, time),
    )
    return Formulation.of(formulation.problem.changed(**shorter, constraints=remaining))


def _start_of(part: Formulation, formulation: Formulation, q: Array) -> Array:
    """Return a start (n,) of a problem as one of its part, which may have fewer joints."""
    own = q[None, : formulation.robot.dof]
    return np.asarray(completed(part.follows, np.zeros(1), own)[0])


def _start_guess_of(part: Formulation, failed: _Attempt) -> _StartGuess:
    """Return the start of another part as that of a part, which may have fewer joints."""
    start, guide = failed.start_guess
    if isinstance(guide, _Push):
        guide = guide.of(part.robot.dof, part.follows.dof)
    return _start_of(part, failed.formulation, start), guide


def _attempt(formulation: Formulation, start_guess: _StartGuess, effort: Effort) -> _Attempt:
    try:
        start, guide = start_guess
        free = formulation.given_start is None
        guess = Guess.of(formulation, effort, start, free=free, guide=guide)
    except BreakdownError as error:
        reason = f"it runs into a singular pose near t = {error.time:.6g} s"
        return _Attempt(start_guess, formulation, None, error.time, None, reason)
    try:
        solution = solve(guess)
    except KeyboardInterrupt:
        solution = Solution.of(guess).ended_by(Status.INTERRUPTED)
    found = solution.evaluation
    motion = found.trajectory
    # Infeasible constraints may distort it: then x = 0 is a better guess.
    until = max(
        _kept_until(formulation, motion.t, motion.q, motion.qd),
        -_rank(formulation, *start_guess)[1],
    )
    return _Attempt(start_guess, formulation, solution, until, found)


def _apart(formulation: Formulation, starts: list[Array]) -> list[Array]:
    """Return the starts at which the arm does not meet itself; all where it always does."""
    return [q for q in starts if keeps_off_itself(formulation, q[None])] or starts


def _beginnings(formulation: Formulation, starts: list[Array]) -> list[_StartGuess]:
    """Return starts, and null motions in place of x = 0 where that breaks down; the best first."""
    ranked = sorted(((start, None) for start in starts), key=lambda each: _rank(formulation, *each))
    furthest = ranked[0][0]
    if -_rank(formulation, furthest, None)[0] >= formulation.path.duration:
        return list(ranked)
    pushed: list[_StartGuess] = [
        *ranked,
        *((furthest, push) for push in _pushes(formulation, furthest)),
    ]
    return sorted(pushed, key=lambda each: _rank(formulation, *each))


class _Push:
    """A constant rate as the null motion that stands for x = 0."""

    def __init__(self, rate: Array) -> None:
        self._rate = rate

    def of(self, own: int, dof: int) -> "_Push":
        """Return that of the arm's own joints, with virtual ones at rest after them, dof in all."""
        if len(self._rate) == dof:
            return self
        return _Push(np.append(self._rate[:own], np.zeros(dof - own)))

    def __call__(self, t: Array) -> Array:
        """Return the rate at times `t` (S,), (S, n)."""
        return np.tile(self._rate, (len(t), 1))


def _pushes(formulation: Formulation, start: Array) -> list[Guide]:
    """Return null motions to either side: x = 0 may stay in a plane without a continuation."""
    basis = null_basis(formulation.follows, start) / formulation.path.duration
    angles = [sign * angle for angle in _PUSHES for sign in (1.0, -1.0)]
    return [_Push(angle * direction) for direction in basis.T for angle in angles]


def _rank(
    formulation: Formulation, start: Array, guide: Guide | None
) -> tuple[float, float, float]:
    """Return the negative times of path and limits without violation [s], and the effort.

    That without self-motion, from a start; the smaller, the better.
    """
    path = formulation.path
    grid = Grid.aligned(path.knots, _FOLLOWED_STEPS)
    minimum_norm = MinimumNormMotion.on(with_windows_shut(formulation), start, grid, guide)
    trouble = minimum_norm.off_path(_OFF_PATH)
    far = path.duration if trouble is None else trouble
    remaining = _kept_until(formulation, minimum_norm.grid.nodes, minimum_norm.q, minimum_norm.qd)
    # Beyond the place where it broke down, speeds may be anything.
    weights = Sampling.trapezoidal(minimum_norm.grid.nodes).weights
    effort = float(weights @ np.sum(minimum_norm.qd**2, axis=1)) if trouble is None else np.inf
    return -far, -min(remaining, far), effort


def _kept_until(formulation: Formulation, t: Array, q: Array, qd: Array) -> float:
    """Return the first of the times t (N,) at which a joint is beyond its limits, or the last."""
    remaining = formulation.envelope.keeps(q, qd)
    return float(t[-1] if remaining.all() else t[int(np.argmin(remaining))])

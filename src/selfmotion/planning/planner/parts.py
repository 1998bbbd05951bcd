"""A path that no motion follows as a whole, in the fewest parts, and the moves between them."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    Array,
    BreakdownError,
    InverseKinematicsError,
    NoSequenceError,
    PlanError,
    ProblemError,
    Progress,
    SelfmotionError,
    as_number,
    as_numbers,
    held_interruption,
    obeying,
    random_numbers,
    silent,
)
from selfmotion.certificate import Tolerance
from selfmotion.model.motion import Trajectory, joined_motions, reversed_motion
from selfmotion.model.path import Line, Retimed, Section, section_at_rest
from selfmotion.model.task import SE3
from selfmotion.planning.formulation import on_path
from selfmotion.planning.planner.effort import Search
from selfmotion.planning.planner.run import plan, plan_along
from selfmotion.planning.result import Move, Parts, Plan
from selfmotion.planning.search import (
    ChainSegment,
    ChainSegments,
    Sequence,
    has_curves,
    turned_towards,
)
from selfmotion.planning.transfer import FreeMotions
from selfmotion.problem.costs import JointVelocity
from selfmotion.problem.problem import (
    Problem,
    along_other_paths,
    at_all_times,
    check_feeds_of,
    check_problem,
    constraints_of_part,
    rest_orders,
    times_along,
)

# Cuts up to which a single motion is sought first, where samples do not prove that parts are
# needed.
_MISSED_CUTS = 1
# Searches for other cuts where parts could not be planned …
_ATTEMPTS = 4
# … at least this far away, as a share of the path's waypoints.
_ELSEWHERE = 0.03
# Smallest number of samples of a guide.
_GUIDE_SAMPLES = 13
# Average speed of a retreat [m/s] …
_RETREAT_SPEED = 0.1
# … and its shortest time [s].
_BRIEFEST_RETREAT = 0.5
# Orders of rest of a tool motion that needs no ramp; see `rest_orders`.
_AT_REST = 2
# Direction of a retreat, in tool axes.
_BACK = (0.0, 0.0, -1.0)


class _Mover:
    """Finds moves between configurations of a problem.

    Parameters
    ----------
    problem : Problem
        Its conditions at all times also apply to moves.
    retreat : (3,) or None
        How far the tool leaves the path before a move, and comes back after, in tool axes [m].
    rng : Generator
    progress : Progress
    """

    def __init__(
        self,
        problem: Problem,
        retreat: Array | None,
        rng: np.random.Generator,
        progress: Progress,
    ) -> None:
        self._problem, self._retreat = problem, retreat
        self._free = FreeMotions(problem.robot, problem.all_constraints, rng, progress)

    def move(self, first: Array, last: Array) -> Move:
        """Return a move between configurations (n,), or the cause why there is none."""
        if self._retreat is None:
            return self._free.between(first, last)
        try:
            away, back = (self._lead(q, self._retreat) for q in (first, last))
        except SelfmotionError as error:
            trouble = f"the tool cannot retreat along its axis: {error}"
            return Move(self._free.robot, self._free.constraints, None, trouble)
        between = self._free.between(away.q[-1], back.q[-1])
        if between.trajectory is None:
            return between
        whole = joined_motions([away, between.trajectory, reversed_motion(back)])
        return Move(self._free.robot, self._free.constraints, whole)

    def _lead(self, q: Array, retreat: Array) -> Trajectory:
        """Return the motion of the tool away from where q has it; SelfmotionError for none."""
        pose = self._problem.robot.pose(q)
        away = pose * SE3(np.eye(3), retreat)
        duration = max(float(np.linalg.norm(retreat)) / _RETREAT_SPEED, _BRIEFEST_RETREAT)
        line = Line(pose, away, duration)
        return plan(replace(self._problem, path=line, start=q)).require().trajectory


def between_parts(problem: Problem) -> Problem:
    """Return a problem with the conditions at all times, without those at an end."""
    return replace(
        problem,
        start=None,
        costs=(JointVelocity.usual(problem.robot),),
        constraints=at_all_times(problem.constraints),
        relaxations=(),
        rest=True,
    )


class _PartPlanner:
    """Plans the parts along chains, and the moves between them.

    Attributes
    ----------
    failure : SelfmotionError
        Why a part had no complete motion, of the last one that had none.
    """

    def __init__(
        self,
        problem: Problem,
        segments: ChainSegments,
        retreat: Array | None,
        ramp: float,
        rng: np.random.Generator | int,
        tolerance: Tolerance,
        progress: Progress,
    ) -> None:
        self._problem, self._stretches, self._ramp = problem, segments, ramp
        self._tolerance, self._progress = tolerance, progress
        self._closed = any(item.ends.closes for item in problem.constraints)
        generator = np.random.default_rng(rng)
        self._mover = _Mover(between_parts(problem), retreat, generator, progress)
        self.failure: SelfmotionError = PlanError("no part was planned")
        # Chains have many parts in common.
        self._known: dict[tuple[int, bytes], Plan] = {}
        self._turning = np.isinf(problem.robot.lower) & np.isinf(problem.robot.upper)

    def plan(self, chains: list[ChainSegment]) -> tuple[Parts | None, set[int]]:
        """Return the parts, and the waypoints where a cut has led to one that fails.

        None where one has no complete motion; `failure` then says why.
        """
        plans: list[Plan] = []
        failed: set[int] = set()
        for number, segment in enumerate(chains, 1):
            self._progress("part", number, len(chains))
            try:
                plans.append(self._part(segment, plans[-1] if plans else None))
            except (BreakdownError, InverseKinematicsError, NoSequenceError) as error:
                self.failure = error
                return None, failed | self._around(segment)
            if not plans[-1].certificate.verified:
                failed |= self._around(segment)
        cuts = tuple(float(segment.t[-1]) for segment in chains[:-1])
        endings = tuple(segment.ending for segment in chains[:-1])
        moves = self._moves(plans)
        parts = Parts(self._problem, tuple(plans), moves, cuts, endings, tolerance=self._tolerance)
        return parts, failed

    def _moves(self, plans: list[Plan]) -> tuple[Move, ...]:
        pairs = list(itertools.pairwise(plans))
        if self._closed:
            pairs.append((plans[-1], plans[0]))
        if not all(plan.certificate.verified for plan in plans):
            trouble = "not looked for, since a part is not verified"
            missing = Move(self._problem.robot, (), None, trouble)
            return tuple(missing for _ in pairs)
        ends = [(one.trajectory.q[-1], other.trajectory.q[0]) for one, other in pairs]
        return tuple(self._mover.move(*each) for each in ends)

    def _around(self, segment: ChainSegment) -> set[int]:
        """Return the waypoints around a segment's ends that the parts on both sides share."""
        last = len(self._stretches.t) - 1
        width = max(1, round(_ELSEWHERE * last))
        cuts = {segment.first, segment.last} - {0, last}
        return {i for cut in cuts for i in range(cut - width, cut + width + 1)}

    def _part(self, segment: ChainSegment, before: Plan | None) -> Plan:
        """Return the plan of a segment that follows another one's plan."""
        t, q = segment.t, segment.q
        if before is not None:
            q = turned_towards(q, before.trajectory.q[-1], self._turning)
        key = segment.first, q.tobytes()
        if key not in self._known:
            self._known[key] = self._planned(self._part_problem(segment), t, q)
        return self._known[key]

    def _planned(self, problem: Problem, t: Array, q: Array) -> Plan:
        """Return the plan along a chain q (W, n) at the path's times t (W,)."""
        if isinstance(problem.path, Retimed):
            t = problem.path.when(t - t[0])
        if len(t) < _GUIDE_SAMPLES:
            # The given samples where the tool rests: there are few.
            few, places = t, np.linspace(0.0, len(t) - 1.0, _GUIDE_SAMPLES)
            t = np.interp(places, np.arange(len(few)), few)
            q = np.stack([np.interp(t, few, joint) for joint in q.T], axis=1)
        guide = Sequence(t, q, 0.0)
        return plan_along(problem, guide, self._tolerance, self._progress)

    def _part_problem(self, segment: ChainSegment) -> Problem:
        """Return the problem of a segment: at rest at cuts, with the conditions on it."""
        whole, last = self._problem, len(self._stretches.t) - 1
        cut = segment.first > 0 or self._closed, segment.last < last or self._closed
        if not any(cut):
            return whole
        ends = float(segment.t[0]), float(segment.t[-1])
        orders = rest_orders(Section(whole.path, *ends), whole.task)
        ramped = cut[0] and orders[0] < _AT_REST, cut[1] and orders[1] < _AT_REST
        path = section_at_rest(whole.path, *ends, min(self._ramp, ends[1] - ends[0]), ramped)
        return replace(
            whole,
            **along_other_paths(whole, lambda _: path, times_along(path, ends)),
            start=whole.start if segment.first == 0 else None,
            constraints=list(constraints_of_part(whole, segment.first == 0, segment.last == last)),
            rest=True,
        )


def plan_in_parts(
    problem: Problem,
    *,
    retreat: float = 0.0,
    axis: npt.ArrayLike | None = None,
    ramp: float = 0.5,
    rng: np.random.Generator | int = 0,
    tolerance: Tolerance | None = None,
    progress: Progress = silent,
) -> Parts:
    """Plan a path in the fewest parts, with changes of configuration in between.

    The global search finds the fewest chains of configurations that together follow the path, and
    among these the shortest, without a step that no motion takes. If one suffices, or samples may
    have missed that, `plan` comes first, and its plan is the only part if it is verified. Otherwise
    each chain becomes a plan. At a cut the tool rests on the path and goes on in another
    configuration. The move between them is a joint motion from rest to rest within the problem's
    conditions at all times, judged like a plan: straight, or by a few stops around obstacles.

    The number of parts is the least among the samples of the search; nothing proves that no
    continuous motion slips between them.

    Parameters
    ----------
    problem : Problem
        Conditions on the start or the end apply to the first or the last part. For a `ClosedPath` a
        last move leads back to the start. At cuts the arm rests, whatever `rest` is.
    retreat : float
        Distance that the tool leaves the path along `axis` before each move, and returns by [m]; by
        default the move starts on the path.
    axis : (3,), optional
        Where to, in tool axes: by default back along the tool's z axis.
    ramp : float
        How long the tool takes to come to rest at a cut, and to be up to speed again [s].
    rng : Generator or int
        Shifts the seeds of the searches.
    tolerance : Tolerance, optional
        Allowed error of the motion from the path.
    progress : callable, optional
        As in `plan`.

    Returns
    -------
    Parts
        Also where a part could not be planned or a move not be found: `Parts.verdict` says so, and
        `Parts.require` raises.

    Raises
    ------
    FeedError
        The path has a feed that is impossible for any arm; before any search.
    NoSequenceError
        No number of parts follows the path: a pose is out of reach, beyond limits or blocked in
        every configuration, or its neighbours are beyond the step limits. With the time and why.
    ProblemError
        An argument is invalid, the problem is damped, or has no self-motion to search.
    """
    retreats = _checked(problem, retreat, axis)
    ramp = as_number(ramp, "ramp", above=0.0)
    random_numbers(rng)
    check_feeds_of(problem)
    tolerance = Tolerance.of(tolerance)
    with held_interruption():
        return _parts(problem, retreats, ramp, rng, tolerance, obeying(progress))


def _parts(
    problem: Problem,
    retreats: Array | None,
    ramp: float,
    rng: np.random.Generator | int,
    tolerance: Tolerance,
    progress: Progress,
) -> Parts:
    # Samples of curves prove that parts are needed; those of larger spaces may miss chains, and all
    # are on the path itself.
    formulation = on_path(problem)
    proves = has_curves(formulation) and not problem.relaxations
    allowed_cuts = 0 if proves else _MISSED_CUTS
    refused, chains = None, []
    try:
        segments = ChainSegments.of(formulation, rng, progress)
        chains = segments.fewest(set())
    except NoSequenceError as error:
        if not allowed_cuts:
            raise
        refused = error
    if len(chains) <= 1 + allowed_cuts:
        whole = _whole(problem, rng, tolerance, progress)
        if whole is not None:
            return Parts(problem, (whole,), tolerance=tolerance)
    if refused is not None:
        raise refused
    planner = _PartPlanner(problem, segments, retreats, ramp, rng, tolerance, progress)
    return _best_of(planner, segments, chains)


def _best_of(planner: _PartPlanner, segments: ChainSegments, chains: list[ChainSegment]) -> Parts:
    """Return the parts along chains, or along others where some of these fail."""
    best: Parts | None = None
    forbidden: set[int] = set()
    for _ in range(_ATTEMPTS):
        found, failed = planner.plan(chains)
        if found is not None and (best is None or _standing(found) < _standing(best)):
            best = found
        if failed <= forbidden:
            break
        forbidden |= failed
        try:
            chains = segments.fewest(forbidden)
        except NoSequenceError:
            break
    if best is None:
        raise planner.failure
    return best


def _checked(problem: Problem, retreat: float, axis: npt.ArrayLike | None) -> Array | None:
    check_problem(problem)
    if problem.damping is not None:
        raise ProblemError(
            "damping= leads through what cannot be followed by leaving the path, parts by another "
            "configuration; leave the damping out, or call plan"
        )
    if problem.also:
        raise ProblemError(
            f"{len(problem.follows.items)} frames follow paths at once, which the moves between "
            f"parts would not keep; call plan"
        )
    if problem.follows.redundancy == 0:
        raise ProblemError(
            f"{problem.robot.name}: task '{problem.task.value}' leaves no self-motion to search "
            f"for parts; choose one with fewer rows, or call plan"
        )
    length = as_number(retreat, "retreat", least=0.0)
    given = _BACK if axis is None else axis
    direction = as_numbers(given, "axis", "three finite numbers", (3,))
    if not np.any(direction):
        raise ProblemError("axis is zero, expected a direction in tool axes")
    if axis is not None and length == 0.0:
        raise ProblemError("axis has no effect without a retreat; give retreat=, or leave it out")
    return length * direction / np.linalg.norm(direction) if length > 0.0 else None


def _whole(
    problem: Problem, rng: np.random.Generator | int, tolerance: Tolerance, progress: Progress
) -> Plan | None:
    """Return a verified plan of the whole path, None where none is found."""
    search = Search(rng=rng) if problem.given_start is None else None
    try:
        found = plan(problem, search=search, tolerance=tolerance, progress=progress)
    except (BreakdownError, InverseKinematicsError, NoSequenceError):
        return None
    return found if found.certificate.verified else None


def _standing(parts: Parts) -> tuple[int, int, int]:
    """Return the numbers of parts and moves that are missing or not verified, and of parts."""
    plans = sum(not part.certificate.verified for part in parts.plans)
    moves = sum(not move.verified for move in parts.moves)
    return plans, moves, len(parts.plans)

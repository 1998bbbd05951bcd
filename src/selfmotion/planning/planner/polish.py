"""The best motion near others, by Newton's method on the nodes, and how fine it has to be."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain

import numpy as np

from selfmotion.basics import Array, Ints
from selfmotion.model.motion import Grid, Trajectory
from selfmotion.planning.formulation import BoundConditions, Formulation
from selfmotion.planning.nodes import NodeGrid, NodeMotion, Optimum, Step, minimise
from selfmotion.planning.optimise import Iteration, Status
from selfmotion.planning.planner.effort import Effort
from selfmotion.planning.planner.grids import NOTHING, UNKEPT, most_nodes, with_starts
from selfmotion.planning.planner.solutions import ENDS_MET, NodeSolution
from selfmotion.planning.search import BESIDE
from selfmotion.problem.costs import Cost, JointAcceleration, JointJerk

# Largest path error between nodes [m, rad] …
_NEAR_PATH = 2e-7
# … intervals above which are divided for this one …
_WANTED_NEAR_PATH = 1e-7
# … by this power of the ratio, since the error falls with the third power or more …
_FINER_POWER = 0.3
# … into this number of parts at most.
_MOST_PARTS = 8.0
# Refinement rounds.
_NODE_ROUNDS = 14
# Extra clearance [m] at collocation points when the motion between them collides; tried in turn.
_EXTRA_CLEARANCE = (5e-4, 1e-3, 2e-3)
# Newton iterations from each of several initial guesses: longer ones mostly fail.
_FEWER = 25
# Additional nodes next to rests, as shares of the first and last interval, where no motion is
# feasible: limits little above the mean speed leave little time to start and stop.
_BESIDE_REST = 0.5 ** np.arange(2.0, 5.0)
# Relative gain above which nodes are added where limits of q̈ or jerk start or end to bind.
_PAYS = 3e-4
# Penalty of the use of limits of q̈ or jerk where these are violated, in multiples of the cost.
_SMOOTHING = 1e3
# Refinement rounds of that: with few nodes the Bernstein bound is loose.
_SMOOTHING_ROUNDS = 3
# Cost by order of the limit.
_SMOOTHING_COSTS = {2: JointAcceleration, 3: JointJerk}
# Violation above which a motion is no initial guess [units of h].
_TOO_FAR = 100.0
# Violation that counts as small [units of h].
_LITTLE = 1.0
# Initial guesses where x = 0 fails: the self-motion goes towards the middle of the limits in these
# shares of the duration …
_TOWARDS_MIDDLE = (1.0 / 16.0, 1.0 / 64.0, 1.0 / 4.0)
# … and to either side of the start by these distances along its self-motion [rad or m] …
_SIDEWAYS = (0.4, -0.4, 0.8, -0.8)
# … after this share of the duration …
_SIDEWAYS_AFTER = 1.0 / 4.0
# … of which this number is tried at most.
_MOST_SIDEWAYS = 4

# Statuses of an optimum.
_ARRIVED = (Status.CONVERGED, Status.PRECISION)


class Polisher:
    """Looks for the best motion on nodes near the motions that it is given.

    Parameters
    ----------
    formulation : Formulation
    effort : Effort
    conditions : BoundConditions
    free : bool
        Whether the start may move along its self-motion.

    Attributes
    ----------
    history : list of Iteration
    latest : NodeSolution or None
        The best motion on the way that keeps the conditions: what an interruption leaves.
    is_hopeless : bool
        Whether even what is best freely costs as much as what is known.
    """

    def __init__(
        self,
        formulation: Formulation,
        effort: Effort,
        conditions: BoundConditions,
        *,
        free: bool,
    ) -> None:
        self._formulation, self._effort = formulation, effort
        self._conditions, self._free = conditions, free
        self._first = effort.counts.evaluations
        self.history: list[Iteration] = []
        self.latest: NodeSolution | None = None
        self.is_hopeless = False
        self._ended: Status | None = None

    @property
    def is_stopped(self) -> bool:
        """Whether the callback asked to stop: also where no motion that is found says so."""
        return self._ended is Status.STOPPED

    def end(self, status: Status) -> None:
        """Take motions as they are; there is no time for better ones."""
        self._ended = status

    def grid(self, t: Array) -> NodeGrid:
        """Return nodes at some times."""
        return NodeGrid(
            self._formulation, t, self._conditions, free=self._free, counts=self._effort.counts
        )

    def near(
        self,
        motions: Sequence[Trajectory],
        t: Array,
        cost_to_beat: float = np.inf,
    ) -> NodeSolution | None:
        """Return the best motion near the best of some, on nodes at times t (N + 1,).

        The best is the cheapest of those that keep the conditions, or that hardly break them.

        None where none of them can be had on nodes; see `best_near`.
        """
        # Beside a singular pose the path may be out of reach, by next to nothing.
        beside = t.copy()
        beside[1:-1] += BESIDE * np.diff(t)[1:]
        for times in (t, beside):
            grid = self.grid(times)
            near = [grid.near(*(motion(times, k) for k in range(3))) for motion in motions]
            known = [one for one in near if one is not None]
            if known:
                # One that breaks hardly anything, between other nodes, is as good as kept.
                motion = min(known, key=lambda one: _rank_of(one, known[-1])[-1])
                break
        else:
            return None
        # What an earlier plan has found need not begin far from what binds.
        is_plan = len(motions) > 1 and motion is near[0]
        multipliers = np.zeros(len(motion.h)) if is_plan else None
        return self.best_near(motion, cost_to_beat, multipliers)

    def best_near(
        self, motion: NodeMotion, cost_to_beat: float = np.inf, multipliers: Array | None = None
    ) -> NodeSolution | None:
        """Return the best motion near one of nodes; `multipliers` (R,) of its rows may be known.

        Where that breaks conditions, also near the free optimum, and near motions from its start
        whose self-motion goes towards the middle of the joints' limits; where all do, the one that
        does so least. None where the cost there is not finite, or it would cost more than
        `cost_to_beat`.
        """
        if not np.isfinite(motion.objective):
            return None
        free = None
        if cost_to_beat < np.inf:
            free = self._freely(motion)
            # On the way to an optimum, what it costs says nothing.
            if free.status in _ARRIVED and free.motion.cost >= cost_to_beat:
                # With conditions it would cost more still.
                self.is_hopeless = True
                return None
        if multipliers is None and not _is_kept(motion):
            # One that breaks nothing is at its optimum before this one breaks nothing.
            kept = (begin for begin in self._beginnings(motion) if begin and _is_kept(begin))
            motion = next(kept, motion)
        # What takes long is seldom kept in the end: other beginnings come before the rest of it.
        first = best = minimise(
            motion, self._report, multipliers, roughly=True, max_iterations=_FEWER
        )
        rank = partial(_rank, begun=motion)
        if not _is_kept(best.motion) and self._ended is None:
            best = self._other(motion, best, free)
        unfinished = first.status not in _ARRIVED and self._ended is None
        if unfinished and (best is first or not _is_kept(best.motion)):
            known = best if best.status not in _ARRIVED else first
            rest = self._minimise(known.motion, known.multipliers if best is first else None)
            best = min(best, rest, key=rank)
        if not _is_kept(best.motion) and self._ended is None:
            # What control points of few nodes cannot keep, the curve may.
            best = min(best, self._on_halved(best), key=rank)
        if not _is_kept(best.motion) and self.latest is not None:
            # What keeps them on the way is never given up for what is cheaper and does not.
            last, ends = self.latest.motion, np.zeros(motion.grid.ends.count)
            best = Optimum(last, np.zeros(len(last.h)), Status.PRECISION, np.inf, ends)
        return self._solution(best)

    def with_more(self, known: NodeSolution) -> NodeSolution | None:
        """Return the best motion near one of which less was asked, the rest after that; or None."""
        motion = self.grid(known.motion.grid.t).at(known.motion.centred)
        more = len(motion.h) - len(known.multipliers)
        found = self.best_near(motion, multipliers=np.append(known.multipliers, np.zeros(more)))
        return None if found is None or found.violations else found

    def _freely(self, motion: NodeMotion) -> Optimum:
        """Return the optimum near a motion of which nothing is asked but ends and tolerances."""
        alone = motion.grid.without_rows().at(motion.centred)
        # Whether these keep the conditions is not known.
        return minimise(alone, self._noted, roughly=True)

    def _other(self, begun: NodeMotion, first: Optimum, free: Optimum | None) -> Optimum:
        """Return the best of the optima from other beginnings, the first, and the free one."""
        open_one = begun.grid.at((free or self._freely(begun)).motion.centred)
        ends, none = begun.grid.ends.count, np.zeros(len(open_one.h))
        unbound = Optimum(open_one, none, Status.INFEASIBLE, np.inf, np.zeros(ends))
        rank = partial(_rank, begun=begun)
        best = min(first, unbound, key=rank)
        # Where that breaks little it is nearest; else the calmest motion is.
        near = [[open_one], self._calm(open_one)]
        if open_one.violation > _LITTLE:
            near.reverse()
        for begin in chain(*near, self._beginnings(begun), self._aside(begun)):
            if begin is not None and begin.violation <= _TOO_FAR:
                found = minimise(begin, self._report, roughly=True, max_iterations=_FEWER)
                best = min(best, found, key=rank)
            if self._ended is not None or _is_kept(best.motion):
                break
        return best

    def _calm(self, begun: NodeMotion) -> Iterator[NodeMotion]:
        """Yield the motion that uses least of the limits that one breaks, by squares."""
        costs = self._costs_of_limits(begun)
        if not costs:
            return
        formulation, motion = self._formulation.with_costs(costs), begun
        for number in range(_SMOOTHING_ROUNDS):
            ends = BoundConditions(ends=motion.grid.conditions.ends)
            counts = self._effort.counts
            grid = NodeGrid(formulation, motion.grid.t, ends, free=self._free, counts=counts)
            found = minimise(
                grid.at(motion.centred), self._noted, roughly=True, max_iterations=_FEWER
            )
            motion = motion.grid.at(found.motion.centred)
            if _is_kept(motion) or number == _SMOOTHING_ROUNDS - 1:
                yield motion
                return
            finer = motion.on(motion.grid.on(Grid(motion.grid.t).halved().nodes))
            if finer is None:
                return
            motion = finer

    def _costs_of_limits(self, begun: NodeMotion) -> tuple[Cost, ...]:
        """Return what uses of the limits of q̈ and jerk that a motion breaks cost; none for none."""
        grid, formulation = begun.grid, self._formulation
        found, most = list[Cost](), _SMOOTHING * abs(begun.objective) / formulation.path.duration
        residuals = grid.rows.by_kind(begun.h)[0]
        for item, h in zip(grid.conditions.limits, residuals, strict=True):
            if item.order in _SMOOTHING_COSTS and (h > 0.0).any():
                weight = np.zeros(formulation.robot.dof)
                weight[item.joints] = most / (0.5 * (item.upper - item.lower)) ** 2
                found.append(_SMOOTHING_COSTS[item.order](weight, name=item.name))
        return (*formulation.costs, *found) if found else ()

    def _beginnings(self, begun: NodeMotion) -> Iterator[NodeMotion | None]:
        """Yield motions that go to where they have to end, and towards the middle of the limits."""
        grid, start = begun.grid, begun.place.q[0]
        if grid.ends.last is not None:
            yield grid.motion_towards(start, grid.ends.last)
        if self._free:
            return
        own = self._formulation.coordinates
        limited = np.isfinite(own.lower) & np.isfinite(own.upper)
        middle = start.copy()
        middle[limited] = 0.5 * (own.lower[limited] + own.upper[limited])
        for share in _TOWARDS_MIDDLE:
            yield grid.motion_towards(start, middle, share * self._formulation.path.duration)

    def _aside(self, begun: NodeMotion) -> Iterator[NodeMotion]:
        """Yield motions that go to either side along their self-motion, what breaks least first.

        Past bodies there are several ways, and no step leads from one to another.
        """
        if self._free:
            return
        grid, start = begun.grid, begun.place.q[0]
        time = _SIDEWAYS_AFTER * self._formulation.path.duration
        goals = [start + far * way for way in begun.charts.bases[0].T for far in _SIDEWAYS]
        found = [grid.motion_towards(start, goal, time) for goal in goals]
        rank = partial(_rank_of, begun=begun)
        yield from sorted((motion for motion in found if motion), key=rank)[:_MOST_SIDEWAYS]

    def _on_halved(self, optimum: Optimum) -> Optimum:
        """Return the optimum on twice as many nodes, more beside rest, or what there is."""
        t = optimum.motion.grid.t
        ends = t[0] + (t[1] - t[0]) * _BESIDE_REST, t[-1] - (t[-1] - t[-2]) * _BESIDE_REST
        beside = [own for rest, own in zip(self._formulation.rests, ends, strict=True) if rest]
        finer = np.unique(np.concatenate([Grid(t).halved().nodes, *beside]))
        motion = optimum.motion.on(optimum.motion.grid.on(finer))
        return optimum if motion is None else self._minimise(motion)

    def again(self, known: NodeSolution, *, roughly: bool = False) -> NodeSolution | None:
        """Return the optimum near a motion on its nodes; None where that breaks conditions."""
        optimum = self._minimise(known.motion, known.multipliers, roughly=roughly)
        return self._solution(optimum) if _is_kept(optimum.motion) else None

    def settled(self, known: NodeSolution) -> NodeSolution:
        """Return the optimum on nodes so near to each other that more change nothing.

        The curve is on its path between them, control points give hardly anything away, and what
        is asked at points holds between them.
        """
        found = self._resolved(known)
        return self._farther_apart(found) or found

    def _resolved(self, known: NodeSolution) -> NodeSolution:
        """Return the optimum on nodes so near to each other that more change nothing, if it may."""
        before, most, is_rough = np.inf, most_nodes(self._formulation), True
        for _ in range(_NODE_ROUNDS):
            if self._ended is not None:
                break
            t = self._finer(known)
            if before - known.cost > _PAYS * abs(known.cost):
                # Where limits of q̈ or jerk begin and end to bind, the best motion has a kink: finer
                # there, while it pays.
                kinks, before = _at_kinks(known.motion), known.cost
                if kinks is not None:
                    t = kinks if t is None else np.union1d(t, kinks)
            finer = None if t is None or len(t) > most else known.on(t)
            polishes = finer is None
            if polishes and not is_rough:
                break
            found = self.again(finer or known, roughly=not polishes)
            if found is None:
                break
            gains = known.cost - found.cost > NOTHING * abs(known.cost)
            if not (found.has_arrived or gains) and self._ended is None:
                # More nodes lead nowhere, and multipliers on the way say nothing.
                again = None if polishes else self.again(known)
                if again is not None and again.has_arrived:
                    return again
                # Between few nodes it may be off the path: there, what is on the way will do.
                errors = self._formulation.errors_between(known.motion.trajectory)
                off = not polishes and again is None and errors.max() > _NEAR_PATH
                return found if off else known
            known, is_rough = found.after(known.cost), not polishes
        return known

    def _farther_apart(self, known: NodeSolution) -> NodeSolution | None:
        """Return a motion on its nodes that keeps between them what it breaks there; or None.

        Beside corners of bodies more nodes may lead nowhere: on these, bodies are kept farther
        apart at the points.
        """
        grid = known.motion.grid
        own = grid.conditions
        has_bodies = any(item.stricter(0.0) is not None for item in own.points)
        if self._ended is not None or not (has_bodies and known.motion.broken_intervals().any()):
            return None
        for far in _EXTRA_CLEARANCE:
            points = tuple(item.stricter(far) or item for item in own.points)
            stricter = grid.with_conditions(own._replace(points=points))
            optimum = self._minimise(stricter.at(known.motion.centred))
            found = replace(optimum, motion=grid.at(optimum.motion.centred))
            if _is_kept(found.motion) and not found.motion.broken_intervals().any():
                return self._solution(found)
        return None

    def _finer(self, known: NodeSolution) -> Array | None:
        """Return times of nodes near enough to each other, or None where these are."""
        motion = known.motion
        grid, spline = motion.grid, motion.grid.spline
        errors = self._formulation.errors_between(motion.trajectory).max(axis=1)
        # Where one is too far apart, so is what is nearly so: on the next nodes it would be.
        wanted = _WANTED_NEAR_PATH if errors.max() > _NEAR_PATH else _NEAR_PATH
        parts = np.ceil((errors / wanted) ** _FINER_POWER - 1e-9)
        parts = np.clip(parts, 1.0, _MOST_PARTS).astype(int)
        away = grid.rows.conservatism(known.multipliers, motion.curve_ends)
        least = NOTHING * abs(motion.objective)
        if away.sum() > least:
            parts[(away > least / spline.count) & (parts == 1)] = 2
        parts = np.maximum(parts, motion.subdivisions())
        t = spline.t if (parts == 1).all() else _divided(spline.t, parts)
        if motion.quickness < grid.quick:
            t = with_starts(self._formulation, t, motion.quickness)
        return t if len(t) > len(spline.t) else None

    def _minimise(
        self, motion: NodeMotion, multipliers: Array | None = None, *, roughly: bool = True
    ) -> Optimum:
        return minimise(motion, self._report, multipliers, roughly=roughly)

    def _report(self, step: Step) -> bool:
        """Note an iteration, and the motion if it keeps all; return whether to stop."""
        if _is_kept(step.motion) and self._is_better(step.motion):
            self.latest = NodeSolution.on_the_way(step.motion)
        return self._noted(step)

    def _is_better(self, motion: NodeMotion) -> bool:
        """Whether a motion costs less than the last one, or tells more."""
        if self.latest is None:
            return True
        last = self.latest.motion
        return len(motion.grid.t) > len(last.grid.t) or motion.objective < last.objective

    def _noted(self, step: Step) -> bool:
        """Note an iteration; return whether to stop."""
        effort, motion = self._effort, step.motion
        iteration = Iteration(
            x=motion.nu.ravel(),
            cost=motion.cost,
            gradient_norm=step.slope,
            update="newton",
            step=step.length,
            evaluations=effort.counts.evaluations,
        )
        self.history.append(iteration)
        # Who has asked to stop is asked no more.
        asked = effort.callback if self._ended is None else None
        if asked is not None and asked(iteration):
            self._ended = Status.STOPPED
        most = effort.max_evaluations
        if most is not None and effort.counts.evaluations >= self._first + most:
            self._ended = Status.MAX_EVALUATIONS
        return self._ended is not None

    def _solution(self, optimum: Optimum) -> NodeSolution:
        status = optimum.status
        if optimum.motion.elsewhere:
            status = Status.INFEASIBLE
        elif status not in (*_ARRIVED, Status.GRADIENT):
            # What keeps the conditions, and leads no further, is as good as it gets.
            status = Status.PRECISION if _is_kept(optimum.motion) else Status.INFEASIBLE
        return NodeSolution.of(optimum, self._ended or status)


def _is_kept(motion: NodeMotion) -> bool:
    """Whether all conditions are kept."""
    # Written so that NaN is not.
    ends = np.abs(motion.c).max(initial=0.0) <= ENDS_MET and not motion.elsewhere
    return bool(motion.violation <= 0.0 and ends)


def _rank(optimum: Optimum, begun: NodeMotion) -> tuple[bool, bool, float]:
    """Return what sorts optima, the smaller the better.

    What is broken counts as so many times the cost of the motion that all `begun` with, for a unit
    or for all that this one breaks: where nothing can be kept, not at any price.
    """
    return _rank_of(optimum.motion, begun)


def _rank_of(motion: NodeMotion, begun: NodeMotion) -> tuple[bool, bool, float]:
    """Return what sorts motions; see `_rank`."""
    most = UNKEPT * abs(begun.objective)
    if _is_kept(motion):
        return False, False, motion.objective
    of_all = min(1.0, _unmet(begun)) or 1.0
    return True, motion.objective > most, motion.objective + most * _unmet(motion) / of_all


def _unmet(motion: NodeMotion) -> float:
    """Return by how much conditions are broken."""
    far = max(motion.elsewhere.values(), default=0.0)
    return motion.violation + float(np.abs(motion.c).max(initial=0.0)) + far


def _divided(t: Array, parts: Ints) -> Array:
    """Return times (N + 1,) with each interval in so many equal parts, (N,)."""
    first = np.repeat(np.cumsum(parts) - parts, parts)
    share = (np.arange(parts.sum()) - first) / np.repeat(parts, parts)
    inner = np.repeat(t[:-1], parts) + share * np.repeat(np.diff(t), parts)
    return np.append(inner, t[-1])


def _at_kinks(motion: NodeMotion) -> Array | None:
    """Return times with more nodes where limits of q̈ or jerk begin or end to bind, or None."""
    where = motion.grid.rows.kinks(motion.curve_ends)
    if not where.any():
        return None
    wide = np.convolve(where, np.ones(3), "same") > 0.0
    return _divided(motion.grid.t, 1 + wide)

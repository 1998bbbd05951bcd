"""The best motion near others, by Newton's method on the nodes."""

from collections.abc import Sequence
from functools import partial
from itertools import chain

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.motion import Grid, Trajectory
from selfmotion.planning.formulation import BoundConditions, Formulation
from selfmotion.planning.nodes import (
    SETTINGS,
    NodeGrid,
    NodeMotion,
    Optimum,
    centred,
    minimise,
    on_grid,
)
from selfmotion.planning.optimise import Status
from selfmotion.planning.planner.effort import Effort
from selfmotion.planning.planner.first_motions import (
    FEWER_ITERATIONS,
    sideways,
    smoothest,
    towards_ends_and_middle,
)
from selfmotion.planning.planner.guess import Guess
from selfmotion.planning.planner.outcomes import ARRIVED, NodeOutcome, is_kept, rank_of
from selfmotion.planning.planner.recorder import Recorder
from selfmotion.planning.search import TIME_SHIFT

# Additional nodes next to rests, as shares of the first and last interval, where no motion is
# feasible: limits little above the mean speed leave little time to start and stop.
_BESIDE_REST = 0.5 ** np.arange(2.0, 5.0)
# Violation above which a motion is no initial guess [units of h].
_TOO_FAR = 100.0
# Violation that counts as small [units of h].
_LITTLE = 1.0


class LocalSearch:
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
    formulation : Formulation
    recorder : Recorder
    is_hopeless : bool
        Whether even the optimum without conditions costs as much as what is known.
    """

    def __init__(
        self,
        formulation: Formulation,
        effort: Effort,
        conditions: BoundConditions,
        *,
        free: bool,
    ) -> None:
        self.formulation, self.recorder = formulation, Recorder(effort)
        self._counts, self._conditions, self._free = effort.counts, conditions, free
        self.is_hopeless = False

    @classmethod
    def of(cls, guess: Guess) -> "LocalSearch":
        """Return that of an initial guess."""
        return cls(guess.formulation, guess.effort, guess.conditions, free=guess.free)

    def grid(self, t: Array) -> NodeGrid:
        """Return nodes at some times."""
        return NodeGrid(self.formulation, t, self._conditions, free=self._free, counts=self._counts)

    def near(
        self,
        motions: Sequence[Trajectory],
        t: Array,
        cost_to_beat: float = np.inf,
    ) -> NodeOutcome | None:
        """Return the best motion near the best of some, on nodes at times t (N + 1,).

        The best is the cheapest of those that keep the conditions, or that hardly break them.

        None where none of them can be had on nodes; see `best_near`.
        """
        # Beside a singular pose the path may be out of reach, by next to nothing.
        beside = t.copy()
        beside[1:-1] += TIME_SHIFT * np.diff(t)[1:]
        for times in (t, beside):
            grid = self.grid(times)
            near = [grid.near(*(motion(times, k) for k in range(3))) for motion in motions]
            known = [one for one in near if one is not None]
            if known:
                # One that breaks hardly anything, between other nodes, is as good as kept.
                motion = min(known, key=lambda one: rank_of(one, known[-1])[-1])
                break
        else:
            return None
        # What an earlier plan has found need not begin far from what binds.
        is_plan = len(motions) > 1 and motion is near[0]
        multipliers = np.zeros(len(motion.h)) if is_plan else None
        return self.best_near(motion, cost_to_beat, multipliers)

    def best_near(
        self, motion: NodeMotion, cost_to_beat: float = np.inf, multipliers: Array | None = None
    ) -> NodeOutcome | None:
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
            if free.status in ARRIVED and free.motion.cost >= cost_to_beat:
                # With conditions it would cost more still.
                self.is_hopeless = True
                return None
        if multipliers is None and not is_kept(motion):
            # One that breaks nothing is at its optimum before this one breaks nothing.
            kept = (begin for begin in towards_ends_and_middle(motion) if begin and is_kept(begin))
            motion = next(kept, motion)
        # What takes long is seldom kept in the end: other beginnings come before the rest of it.
        first = best = self.minimise(motion, multipliers, most=FEWER_ITERATIONS)
        rank = partial(_rank, begun=motion)
        if not is_kept(best.motion) and self.recorder.ended is None:
            best = self._other(motion, best, free)
        unfinished = first.status not in ARRIVED and self.recorder.ended is None
        if unfinished and (best is first or not is_kept(best.motion)):
            known = best if best.status not in ARRIVED else first
            rest = self.minimise(known.motion, known.multipliers if best is first else None)
            best = min(best, rest, key=rank)
            if not is_kept(best.motion) and rest.status not in ARRIVED:
                again = self.minimise(best.motion, mu_first=SETTINGS.mu_again)
                best = min(best, again, key=rank)
        if not is_kept(best.motion) and self.recorder.ended is None:
            # What control points of few nodes cannot keep, the curve may.
            best = min(best, self._on_halved(best), key=rank)
        if not is_kept(best.motion) and self.recorder.latest is not None:
            # What keeps them on the way is never given up for what is cheaper and does not.
            last, ends = self.recorder.latest.motion, np.zeros(motion.grid.ends.count)
            best = Optimum(last, np.zeros(len(last.h)), Status.PRECISION, np.inf, ends, True)
        return self.outcome(best)

    def with_more(self, known: NodeOutcome) -> NodeOutcome | None:
        """Return the best motion near one with fewer conditions, the first of these, or None."""
        motion = self.grid(known.motion.grid.t).at(centred(known.motion))
        more = len(motion.h) - len(known.multipliers)
        found = self.best_near(motion, multipliers=np.append(known.multipliers, np.zeros(more)))
        return None if found is None or found.violations else found

    def _freely(self, motion: NodeMotion) -> Optimum:
        """Return the optimum near a motion without conditions but those on ends and tolerances."""
        alone = motion.grid.without_rows().at(centred(motion))
        # Whether these keep the conditions is not known.
        return minimise(alone, self.recorder.note, roughly=True)

    def _other(self, begun: NodeMotion, first: Optimum, free: Optimum | None) -> Optimum:
        """Return the best of the optima from other beginnings, the first, and the free one."""
        open_one = begun.grid.at(centred((free or self._freely(begun)).motion))
        ends, none = begun.grid.ends.count, np.zeros(len(open_one.h))
        unbound = Optimum(open_one, none, Status.INFEASIBLE, np.inf, np.zeros(ends), True)
        rank = partial(_rank, begun=begun)
        best = min(first, unbound, key=rank)
        # Where that breaks little it is nearest; else the calmest motion is.
        near = [[open_one], smoothest(open_one, self.recorder)]
        if open_one.violation > _LITTLE:
            near.reverse()
        for begin in chain(*near, towards_ends_and_middle(begun), sideways(begun)):
            if begin is not None and begin.violation <= _TOO_FAR:
                found = minimise(
                    begin, self.recorder.report, roughly=True, max_iterations=FEWER_ITERATIONS
                )
                best = min(best, found, key=rank)
            if self.recorder.ended is not None or is_kept(best.motion):
                break
        return best

    def _on_halved(self, optimum: Optimum) -> Optimum:
        """Return the optimum on twice as many nodes, more beside rest, or what there is."""
        t = optimum.motion.grid.t
        ends = t[0] + (t[1] - t[0]) * _BESIDE_REST, t[-1] - (t[-1] - t[-2]) * _BESIDE_REST
        beside = [
            own
            for rest, own in zip(self.formulation.problem.rest_orders, ends, strict=True)
            if rest
        ]
        finer = np.unique(np.concatenate([Grid(t).halved().nodes, *beside]))
        motion = on_grid(optimum.motion, optimum.motion.grid.on(finer))
        return optimum if motion is None else self.minimise(motion)

    def again(self, known: NodeOutcome, *, roughly: bool = False) -> NodeOutcome | None:
        """Return the optimum near a motion on its nodes; None where that breaks conditions."""
        optimum = self.minimise(known.motion, known.multipliers, roughly=roughly)
        return self.outcome(optimum) if is_kept(optimum.motion) else None

    def minimise(
        self,
        motion: NodeMotion,
        multipliers: Array | None = None,
        *,
        roughly: bool = True,
        most: int = SETTINGS.max_iterations,
        mu_first: float = SETTINGS.mu_first,
    ) -> Optimum:
        """Return the optimum near a motion; `multipliers` (R,) of its rows may be known."""
        report = self.recorder.report
        return minimise(
            motion, report, multipliers, roughly=roughly, max_iterations=most, mu_first=mu_first
        )

    def outcome(self, optimum: Optimum) -> NodeOutcome:
        """Return a result of Newton's method as an outcome."""
        status = optimum.status
        if optimum.motion.elsewhere:
            status = Status.INFEASIBLE
        elif status not in (*ARRIVED, Status.GRADIENT):
            # What keeps the conditions, and leads no further, is as good as it gets.
            status = Status.PRECISION if is_kept(optimum.motion) else Status.INFEASIBLE
        return NodeOutcome.of(optimum, self.recorder.ended or status)


def _rank(optimum: Optimum, begun: NodeMotion) -> tuple[bool, bool, float]:
    """Return the sort key of optima, see `rank_of`."""
    return rank_of(optimum.motion, begun)

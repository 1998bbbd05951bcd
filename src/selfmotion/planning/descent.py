"""From a motion to the best one near it: freely as long as conditions are kept, then with them."""

from dataclasses import replace

import numpy as np

from selfmotion.basics import Array
from selfmotion.engine import Objective
from selfmotion.optimise import Iteration, Minimum, SequentialQuadratic, Status
from selfmotion.planning.effort import Effort
from selfmotion.planning.settings import LEAST_SAVING
from selfmotion.planning.standing import RolledMotion


def breaks(objective: Objective, x: Array) -> bool:
    """Whether a condition is violated at x; not where there is no motion."""
    return np.isfinite(objective.value(x)) and not objective.conditions(x).worst <= 1.0


class Descent:
    """Minimises one objective after another, all from one start.

    Parameters
    ----------
    effort : Effort

    Attributes
    ----------
    before : int
        Evaluations of the cost before this start.
    history : list of Iteration
    bound : bool
        Whether conditions count: until then none was met on the way.
    """

    def __init__(self, effort: Effort) -> None:
        self._effort, self.before = effort, effort.counts.evaluations
        self.history: list[Iteration] = []
        self.bound = False

    def descended(
        self, rolled: RolledMotion, *, evaluations: int | None = None, restores: bool = True
    ) -> RolledMotion:
        """Return the minimum near a motion; what binds there, `priced` knows.

        By the optimiser as long as conditions are kept; with them from there.

        Parameters
        ----------
        rolled : RolledMotion
        evaluations : int, optional
            So many of the cost; by default what `Effort` allows.
        restores : bool
            Whether to go on elsewhere where conditions cannot be met.
        """
        objective, before = rolled.objective, rolled.minimum
        known = None if before is None else before.inverse_hessian
        minimum = self._minimum(objective, rolled.x, known, self._limit(evaluations), restores)
        return replace(rolled, minimum=minimum, x=np.array(minimum.x), active=())

    def priced(self, rolled: RolledMotion) -> RolledMotion:
        """Return a minimum with what binds there."""
        minimum = rolled.minimum
        if minimum is None or not self.bound or minimum.status is not Status.CONVERGED:
            return rolled
        constraints = rolled.objective.constraints
        samples = rolled.objective.samples(minimum.x)
        least = LEAST_SAVING * abs(minimum.cost)
        return replace(rolled, active=constraints.active(samples, minimum.multipliers, least))

    def _minimum(
        self,
        objective: Objective,
        x: Array,
        inverse_hessian: Array | None,
        limit: int | None,
        restores: bool,
    ) -> Minimum:
        if self.bound or breaks(objective, x):
            return self._bound_minimum(objective, x, inverse_hessian, limit, restores)
        effort = self._effort
        kept: list[Iteration] = []
        asked = False

        def note(iteration: Iteration) -> bool:
            nonlocal asked
            if breaks(objective, iteration.x):
                return True
            kept.append(iteration)
            asked = effort.callback is not None and bool(effort.callback(iteration))
            return asked

        minimum = effort.optimizer.minimize(
            objective, x, inverse_hessian, max_evaluations=limit, callback=note
        )
        self.history += kept
        ended = asked or minimum.status in (Status.INTERRUPTED, Status.MAX_EVALUATIONS)
        if ended or not breaks(objective, minimum.x):
            return minimum
        # The last point that kept all: the one after it may be anywhere.
        last = np.array(kept[-1].x) if kept else x
        return self._bound_minimum(
            objective, last, inverse_hessian, limit, restores, known=len(kept) > 0
        )

    def _bound_minimum(
        self,
        objective: Objective,
        x: Array,
        inverse_hessian: Array | None,
        limit: int | None,
        restores: bool,
        *,
        known: bool = False,
    ) -> Minimum:
        """Minimise where conditions count; `known` says that the callback was told the start."""
        effort, first = self._effort, known

        def note(iteration: Iteration) -> bool:
            nonlocal first
            repeated, first = first, False
            return not repeated and effort.callback is not None and bool(effort.callback(iteration))

        self.bound = True
        method = SequentialQuadratic() if restores else SequentialQuadratic(restorations=0)
        minimum = method.minimize(
            objective, x, inverse_hessian, max_evaluations=limit, callback=note
        )
        self.history += minimum.history[1 if known else 0 :]
        return minimum

    def _limit(self, evaluations: int | None) -> int | None:
        effort = self._effort
        if evaluations is not None:
            return effort.counts.evaluations + evaluations
        if effort.max_evaluations is None:
            return None
        # At least one more, so that there is something to show.
        return max(self.before + effort.max_evaluations, effort.counts.evaluations + 1)

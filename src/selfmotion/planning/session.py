"""One start of one problem, optimised on a grid that becomes finer."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array
from selfmotion.engine import (
    MOST_HALVINGS,
    Counts,
    Evaluation,
    Guide,
    Objective,
    StillMotion,
    settled_still_motion,
)
from selfmotion.optimise import Callback, Iteration, Minimum, Optimizer, Status
from selfmotion.plans import Problem

# Agreement of the cost on a grid and on the halved one, at which the coarser optimum stands.
_COST_AGREEMENT = 1e-4
# A cost that rises this much on two grids in turn has no limit.
_RISE, _RISES = 1.5, 2
# The first round of the augmented Lagrangian is minimised this much more coarsely.
_FIRST_COARSENESS = 1e4
# Rounds of the augmented Lagrangian. What has not fallen to this share in so many of them, while
# penalties grew tenfold in each, does not fall any more.
_ROUNDS, _STUCK_ROUNDS, _STUCK = 12, 4, 0.9
# Equalities are met to this [rad, rad/s], which Newton's method needs a few steps for.
_CLOSED, _CLOSING_STEPS = 1e-11, 12
# After these the user has no more time to give.
_CUT_SHORT = (Status.INTERRUPTED, Status.STOPPED, Status.MAX_EVALUATIONS)


@dataclass(frozen=True)
class Effort:
    """What the sessions of a plan share.

    Attributes
    ----------
    optimizer : Optimizer
    callback : callable or None
        Called with each `Iteration`.
    max_evaluations : int or None
        Limit on evaluations of each session.
    counts : Counts
        Where work is added up.
    apart : bool
        Whether the optimisation keeps the arm apart from itself where only the default asks for it.
    """

    optimizer: Optimizer
    callback: Callback | None
    max_evaluations: int | None
    counts: Counts
    apart: bool = False


class Session:
    """The optimisation from one start; made by `Session.begin`.

    Parameters
    ----------
    effort : Effort
    still : StillMotion
        The motion at x = 0.
    objective : Objective
    free : bool
        Whether the start may move along its self-motion.

    Attributes
    ----------
    history : list of Iteration
    violations : tuple of str
        What is wrong for each constraint that the last minimisation could not meet.
    """

    def __init__(
        self, effort: Effort, still: StillMotion, objective: Objective, *, free: bool
    ) -> None:
        self._effort, self._still, self._free = effort, still, free
        self._objective = objective
        self._before = effort.counts.evaluations
        self._minimum: Minimum | None = None
        self._ended: Status | None = None
        # Whether the last motion kept all constraints: so far none is known to be active.
        self._feasible = True
        self._x = np.zeros(objective.size)
        self.history: list[Iteration] = []
        self.violations: tuple[str, ...] = ()

    @classmethod
    def begin(
        cls,
        problem: Problem,
        effort: Effort,
        configuration: Array,
        *,
        free: bool,
        guide: Guide | None = None,
    ) -> "Session":
        """Integrate the motion at x = 0 from a start, and return the session around it.

        Parameters
        ----------
        problem : Problem
        effort : Effort
        configuration : (n,)
            The start.
        free : bool
            Whether the start may move along its self-motion.
        guide : Guide, optional
            The null motion that stands for x = 0: where the search found one worth starting from.

        Raises
        ------
        BreakdownError
            The motion at x = 0 runs into a singular pose.
        """
        still, jacobians = settled_still_motion(problem, configuration, guide)
        effort.counts.jacobians += jacobians
        bound = problem.bind_constraints(configuration, still.end, apart=effort.apart)
        objective = Objective.of(problem, still, free=free, constraints=bound, counts=effort.counts)
        return cls(effort, still, objective, free=free)

    @property
    def counts(self) -> Counts:
        """Work done by all sessions of the plan."""
        return self._effort.counts

    @property
    def status(self) -> Status:
        """How the last minimisation ended, or what ended the session."""
        if self._ended is not None:
            return self._ended
        return Status.STOPPED if self._minimum is None else self._minimum.status

    @property
    def cut_short(self) -> bool:
        """Whether the user wants no more."""
        return self.status in (Status.INTERRUPTED, Status.STOPPED)

    def end(self, status: Status) -> None:
        """Take the motion as it is; there is no time for another one."""
        self._ended = status
        self.violations = self._objective.violations(self._x)

    @property
    def coefficients(self) -> Array:
        """The null motion's coefficients."""
        return self._objective.parts(self._x)[1].copy()

    def motion(self) -> Evaluation:
        """Return the motion as it is now."""
        return self._objective.at(self._x)

    def still_motion(self) -> Evaluation:
        """Return the motion at x = 0 on the present grid."""
        return self._objective.at(np.zeros_like(self._x))

    def initial_score(self) -> float:
        """Return the cost of x = 0, much larger where constraints are violated: for ranking."""
        objective, x = self._objective, np.zeros_like(self._x)
        objective.conditions.start(objective.samples(x), sum(objective.terms(x).values()))
        return objective.value(x)

    def score(self) -> tuple[bool, float]:
        """Return whether constraints are violated, then the cost: the smaller, the better."""
        return bool(self.violations), self._cost()

    def minimize(self) -> None:
        """Optimise on the present grid: rounds of the augmented Lagrangian until all is kept."""
        objective = self._objective
        conditions = objective.conditions
        conditions.start(objective.samples(self._x), self._cost())
        worst: list[float] = []
        for round_number in range(_ROUNDS):
            self._minimum = self._round(round_number)
            self._x = np.array(self._minimum.x)
            kept = conditions.update(objective.samples(self._x))
            if (kept and self._feasible) or self.status in _CUT_SHORT:
                break
            self._feasible = kept
            worst.append(conditions.worst)
            if round_number >= _STUCK_ROUNDS and worst[-1] > _STUCK * worst[-1 - _STUCK_ROUNDS]:
                break
        self._close()
        self.violations = objective.violations(self._x)

    def refine_until_settled(self) -> None:
        """Optimise on halved grids until the cost agrees."""
        rises = 0
        for _ in range(MOST_HALVINGS):
            if self.status in _CUT_SHORT:
                return
            unmet, before = self.score()
            self.refine()
            after = self._cost()
            error = abs(after - before)
            # A cost that grows and grows, and what two grids in turn could not meet: the path runs
            # past the edge of the workspace between their nodes, or limits are too tight.
            rises = rises + 1 if after > _RISE * abs(before) else 0
            if rises == _RISES:
                return
            self.minimize()
            if error <= _COST_AGREEMENT * abs(before) or (unmet and self.violations):
                return

    def refine(self) -> None:
        """Go on with half the step length."""
        coarse = self._objective
        grid = coarse.grid.halved()
        self._objective = Objective.of(
            self._still.problem,
            self._still,
            grid=grid,
            free=self._free,
            conditions=coarse.conditions.refined(grid),
            counts=self._effort.counts,
        )
        self._close()

    def _cost(self) -> float:
        return sum(self._objective.terms(self._x).values())

    def _round(self, number: int) -> Minimum:
        """Minimise with the present multipliers; the estimate of H is that of a coarser grid."""
        effort, before = self._effort, self._minimum
        # New multipliers change the curvature, a finer grid hardly does.
        h = None if before is None or number > 0 else before.inverse_hessian
        # While multipliers are still far off, minimising to the last digit is lost work.
        coarseness = 1.0 if self._feasible else max(_FIRST_COARSENESS * 0.1**number, 1.0)
        limit = None
        if effort.max_evaluations is not None:
            # At least one more, so that there is something to show.
            used_up = self._before + effort.max_evaluations
            limit = max(used_up, effort.counts.evaluations + 1)
        minimum = effort.optimizer.minimize(
            self._objective,
            self._x,
            h,
            coarseness=coarseness,
            max_evaluations=limit,
            callback=effort.callback,
        )
        self.history += minimum.history
        return minimum

    def _close(self) -> None:
        """Meet the equalities to rounding by Newton's method.

        The step is the smallest in the metric of H⁻¹ that takes out the residual, so that it
        hardly changes the cost: -H Gᵀ(G H Gᵀ)⁻¹ h with G = ∂h/∂x.
        """
        objective, conditions = self._objective, self._objective.conditions
        if not conditions.has_equalities or self._minimum is None:
            return
        h = self._minimum.inverse_hessian
        best, x, nearest = self._x, self._x, np.inf
        for _ in range(_CLOSING_STEPS):
            if not np.isfinite(sum(objective.terms(x).values())):
                break
            tangents = objective.node_tangents(x)
            residual, rows = conditions.equalities(objective.samples(x), tangents)
            miss = float(np.max(np.abs(residual), initial=0.0))
            # Conditions that contradict each other, or are out of reach, are not met by more steps.
            if not miss < nearest:
                break
            best, nearest = x, miss
            if miss < _CLOSED:
                break
            spread = h @ rows.T
            # Least squares: conditions may depend on each other.
            x = x - spread @ np.linalg.lstsq(rows @ spread, residual)[0]
        self._x = best

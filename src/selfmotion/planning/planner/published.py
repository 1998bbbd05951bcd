"""The published method from an initial guess; the only place where the planner calls it."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar, Self

import numpy as np

from selfmotion.basics import Array, BreakdownError, Flags
from selfmotion.model.motion import (
    FreeNullMotion,
    NullMotionTable,
    PolynomialNullMotion,
    Trajectory,
)
from selfmotion.model.robot import null_space
from selfmotion.planning.formulation import (
    BoundConditions,
    Formulation,
    keeps_off_itself,
    sampled,
)
from selfmotion.planning.optimise import Optimizer, Status
from selfmotion.planning.paper import MethodInputs, Objective, PublishedMotion, parts_of
from selfmotion.planning.planner.guess import Guess, pace_of
from selfmotion.planning.planner.outcomes import OutcomeFacts
from selfmotion.planning.planner.solution import Solution
from selfmotion.problem.constraints import BoundConstraint, penalised, violated
from selfmotion.problem.costs import Samples


@dataclass(frozen=True, eq=False)
class PublishedOutcome(PublishedMotion):
    """A motion of the published method, optimised.

    Attributes
    ----------
    conditions : BoundConditions
        Judged, not required.
    """

    conditions: BoundConditions = field(default_factory=BoundConditions)
    breaks_at: ClassVar[float | None] = None

    @property
    def _evaluated(self) -> Iterator[tuple[BoundConstraint, Samples]]:
        motion = sampled(self.method.formulation, self.objective.samples(self.x))
        return motion.with_conditions(self.conditions.every)

    @cached_property
    def violations(self) -> tuple[str, ...]:
        """Violations, one for each constraint."""
        return violated(self._evaluated)

    @cached_property
    def keeps_off_itself(self) -> bool:
        """Whether the default clearance from itself holds, at the nodes and by meshes."""
        return keeps_off_itself(self.method.formulation, self.nodes)

    def merit(self) -> float:
        """Return the cost, much larger where constraints are violated: for ranking."""
        return penalised(self.cost, self._evaluated) if np.isfinite(self.cost) else np.inf

    def facts(self) -> OutcomeFacts:
        """Return what a report says of it: constraints are judged, not required."""
        return OutcomeFacts(self.method.formulation.problem.null_motion, self.coefficients)

    def refined(self, where: Flags | None = None) -> Self:
        """Return it with half the step length, for all or some of the steps (N,).

        As it is where it breaks down on that grid.
        """
        try:
            return super().refined(where)
        except BreakdownError:
            return self


def solve_as_published(solution: Solution, optimizer: Optimizer) -> Solution:
    """Return the optimum of the published method, on its grids, or on that of the solution."""
    before = solution.outcome
    if isinstance(before, PublishedOutcome):
        found = before.optimised()
    else:
        begun = _first(solution.guess, optimizer)
        found = replace(begun, x=_first_coefficients(begun, solution.guess)).converged()
    ended = Status.INTERRUPTED if found.status is Status.INTERRUPTED else solution.ended
    return replace(solution, outcome=found, history=tuple(found.history), ended=ended)


def _first(guess: Guess, optimizer: Optimizer) -> PublishedOutcome:
    """Return the minimum-norm motion as the start of the published method."""
    effort, formulation, begun = guess.effort, guess.formulation, guess.minimum_norm.motion
    if isinstance(formulation.problem.null_motion, FreeNullMotion):
        polynomial = formulation.problem.changed(null_motion=PolynomialNullMotion())
        formulation = Formulation.of(polynomial)
    ends, most = guess.conditions.ends, effort.max_evaluations
    limit = None if most is None else effort.counts.evaluations + most
    method = MethodInputs(
        formulation, begun, guess.free, ends, optimizer, effort.counts, limit, effort.callback
    )
    objective = Objective.of(
        formulation,
        begun,
        free=guess.free,
        ends=ends,
        counts=effort.counts,
        rollout=begun.rollout,
    )
    none = np.zeros(objective.size)
    return PublishedOutcome(method, objective, none, conditions=guess.conditions)


def _first_coefficients(begun: PublishedOutcome, guess: Guess) -> Array:
    """Return the decision vector that is nearest to a known plan, if no worse than x = 0."""
    plan, formulation, objective = guess.plan, guess.formulation, begun.objective
    if plan is None:
        return begun.x
    t, pace = objective.grid.stage_times, pace_of(plan, formulation)
    near = coefficients_of(plan.trajectory, pace, formulation, t, objective.null_motion)
    z, _ = parts_of(objective, begun.x)
    x = np.concatenate([z, near])
    return x if objective.value(x) <= guess.minimum_norm.cost else begun.x


def coefficients_of(
    trajectory: Trajectory, pace: float, formulation: Formulation, t: Array, table: NullMotionTable
) -> Array:
    """Return the coefficients x whose null motion is nearest to that of another motion, (size,).

    By least squares over the times. Of a null motion only Nᵀε acts, with N (n, r) a basis of the
    null space of the task: it is fitted to Nᵀq̇, with N and q̇ those of the other motion at the same
    share of its path.

    Parameters
    ----------
    trajectory : Trajectory
    pace : float
        The duration of its path over that of the problem's.
    formulation : Formulation
    t : (S,)
        Times on its path [s].
    table : NullMotionTable
        Its null motion at these times.
    """
    # A plan of a part of its path ends earlier.
    theirs = np.minimum(t * pace, trajectory.t[-1])
    q, qd = trajectory(theirs), pace * trajectory(theirs, 1)
    null = np.swapaxes(null_space(formulation.follows.jacobians(q)), 1, 2)
    acting = null @ table.matrix()
    wanted = np.einsum("srn,sn->sr", null, qd)
    if not wanted.size:
        return np.zeros(table.size)
    return np.asarray(np.linalg.lstsq(acting.reshape(-1, table.size), wanted.ravel())[0])

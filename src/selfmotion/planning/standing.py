"""A motion that stands: all that is known of it, as one value."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.constraints import Binding, penalty, violated
from selfmotion.engine import Evaluation, Objective
from selfmotion.motion import NodeNullMotion, NullMotion
from selfmotion.optimise import Minimum, Status
from selfmotion.planning.beginning import Beginning
from selfmotion.planning.warm_start import coefficients_of, pace_of
from selfmotion.result import Plan


class Standing(Protocol):
    """What is asked of a motion that stands, however it was found."""

    @property
    def status(self) -> Status:
        """How the last minimisation ended."""

    @property
    def violations(self) -> tuple[str, ...]:
        """What is wrong for each constraint that it could not meet."""

    @property
    def active(self) -> tuple[Binding, ...]:
        """What kept it from a lower cost."""

    @property
    def remaining(self) -> float | None:
        """What any other motion could still save, as far as is known [cost]."""

    @property
    def null_motion(self) -> NullMotion:
        """The parameterisation of its null motion."""

    @property
    def coefficients(self) -> Array:
        """The null motion's coefficients."""

    @property
    def steps(self) -> int:
        """Of its grid."""

    @property
    def cost(self) -> float:
        """F."""

    @property
    def keeps_off_itself(self) -> bool:
        """Whether the arm does where only the default asks it to, at the nodes and by meshes."""

    def merit(self) -> float:
        """Return the cost, much larger where constraints are violated: for ranking."""

    def evaluation(self) -> Evaluation:
        """Return the motion with its costs."""

    def refined(self, where: Flags | None = None) -> "Standing":
        """Return it with half the step length, everywhere or for some of the steps (N,)."""


def score(standing: Standing) -> tuple[bool, bool, float]:
    """Return what ranks motions, the smaller, the better.

    Whether constraints are violated, whether the arm meets itself, which would be refused in the
    end, and the cost. Of two that violate constraints, the one that does so less is nearer to a
    motion.
    """
    if standing.violations:
        return True, False, standing.merit()
    return False, not standing.keeps_off_itself, standing.cost


@dataclass(frozen=True, eq=False)
class PaperMotion:
    """A motion of the published method: at x = 0, or optimised.

    Attributes
    ----------
    beginning : Beginning
        The start that it begins at.
    objective : Objective
        On its grid.
    x : (size,)
        The decision vector.
    null_motion : NullMotion
    minimum : Minimum or None
        How the last minimisation ended; None before the first.
    """

    beginning: Beginning
    objective: Objective
    x: Array
    null_motion: NullMotion
    minimum: Minimum | None = None

    @classmethod
    def still(cls, beginning: Beginning) -> "PaperMotion":
        """Return the motion at x = 0."""
        objective = beginning.first()
        x = np.zeros(objective.size)
        return cls(beginning, objective, x, beginning.problem.null_motion)

    @property
    def status(self) -> Status:
        """How the last minimisation ended."""
        if self.minimum is not None:
            return self.minimum.status
        # Without self-motion it is the only one; else nothing better was found.
        free = self.beginning.problem.follows.redundancy > 0
        return Status.INFEASIBLE if free else Status.CONVERGED

    @cached_property
    def violations(self) -> tuple[str, ...]:
        """See `Standing.violations`."""
        return violated(self.beginning.constraints, self.objective.samples(self.x))

    @property
    def active(self) -> tuple[Binding, ...]:
        """Nothing: constraints are not asked of it, only judged."""
        return ()

    @property
    def remaining(self) -> None:
        """Not known."""

    @property
    def coefficients(self) -> Array:
        """The null motion's coefficients."""
        return self.objective.parts(self.x)[1].copy()

    @property
    def steps(self) -> int:
        """Of its grid."""
        return self.objective.grid.steps

    @property
    def nodes(self) -> Array:
        """The motion at the nodes of its grid, (N + 1, n)."""
        samples = self.objective.samples(self.x)
        return np.array(samples.q[self.objective.grid.node_stages])

    @property
    def cost(self) -> float:
        """F."""
        return sum(self.objective.terms(self.x).values())

    @cached_property
    def keeps_off_itself(self) -> bool:
        """Whether the arm does where only the default asks it to, at the nodes and by meshes."""
        return self.beginning.problem.keeps_off_itself(self.nodes)

    def merit(self) -> float:
        """See `Standing.merit`."""
        cost = self.objective.value(self.x)
        if not np.isfinite(cost):
            return cost
        over = penalty(self.beginning.constraints, self.objective.samples(self.x))
        return cost + max(abs(cost), 1e-3) * over

    def evaluation(self) -> Evaluation:
        """Return the motion with its costs."""
        return self.objective.at(self.x)

    def still_evaluation(self) -> Evaluation:
        """Return the motion at x = 0 on this grid."""
        return self.objective.at(np.zeros_like(self.x))

    def refined(self, where: Flags | None = None) -> "PaperMotion":
        """Return it with half the step length, everywhere or for some of the steps (N,)."""
        grid = self.objective.grid.halved(where)
        return replace(self, objective=self.beginning.objective(grid, self.null_motion))

    def begun_at(self, plan: Plan) -> "PaperMotion":
        """Return the one whose null motion is that of a plan of such a problem, if no worse."""
        motion, known = self.null_motion, plan.report.null_motion
        if plan.problem.null_motion == motion and not isinstance(known, NodeNullMotion | None):
            motion = known
        grid = self.objective.grid.with_steps(max(motion.fewest_steps, plan.report.steps))
        pace, t = pace_of(plan, self.beginning.problem), grid.stage_times
        objective = self.beginning.objective(grid, motion)
        table, problem = objective.null_motion, self.beginning.problem
        x = coefficients_of(plan.trajectory, pace, problem, t, table)
        z, _ = objective.parts(np.zeros(objective.size))
        x = np.concatenate([z, x])
        other = replace(self, x=x, objective=objective, null_motion=motion)
        return other if other.merit() <= self.merit() else self

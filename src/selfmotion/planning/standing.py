"""A motion that stands: all that is known of it, as one value."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from selfmotion.basics import Array, BreakdownError, Flags
from selfmotion.constraints import ActiveConstraint, penalised, violated
from selfmotion.costs import Samples
from selfmotion.motion import Evaluation, NullMotion
from selfmotion.optimise import Status
from selfmotion.paper import Solution
from selfmotion.planning.beginning import Beginning


class Standing(Protocol):
    """What is asked of a motion that stands, however it was found."""

    @property
    def status(self) -> Status:
        """How the last minimisation ended."""

    @property
    def violations(self) -> tuple[str, ...]:
        """What is wrong for each constraint that it could not meet."""

    @property
    def active(self) -> tuple[ActiveConstraint, ...]:
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
    solution : Solution
    """

    beginning: Beginning
    solution: Solution

    @property
    def status(self) -> Status:
        """How the optimisation ended."""
        if self.solution.is_optimised:
            return self.solution.status
        # Without self-motion it is the only one; else nothing better was found.
        free = self.beginning.problem.follows.redundancy > 0
        return Status.INFEASIBLE if free else Status.CONVERGED

    @cached_property
    def violations(self) -> tuple[str, ...]:
        """See `Standing.violations`."""
        return violated(self.beginning.constraints, self._samples)

    @property
    def active(self) -> tuple[ActiveConstraint, ...]:
        """Nothing: constraints are not asked of it, only judged."""
        return ()

    @property
    def remaining(self) -> None:
        """Not known."""

    @property
    def null_motion(self) -> NullMotion:
        """See `Standing.null_motion`."""
        return self.solution.null_motion

    @property
    def coefficients(self) -> Array:
        """See `Standing.coefficients`."""
        return self.solution.coefficients

    @property
    def steps(self) -> int:
        """See `Standing.steps`."""
        return self.solution.steps

    @property
    def cost(self) -> float:
        """F."""
        return self.solution.cost

    @cached_property
    def keeps_off_itself(self) -> bool:
        """See `Standing.keeps_off_itself`."""
        return self.beginning.problem.keeps_off_itself(self.solution.nodes)

    @property
    def _samples(self) -> Samples:
        return self.solution.objective.samples(self.solution.x)

    def merit(self) -> float:
        """See `Standing.merit`."""
        if not np.isfinite(self.cost):
            return np.inf
        return penalised(self.cost, self.beginning.constraints, self._samples)

    def evaluation(self) -> Evaluation:
        """Return the motion with its costs."""
        return self.solution.evaluation()

    def refined(self, where: Flags | None = None) -> "PaperMotion":
        """Return it with half the step length, everywhere or for some of the steps (N,).

        As it is where it breaks down on that grid.
        """
        try:
            return replace(self, solution=self.solution.refined(where))
        except BreakdownError:
            return self

"""Where the optimisation of one start begins: at the motion x = 0."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from selfmotion.basics import Array, ProblemError
from selfmotion.constraints import BoundConstraint, BoundEnd
from selfmotion.motion import FreeNullMotion, Grid, PolynomialNullMotion
from selfmotion.optimise import QuasiNewton
from selfmotion.paper import (
    MOST_HALVINGS,
    Guide,
    Method,
    Objective,
    Solution,
    StillMotion,
    settled_still_motion,
)
from selfmotion.planning.effort import Effort
from selfmotion.planning.for_nodes import is_published
from selfmotion.problem import Problem


@dataclass(frozen=True, eq=False)
class Beginning:
    """What all motions of one start have in common; made by `Beginning.of`.

    Attributes
    ----------
    problem : Problem
    effort : Effort
    still : StillMotion
        The motion at x = 0.
    constraints : tuple of BoundConstraint
        Those that count, bound to its ends.
    free : bool
        Whether the start may move along its self-motion.
    """

    problem: Problem
    effort: Effort
    still: StillMotion
    constraints: Sequence[BoundConstraint]
    free: bool

    @classmethod
    def of(
        cls,
        problem: Problem,
        effort: Effort,
        configuration: Array,
        *,
        free: bool,
        guide: Guide | None = None,
        grid: Grid | None = None,
    ) -> "Beginning":
        """Integrate the motion at x = 0 from a start.

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
        grid : Grid, optional
            To begin with; it is refined until the motion stays near the path.

        Raises
        ------
        BreakdownError
            The motion at x = 0 runs into a singular pose.
        """
        still, jacobians = settled_still_motion(problem, configuration, guide, grid)
        effort.counts.jacobians += jacobians
        bound = problem.bind_constraints(configuration, still.end, apart=effort.apart)
        _require_known(bound)
        return cls(problem, effort, still, tuple(bound), free)

    def kept_apart(self) -> "Beginning":
        """Return it where the arm has to keep off itself, too."""
        effort, still = replace(self.effort, apart=True), self.still
        bound = self.problem.bind_constraints(still.start, still.end)
        return replace(self, effort=effort, constraints=bound)

    @property
    def most_steps(self) -> int:
        """Steps beyond which a grid is not refined any more."""
        return int(self.still.grid.steps * 2**MOST_HALVINGS)

    @property
    def ends(self) -> tuple[BoundConstraint, ...]:
        """What is asked of the ends alone."""
        return tuple(item for item in self.constraints if item.equality)

    def solution(self) -> Solution:
        """Return the motion at x = 0 as what the published method begins with."""
        effort, ends, problem = self.effort, self.ends, self.problem
        if isinstance(problem.null_motion, FreeNullMotion) and is_published(problem, effort):
            problem = problem.changed(null_motion=PolynomialNullMotion())
        objective = Objective.of(
            problem,
            self.still,
            free=self.free,
            ends=ends,
            counts=effort.counts,
            rollout=self.still.rollout,
        )
        own = QuasiNewton() if effort.optimizer is None else effort.optimizer
        method = Method(problem, self.still, self.free, ends, own, effort.counts, None, None)
        return Solution(method, objective, np.zeros(objective.size))


def _require_known(constraints: Sequence[BoundConstraint]) -> None:
    """Raise ProblemError for equalities that are none on the ends."""
    for item in constraints:
        if item.equality and not isinstance(item, BoundEnd):
            raise ProblemError(
                f"constraint '{item.name}': it is an equality, expected h ≤ 0 at all nodes; "
                f"equalities are asked of the ends alone (ClosedPath, EndConfiguration, …), and "
                f"others are two-sided bands"
            )

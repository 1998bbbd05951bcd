"""Where the optimisation of one start begins: at the motion x = 0."""

from collections.abc import Sequence
from dataclasses import dataclass

from selfmotion.basics import Array
from selfmotion.constraints import BoundConstraint
from selfmotion.engine import (
    MOST_HALVINGS,
    Guide,
    Objective,
    StillMotion,
    settled_still_motion,
)
from selfmotion.motion import Grid, NullMotion
from selfmotion.planning.effort import Effort
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
        return cls(problem, effort, still, tuple(bound), free)

    @property
    def most_steps(self) -> int:
        """Steps beyond which a grid is not refined any more."""
        return int(self.still.grid.steps * 2**MOST_HALVINGS)

    def first(self) -> Objective:
        """Return the objective on the grid of x = 0, which takes over its rollout."""
        return Objective.of(
            self.problem,
            self.still,
            free=self.free,
            counts=self.effort.counts,
            rollout=self.still.rollout,
        )

    def objective(
        self, grid: Grid, null_motion: NullMotion, around: Array | None = None
    ) -> Objective:
        """Return the objective on a grid, of a null motion around a given one, `around` (S, n)."""
        return Objective.of(
            self.problem,
            self.still,
            grid=grid,
            free=self.free,
            counts=self.effort.counts,
            null_motion=null_motion,
            around=around,
        )

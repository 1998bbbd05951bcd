"""A motion that stands: all that is known of it, as one value."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.constraints import Binding
from selfmotion.engine import Evaluation, Objective, Remaining, finest
from selfmotion.motion import Grid, NodeNullMotion, NullMotion, Trajectory
from selfmotion.optimise import Minimum, Status
from selfmotion.planning.beginning import Beginning
from selfmotion.planning.closing import closed
from selfmotion.planning.settings import ALIKE, MOST_ESTIMATED, THINNER
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
class RolledMotion:
    """A motion rolled out from the coefficients of its null motion.

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
        How the last minimisation with this null motion ended; None before the first.
    violations : tuple of str
    active : tuple of Binding
    remaining : float or None
        See `Standing`.
    """

    beginning: Beginning
    objective: Objective
    x: Array
    null_motion: NullMotion
    minimum: Minimum | None = None
    violations: tuple[str, ...] = ()
    active: tuple[Binding, ...] = ()
    remaining: float | None = None

    @classmethod
    def still(cls, beginning: Beginning, motion: NullMotion | None = None) -> "RolledMotion":
        """Return the motion at x = 0, by default of the problem's null motion."""
        if motion is None:
            objective, motion = beginning.first(), beginning.problem.null_motion
        else:
            grid = beginning.still.grid.with_steps(motion.fewest_steps)
            objective = beginning.objective(grid, motion)
        return cls(beginning, objective, np.zeros(objective.size), motion)

    @property
    def status(self) -> Status:
        """How the last minimisation ended."""
        return Status.STOPPED if self.minimum is None else self.minimum.status

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
        """Return the cost, much larger where constraints are violated: for ranking."""
        objective, x = self.objective, self.x
        cost = objective.value(x)
        if not np.isfinite(cost):
            return cost
        return cost + max(abs(cost), 1e-3) * objective.constraints.penalty(objective.samples(x))

    def evaluation(self) -> Evaluation:
        """Return the motion with its costs."""
        return self.objective.at(self.x)

    def still_evaluation(self) -> Evaluation:
        """Return the motion at x = 0 on this grid."""
        return self.objective.at(np.zeros_like(self.x))

    def judged(self) -> "RolledMotion":
        """Return it with what is wrong for each constraint that is not met."""
        return replace(self, violations=self.objective.violations(self.x))

    def closed(self) -> "RolledMotion":
        """Return it with what is asked of its ends met to rounding."""
        if not self.objective.constraints.has_equalities or self.minimum is None:
            return self
        return replace(self, x=closed(self.objective, self.x, self.minimum.inverse_hessian))

    def on(
        self, grid: Grid, motion: NullMotion | None = None, around: Array | None = None
    ) -> Objective:
        """Return the objective on a grid, by default of its null motion."""
        return self.beginning.objective(grid, motion or self.null_motion, around)

    def refined(self, where: Flags | None = None) -> "RolledMotion":
        """Return it with half the step length, everywhere or for some of the steps (N,)."""
        return replace(self, objective=self.on(self.objective.grid.halved(where))).closed()

    def with_null_motion(self, motion: NullMotion) -> "RolledMotion":
        """Return it with another null motion that can be what the present one is."""
        before = self.objective
        z, x = before.parts(self.x)
        grid = before.grid.with_steps(motion.fewest_steps // THINNER)
        t, duration = grid.stage_times, self.beginning.problem.path.duration
        own, new = (kind.functions(t, duration) for kind in (self.null_motion, motion))
        same = np.linalg.lstsq(new, own)[0]
        rows = x.reshape(before.null_motion.rows, own.shape[1]) @ same.T
        return replace(
            self,
            x=np.concatenate([z, rows.ravel()]),
            objective=self.on(grid, motion),
            null_motion=motion,
            minimum=None,
        )

    def rougher(self) -> "RolledMotion | None":
        """Return this motion at x = 0 with a rougher null motion, on a grid as coarse as will do.

        None where that would be no coarser.
        """
        objective, rough = self.objective, self.null_motion.rough
        z, _ = objective.parts(self.x)
        cost = objective.value(self.x)
        coarse = self.on(Grid.aligned(self.beginning.problem.knots, rough.fewest_steps), rough)
        # Written so that NaN asks for more steps, too.
        while not relative_change(cost, coarse.value(np.zeros(coarse.size))) <= ALIKE:
            if coarse.grid.steps >= objective.grid.steps:
                return None
            coarse = self.on(coarse.grid.halved(), rough)
        x = np.concatenate([z, np.zeros(coarse.null_motion.size)])
        return replace(self, x=x, objective=coarse, null_motion=rough)

    def resumed(self, trajectory: Trajectory) -> "RolledMotion":
        """Return the one whose null motion is that of a motion along this path, if no worse."""
        return self._or_along(trajectory, 1.0, self.objective, self.null_motion)

    def begun_at(self, plan: Plan) -> "RolledMotion":
        """Return the one whose null motion is that of a plan of such a problem, if no worse."""
        motion, known = self.null_motion, plan.report.null_motion
        if plan.problem.null_motion == motion and not isinstance(known, NodeNullMotion | None):
            motion = known
        grid = self.objective.grid.with_steps(max(motion.fewest_steps, plan.report.steps))
        pace = pace_of(plan, self.beginning.problem)
        return self._or_along(plan.trajectory, pace, self.on(grid, motion), motion)

    def _or_along(
        self, trajectory: Trajectory, pace: float, objective: Objective, motion: NullMotion
    ) -> "RolledMotion":
        still, t, problem = self.merit(), objective.grid.stage_times, self.beginning.problem
        x = coefficients_of(trajectory, pace, problem, t, objective.null_motion)
        z, _ = objective.parts(np.zeros(objective.size))
        other = replace(self, x=np.concatenate([z, x]), objective=objective, null_motion=motion)
        return other if other.merit() <= still else self

    def left(self, *, bound: bool) -> Remaining:
        """Return what is left to save around this motion; `bound` where constraints count."""
        problem = self.beginning.problem
        spline = finest(problem.follows.redundancy)
        # More than a step for each interval makes no better estimate.
        grid = self.objective.grid.with_steps(spline.intervals)
        if grid.steps > MOST_ESTIMATED:
            # It is in memory for each number of the spline.
            grid = Grid.aligned(problem.knots, MOST_ESTIMATED)
        same = grid is self.objective.grid
        objective = self.objective if same else self.on(grid)
        z, x = objective.parts(self.x)
        fine = self.on(grid, spline, objective.null_motion.epsilon(x))
        none = np.zeros(fine.null_motion.size)
        return Remaining(fine, np.concatenate([z, none]), bound=bound)


def relative_change(before: float, after: float) -> float:
    """Return the change of a cost as a share of what it was."""
    return abs(after - before) / max(abs(before), np.finfo(float).tiny)

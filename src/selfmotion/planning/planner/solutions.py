"""What is known of a motion that was found, by the published method or on nodes, as one value."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from selfmotion.basics import Array, BreakdownError, Flags
from selfmotion.model.motion import Evaluation, Grid, NodeNullMotion, NullMotion
from selfmotion.planning import paper
from selfmotion.planning.nodes import NodeMotion, Optimum
from selfmotion.planning.optimise import Status
from selfmotion.planning.search import BESIDE
from selfmotion.problem.constraints import (
    ActiveConstraint,
    BoundConstraint,
    Multipliers,
    active_of,
    penalised,
    violated,
    worst_time,
)
from selfmotion.problem.costs import Samples

# What is asked of the ends is met to this [rad, rad/s].
ENDS_MET = 1e-8
# What would save less than this share of the cost does not bind.
_LEAST_SAVING = 1e-6
# An easing that would save more than this share is told smaller: multipliers are slopes, which hold
# very near only.
_MOST_SAVING = 1e-2


@dataclass(frozen=True, eq=False)
class PublishedSolution(paper.Solution):
    """A motion of the published method: at x = 0, the minimum-norm motion, or optimised.

    Attributes
    ----------
    constraints : sequence of BoundConstraint
        Judged, not asked.
    """

    constraints: Sequence[BoundConstraint] = ()

    @cached_property
    def violations(self) -> tuple[str, ...]:
        """What is wrong for each constraint that it could not meet."""
        return violated(self.constraints, self._samples)

    @property
    def active(self) -> tuple[ActiveConstraint, ...]:
        """Nothing: constraints are not asked of it, only judged."""
        return ()

    @property
    def remaining(self) -> None:
        """Not known."""

    @cached_property
    def keeps_off_itself(self) -> bool:
        """Whether the arm does where only the default asks it to, at the nodes and by meshes."""
        return self.method.problem.keeps_off_itself(self.nodes)

    @property
    def _samples(self) -> Samples:
        return self.objective.samples(self.x)

    def merit(self) -> float:
        """Return the cost, much larger where constraints are violated: for ranking."""
        if not np.isfinite(self.cost):
            return np.inf
        return penalised(self.cost, self.constraints, self._samples)

    def refined(self, where: Flags | None = None) -> Self:
        """Return it with half the step length, everywhere or for some of the steps (N,).

        As it is where it breaks down on that grid.
        """
        try:
            return super().refined(where)
        except BreakdownError:
            return self


@dataclass(frozen=True, eq=False)
class NodeSolution:
    """A motion on nodes: the best that was found near a start.

    Attributes
    ----------
    motion : NodeMotion
    status : Status
    multipliers : (R,)
        Of all rows of its conditions.
    remaining : float or None
        What more nodes and another step might still save [cost]; None where that is not known.
    optimum : Optimum or None
        What it was found as; None of what is none.
    is_chain : bool
        Whether it is a chain of the global search, which is at its optimum.
    """

    motion: NodeMotion
    status: Status
    multipliers: Array
    remaining: float | None = None
    optimum: Optimum | None = None
    is_chain: bool = False

    @classmethod
    def of(cls, optimum: Optimum, status: Status) -> "NodeSolution":
        """Return the one at an optimum."""
        motion: NodeMotion = optimum.motion
        promised = optimum.promised if np.isfinite(optimum.promised) else 0.0
        away = motion.grid.rows.conservatism(optimum.multipliers, motion.curve_ends)
        return cls(motion, status, optimum.multipliers, promised + float(away.sum()), optimum)

    @classmethod
    def on_the_way(cls, motion: NodeMotion) -> "NodeSolution":
        """Return the one of a motion that keeps the conditions and has to do as it is."""
        return cls(motion, Status.STOPPED, np.zeros(len(motion.h)))

    @cached_property
    def active(self) -> tuple[ActiveConstraint, ...]:
        """What kept the optimum from a lower cost; on the way to one, multipliers say nothing."""
        return _active(self.optimum) if self.optimum is not None and self.has_arrived else ()

    @property
    def has_arrived(self) -> bool:
        """Whether it is an optimum, and no motion on the way to one."""
        return self.optimum is None or self.optimum.status in (Status.CONVERGED, Status.PRECISION)

    @property
    def steps(self) -> int:
        """Intervals between the nodes."""
        return len(self.motion.grid.t) - 1

    @property
    def null_motion(self) -> NullMotion:
        """The null motion's functions: of its values at the nodes, for each joint."""
        return NodeNullMotion(tuple(self.motion.grid.t / self.motion.grid.t[-1]))

    @property
    def coefficients(self) -> Array:
        """The null motion at the nodes, joint by joint."""
        return self.motion.epsilon.T.ravel()

    @property
    def cost(self) -> float:
        """F."""
        return self.motion.cost

    @cached_property
    def keeps_off_itself(self) -> bool:
        """Whether the arm does where only the default asks it to, at the nodes and by meshes."""
        return self.motion.grid.problem.keeps_off_itself(self.motion.place.q)

    @cached_property
    def violations(self) -> tuple[str, ...]:
        """What is wrong for each constraint that it could not meet."""
        motion = self.motion
        ends = np.abs(motion.c).max(initial=0.0)
        # Written so that NaN is not kept.
        if motion.violation <= 0.0 and ends <= ENDS_MET and not motion.elsewhere:
            return ()
        # What control points exceed, the curve may keep.
        broken = violated(motion.grid.constraints, motion.checked)
        return broken + tuple(
            f"{name}: the motion ends {far:.3g} rad or m away from it, in another configuration "
            f"that puts the tool there"
            for name, far in motion.elsewhere.items()
        )

    @property
    def breaks_at(self) -> float | None:
        """When [s] constraints are violated most; None where those of all times are kept."""
        return worst_time(self.motion.grid.constraints, self.motion.checked)

    def merit(self) -> float:
        """Return the cost, much larger where constraints are violated: for ranking."""
        motion = self.motion
        if motion.violation <= 0.0 and not motion.elsewhere:
            return self.cost
        found = penalised(self.cost, motion.grid.constraints, motion.checked)
        return found + len(motion.elsewhere) * 10.0 * max(abs(self.cost), 1e-3)

    def evaluation(self) -> Evaluation:
        """Return the motion with its costs."""
        motion = self.motion
        found = Evaluation(self.coefficients, motion.terms, motion.trajectory, damped=False)
        motion.forget()
        return found

    def after(self, before: float) -> "NodeSolution":
        """Return it as what came of a motion on fewer nodes that cost so much."""
        remaining = (self.remaining or 0.0) + max(before - self.cost, 0.0)
        return replace(self, remaining=remaining)

    def on(self, t: Array) -> "NodeSolution | None":
        """Return it on other nodes (N + 1,); None where one of them is out of reach.

        Beside a singular pose the path may be so, by next to nothing: a little later it is not.
        """
        beside, new = t.copy(), ~np.isin(t, self.motion.grid.t)
        beside[new] += BESIDE * np.diff(t, append=t[-1])[new]
        smoothed, quick = self.motion.can_be_smoothed(), self.motion.quickness
        for times in (t, beside):
            motion = self.motion.on(self.motion.grid.on(times, smoothed=smoothed, quick=quick))
            if motion is not None:
                multipliers = motion.grid.rows.carried(self.motion.grid.rows, self.multipliers)
                self.motion.forget()
                return replace(self, motion=motion, multipliers=multipliers)
        return None

    def refined(self, where: Flags | None = None) -> "NodeSolution":
        """Return it with all intervals halved, or some (N,); as it is where that cannot be."""
        return self.on(Grid(self.motion.grid.t).halved(where).nodes) or self


Solution = PublishedSolution | NodeSolution
"""A motion, however it was found."""


def score(solution: Solution) -> tuple[bool, bool, float]:
    """Return what ranks motions, the smaller, the better.

    Whether constraints are violated, whether the arm meets itself, which would be refused in the
    end, and the cost. Of two that violate constraints, the one that does so less is nearer to a
    motion.
    """
    if solution.violations:
        return True, False, solution.merit()
    return False, not solution.keeps_off_itself, solution.cost


def _active(optimum: Optimum) -> tuple[ActiveConstraint, ...]:
    """Return what kept an optimum from a lower cost."""
    if not (optimum.multipliers.any() or optimum.end_multipliers.size):
        return ()
    motion, grid = optimum.motion, optimum.motion.grid
    inner = iter(grid.rows.multipliers_of(optimum.multipliers, motion.curve_ends))
    ends = grid.ends.by_item(optimum.end_multipliers)
    each = []
    for item in grid.constraints:
        if item.equality:
            own = ends[id(item)][None]
            each.append(Multipliers(item, own, np.zeros(1), np.ones(own.shape, dtype=np.bool_)))
        else:
            each.append(next(inner))
    least, most = (share * abs(motion.cost) for share in (_LEAST_SAVING, _MOST_SAVING))
    return active_of(each, grid.t[[0, -1]], least, most)

"""Solutions of a planning formulation: by the published method, or on nodes."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np

from selfmotion.basics import Array, BreakdownError, Counts, Flags
from selfmotion.model.motion import Evaluation, Grid, NodeNullMotion, NullMotion, Trajectory
from selfmotion.planning import paper
from selfmotion.planning.formulation import (
    BoundConditions,
    Formulation,
    SampledMotion,
    require_finite_gradients,
    require_finite_values,
)
from selfmotion.planning.nodes import NodeMotion, Optimum
from selfmotion.planning.optimise import Status
from selfmotion.planning.paper import MinimumNormMotion
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

# Residual of conditions at the ends [rad, rad/s].
ENDS_MET = 1e-8
# Relative saving below which a constraint does not bind.
_LEAST_SAVING = 1e-6
# Largest relative saving in reports: multipliers are first derivatives, which are valid nearby.
_MOST_SAVING = 1e-2


@dataclass(frozen=True, eq=False)
class MinimumNormSolution:
    """The minimum-norm motion, eq. 4 at ε = 0: an initial guess, and what others are held against.

    Attributes
    ----------
    formulation : Formulation
    motion : MinimumNormMotion
    conditions : BoundConditions
        Judged, not required.
    counts : Counts
        Where work is added up.
    """

    formulation: Formulation
    motion: MinimumNormMotion
    conditions: BoundConditions
    counts: Counts

    @property
    def status(self) -> Status:
        """Without self-motion it is the only motion; else nothing better was found."""
        redundant = self.formulation.follows.redundancy > 0
        return Status.INFEASIBLE if redundant else Status.CONVERGED

    @property
    def steps(self) -> int:
        """Of its grid."""
        return self.motion.grid.steps

    @property
    def null_motion(self) -> NullMotion:
        """The parameterisation of the null motion."""
        return self.formulation.null_motion

    @property
    def coefficients(self) -> Array:
        """The null motion's coefficients: none."""
        return np.zeros(0)

    @cached_property
    def _sampled(self) -> SampledMotion:
        return self.formulation.sampled(self.motion.rollout.samples())

    @cached_property
    def terms(self) -> dict[str, float]:
        """Contribution of each cost."""
        self.counts.evaluated()
        arm, costs = self._sampled.arm, self.formulation.costs
        return {cost.name: float(arm.weights @ cost.value(arm)) for cost in costs}

    @property
    def cost(self) -> float:
        """F; inf where it is not finite."""
        total = sum(self.terms.values())
        return total if np.isfinite(total) else np.inf

    def require_finite(self) -> None:
        """Raise ProblemError where a cost has no finite value."""
        require_finite_values(self.formulation.costs, self._sampled.arm)

    def require_finite_gradients(self) -> None:
        """Raise ProblemError where a derivative of a cost is not finite."""
        require_finite_gradients(self.formulation.costs, self._sampled.arm)

    @property
    def _evaluated(self) -> Iterator[tuple[BoundConstraint, Samples]]:
        return self._sampled.with_conditions(self.conditions.every)

    @cached_property
    def violations(self) -> tuple[str, ...]:
        """Violations, one for each constraint."""
        return violated(self._evaluated)

    @property
    def active(self) -> tuple[ActiveConstraint, ...]:
        """No constraint: they are judged, not required."""
        return ()

    @property
    def remaining(self) -> None:
        """Not known."""

    @cached_property
    def keeps_off_itself(self) -> bool:
        """Whether the default clearance from itself holds, at the nodes and by meshes."""
        return self.formulation.keeps_off_itself(self.motion.q)

    def merit(self) -> float:
        """Return the cost, much larger where constraints are violated: for ranking."""
        return penalised(self.cost, self._evaluated) if np.isfinite(self.cost) else np.inf

    @cached_property
    def _evaluation(self) -> Evaluation:
        own, rollout = self.motion, self.motion.rollout
        before = rollout.jacobian_evaluations
        t, q, qd = rollout.polished()
        qdd = own.grid.derivative(qd)
        if self.formulation.damping_law is None:
            # Where the arm comes to rest smoothly that is so by construction; differences are not.
            orders = zip((0, -1), self.formulation.rest_orders, strict=True)
            qdd[[end for end, order in orders if order > 1]] = 0.0
        self.counts.jacobians += rollout.jacobian_evaluations - before
        trajectory = Trajectory(t, q, qd, self.formulation.coordinates.names, qdd)
        return Evaluation(self.coefficients, self.terms, trajectory, rollout.damped)

    def evaluation(self) -> Evaluation:
        """Return the motion with its costs."""
        return self._evaluation

    def refined(self, where: Flags | None = None) -> "MinimumNormSolution":
        """Return it with half the step length, for all or some of the steps (N,).

        As it is where it breaks down on that grid.
        """
        own = self.motion
        grid = own.grid.halved(where)
        finer = MinimumNormMotion.on(own.formulation, own.start, grid, own.guide)
        self.counts.jacobians += finer.jacobian_evaluations
        return self if finer.broken is not None else replace(self, motion=finer)


@dataclass(frozen=True, eq=False)
class PublishedSolution(paper.Solution):
    """A motion of the published method, optimised.

    Attributes
    ----------
    conditions : BoundConditions
        Judged, not required.
    """

    conditions: BoundConditions = field(default_factory=BoundConditions)

    @property
    def _evaluated(self) -> Iterator[tuple[BoundConstraint, Samples]]:
        motion = self.method.formulation.sampled(self.objective.samples(self.x))
        return motion.with_conditions(self.conditions.every)

    @cached_property
    def violations(self) -> tuple[str, ...]:
        """Violations, one for each constraint."""
        return violated(self._evaluated)

    @property
    def active(self) -> tuple[ActiveConstraint, ...]:
        """No constraint: they are judged, not required."""
        return ()

    @property
    def remaining(self) -> None:
        """Not known."""

    @cached_property
    def keeps_off_itself(self) -> bool:
        """Whether the default clearance from itself holds, at the nodes and by meshes."""
        return self.method.formulation.keeps_off_itself(self.nodes)

    def merit(self) -> float:
        """Return the cost, much larger where constraints are violated: for ranking."""
        return penalised(self.cost, self._evaluated) if np.isfinite(self.cost) else np.inf

    def refined(self, where: Flags | None = None) -> Self:
        """Return it with half the step length, for all or some of the steps (N,).

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
        Possible decrease of the cost by more nodes and another step; None if unknown.
    optimum : Optimum or None
        The optimum it is; None for other motions.
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
        """Constraints that limit the optimum; none before convergence, without multipliers."""
        return _active(self.optimum) if self.optimum is not None and self.has_arrived else ()

    @property
    def has_arrived(self) -> bool:
        """Whether it is an optimum."""
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
        """Whether the default clearance from itself holds, at the nodes and by meshes."""
        return self.motion.grid.formulation.keeps_off_itself(self.motion.place.q)

    @cached_property
    def violations(self) -> tuple[str, ...]:
        """Violations, one for each constraint."""
        motion = self.motion
        ends = np.abs(motion.c).max(initial=0.0)
        # Written so that NaN is a violation.
        if motion.violation <= 0.0 and ends <= ENDS_MET and not motion.elsewhere:
            return ()
        # The curve may satisfy limits that control points exceed.
        broken = violated(motion.checked.with_conditions(motion.grid.conditions.every))
        return broken + tuple(
            f"{name}: the motion ends {far:.3g} rad or m away from it, in another configuration "
            f"that puts the tool there"
            for name, far in motion.elsewhere.items()
        )

    @property
    def breaks_at(self) -> float | None:
        """Time [s] of the largest violation; None where conditions at all times hold."""
        motion = self.motion
        return worst_time(motion.checked.with_conditions(motion.grid.conditions.inequalities))

    def merit(self) -> float:
        """Return the cost, much larger where constraints are violated: for ranking."""
        motion = self.motion
        if motion.violation <= 0.0 and not motion.elsewhere:
            return self.cost
        found = penalised(self.cost, motion.checked.with_conditions(motion.grid.conditions.every))
        return found + len(motion.elsewhere) * 10.0 * max(abs(self.cost), 1e-3)

    def evaluation(self) -> Evaluation:
        """Return the motion with its costs."""
        motion = self.motion
        found = Evaluation(self.coefficients, motion.terms, motion.trajectory, damped=False)
        motion.forget()
        return found

    def after(self, before: float) -> "NodeSolution":
        """Return it as the refinement of a motion on fewer nodes that cost `before`."""
        remaining = (self.remaining or 0.0) + max(before - self.cost, 0.0)
        return replace(self, remaining=remaining)

    def on(self, t: Array) -> "NodeSolution | None":
        """Return it on other nodes (N + 1,); None if one of them is out of reach.

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
        """Return it with all intervals halved, or some (N,); unchanged where that fails."""
        return self.on(Grid(self.motion.grid.t).halved(where).nodes) or self


Solution = MinimumNormSolution | PublishedSolution | NodeSolution
"""A motion, however it was found."""


def score(solution: Solution) -> tuple[bool, bool, float]:
    """Return the sort key of motions, the smaller, the better.

    Whether constraints are violated, whether the arm meets itself, which would be refused in the
    end, and the cost. Of two that violate constraints, the one that does so less is nearer to a
    motion.
    """
    if solution.violations:
        return True, False, solution.merit()
    return False, not solution.keeps_off_itself, solution.cost


def _active(optimum: Optimum) -> tuple[ActiveConstraint, ...]:
    """Return the constraints that limit an optimum."""
    if not (optimum.multipliers.any() or optimum.end_multipliers.size):
        return ()
    motion, grid = optimum.motion, optimum.motion.grid
    each = grid.rows.multipliers_of(optimum.multipliers, motion.curve_ends)
    ends = grid.ends.by_item(optimum.end_multipliers)
    for item in grid.conditions.ends:
        own = ends[id(item)][None]
        each.append(Multipliers(item, own, np.zeros(1), np.ones(own.shape, dtype=np.bool_)))
    least, most = (share * abs(motion.cost) for share in (_LEAST_SAVING, _MOST_SAVING))
    return active_of(each, grid.t[[0, -1]], least, most)

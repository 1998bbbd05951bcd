"""Motions that are found: the minimum-norm motion, and those on nodes."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, NamedTuple, Protocol, Self

import numpy as np

from selfmotion.basics import Array, Counts, Flags
from selfmotion.model.motion import Evaluation, Grid, NodeNullMotion, NullMotion, Trajectory
from selfmotion.planning.formulation import (
    BoundConditions,
    Formulation,
    SampledMotion,
    keeps_off_itself,
    sampled,
)
from selfmotion.planning.nodes import (
    NodeMotion,
    Optimum,
    carried,
    conservatism,
    forget,
    may_be_smoothed,
    multipliers_of,
    null_motion_of,
    on_grid,
    quickness_of,
    terms_of,
)
from selfmotion.planning.optimise import Status
from selfmotion.planning.planner.grids import UNKEPT
from selfmotion.planning.rollout import MinimumNormMotion
from selfmotion.planning.search import TIME_SHIFT
from selfmotion.problem.constraints import (
    ActiveConstraint,
    Multipliers,
    active_of,
    penalised,
    violated,
    worst_time,
)

# Residual of conditions at the ends [rad, rad/s].
ENDS_MET = 1e-8
# Statuses of an optimum.
ARRIVED = (Status.CONVERGED, Status.PRECISION)
# Relative saving below which a constraint does not bind.
_MIN_SAVING = 1e-6
# Largest relative saving in reports: multipliers are first derivatives, which are valid nearby.
_MAX_SAVING = 1e-2


class OutcomeFacts(NamedTuple):
    """What a report says of a motion that was found.

    Attributes
    ----------
    null_motion : NullMotion
        Its parameterisation.
    coefficients : (size,)
        Of the null motion.
    active : tuple of ActiveConstraint
        Constraints that limit the optimum; none before convergence, without multipliers.
    remaining : float or None
        Possible decrease of the cost by more nodes and another step; None if unknown.
    """

    null_motion: NullMotion
    coefficients: Array
    active: tuple[ActiveConstraint, ...] = ()
    remaining: float | None = None


class Outcome(Protocol):
    """A motion, however it was found."""

    @property
    def status(self) -> Status:
        """How the minimisation ended that found it."""
        ...

    @property
    def steps(self) -> int:
        """Intervals of its grid."""
        ...

    @property
    def cost(self) -> float:
        """F; inf where it is not finite."""
        ...

    @property
    def violations(self) -> tuple[str, ...]:
        """Violations, one for each constraint."""
        ...

    @property
    def keeps_off_itself(self) -> bool:
        """Whether the default clearance from itself holds, at the nodes and by meshes."""
        ...

    @property
    def breaks_at(self) -> float | None:
        """Time [s] of the largest violation; None where none is known."""
        ...

    @property
    def evaluation(self) -> Evaluation:
        """The motion with its costs."""
        ...

    @property
    def minimum_norm_evaluation(self) -> Evaluation | None:
        """The minimum-norm motion on the same grid; None where that is on nodes."""
        ...

    def merit(self) -> float:
        """Return the cost, much larger where constraints are violated: for ranking."""
        ...

    def facts(self) -> OutcomeFacts:
        """Return what a report says of it."""
        ...

    def refined(self, where: Flags | None = None) -> Self:
        """Return it with half the step length, for all or some of the steps (N,)."""
        ...


@dataclass(frozen=True, eq=False)
class MinimumNormOutcome:
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
    breaks_at: ClassVar[float | None] = None

    @property
    def status(self) -> Status:
        """Without self-motion it is the only motion; else nothing better was found."""
        redundant = self.formulation.follows.redundancy > 0
        return Status.INFEASIBLE if redundant else Status.CONVERGED

    @property
    def steps(self) -> int:
        """Of its grid."""
        return self.motion.grid.steps

    @cached_property
    def sampled(self) -> SampledMotion:
        """The motion at the stages of its integration."""
        return sampled(self.formulation, self.motion.rollout.samples())

    @cached_property
    def terms(self) -> dict[str, float]:
        """Contribution of each cost."""
        self.counts.evaluated()
        arm, costs = self.sampled.arm, self.formulation.costs
        return {cost.name: float(arm.weights @ cost.value(arm)) for cost in costs}

    @property
    def cost(self) -> float:
        """F; inf where it is not finite."""
        total = sum(self.terms.values())
        return total if np.isfinite(total) else np.inf

    @cached_property
    def violations(self) -> tuple[str, ...]:
        """Violations, one for each constraint."""
        return violated(self.sampled.with_conditions(self.conditions.every))

    @cached_property
    def keeps_off_itself(self) -> bool:
        """Whether the default clearance from itself holds, at the nodes and by meshes."""
        return keeps_off_itself(self.formulation, self.motion.q)

    def merit(self) -> float:
        """Return the cost, much larger where constraints are violated: for ranking."""
        if not np.isfinite(self.cost):
            return np.inf
        return penalised(self.cost, self.sampled.with_conditions(self.conditions.every))

    def facts(self) -> OutcomeFacts:
        """Return what a report says of it: there is no null motion."""
        return OutcomeFacts(self.formulation.problem.null_motion, np.zeros(0))

    @cached_property
    def evaluation(self) -> Evaluation:
        """The motion with its costs."""
        own, rollout = self.motion, self.motion.rollout
        before = rollout.jacobian_evaluations
        t, q, qd = rollout.polished()
        qdd = own.grid.derivative(qd)
        if self.formulation.problem.damping_law is None:
            # Where the arm comes to rest smoothly that is so by construction; differences are not.
            orders = zip((0, -1), self.formulation.problem.rest_orders, strict=True)
            qdd[[end for end, order in orders if order > 1]] = 0.0
        self.counts.jacobians += rollout.jacobian_evaluations - before
        trajectory = Trajectory(t, q, qd, self.formulation.coordinates.names, qdd)
        return Evaluation(np.zeros(0), self.terms, trajectory, rollout.damped)

    @property
    def minimum_norm_evaluation(self) -> Evaluation:
        """The motion itself."""
        return self.evaluation

    def refined(self, where: Flags | None = None) -> Self:
        """Return it with half the step length, for all or some of the steps (N,).

        As it is where it breaks down on that grid.
        """
        own = self.motion
        grid = own.grid.halved(where)
        finer = MinimumNormMotion.on(own.formulation, own.start, grid, own.guide)
        self.counts.jacobians += finer.jacobian_evaluations
        return self if finer.broken is not None else replace(self, motion=finer)


@dataclass(frozen=True, eq=False)
class NodeOutcome:
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
    minimum_norm_evaluation: ClassVar[Evaluation | None] = None

    @classmethod
    def of(cls, optimum: Optimum, status: Status) -> "NodeOutcome":
        """Return the one at an optimum."""
        motion: NodeMotion = optimum.motion
        promised = optimum.promised if np.isfinite(optimum.promised) else 0.0
        away = conservatism(motion.grid.rows, optimum.multipliers, motion.curve_ends)
        return cls(motion, status, optimum.multipliers, promised + float(away.sum()), optimum)

    @property
    def has_arrived(self) -> bool:
        """Whether it is an optimum."""
        return self.optimum is None or self.optimum.status in ARRIVED

    @property
    def steps(self) -> int:
        """Intervals between the nodes."""
        return len(self.motion.grid.t) - 1

    @property
    def cost(self) -> float:
        """F."""
        return self.motion.cost

    @cached_property
    def keeps_off_itself(self) -> bool:
        """Whether the default clearance from itself holds, at the nodes and by meshes."""
        return keeps_off_itself(self.motion.grid.formulation, self.motion.place.q)

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

    def facts(self) -> OutcomeFacts:
        """Return what a report says of it: the null motion at the nodes, joint by joint."""
        times = self.motion.grid.t
        functions = NodeNullMotion(tuple(times / times[-1]))
        active = _active(self.optimum) if self.optimum is not None and self.has_arrived else ()
        return OutcomeFacts(functions, _coefficients(self.motion), active, self.remaining)

    @property
    def evaluation(self) -> Evaluation:
        """The motion with its costs."""
        motion = self.motion
        found = Evaluation(_coefficients(motion), terms_of(motion), motion.trajectory, damped=False)
        forget(motion)
        return found

    def on(self, t: Array) -> Self | None:
        """Return it on other nodes (N + 1,); None if one of them is out of reach.

        Beside a singular pose the path may be so, by next to nothing: a little later it is not.
        """
        beside, new = t.copy(), ~np.isin(t, self.motion.grid.t)
        beside[new] += TIME_SHIFT * np.diff(t, append=t[-1])[new]
        smoothed, quick = may_be_smoothed(self.motion), quickness_of(self.motion)
        for times in (t, beside):
            motion = on_grid(
                self.motion, self.motion.grid.on(times, smoothed=smoothed, quick=quick)
            )
            if motion is not None:
                multipliers = carried(motion.grid.rows, self.motion.grid.rows, self.multipliers)
                forget(self.motion)
                return replace(self, motion=motion, multipliers=multipliers)
        return None

    def refined(self, where: Flags | None = None) -> Self:
        """Return it with all intervals halved, or some (N,); unchanged where that fails."""
        return self.on(Grid(self.motion.grid.t).halved(where).nodes) or self


def on_the_way(motion: NodeMotion, status: Status = Status.STOPPED) -> NodeOutcome:
    """Return the outcome of a motion that satisfies the conditions and has to do as it is."""
    return NodeOutcome(motion, status, np.zeros(len(motion.h)))


def _coefficients(motion: NodeMotion) -> Array:
    """Return the null motion at the nodes, joint by joint."""
    return np.asarray(null_motion_of(motion).T.ravel())


def _active(optimum: Optimum) -> tuple[ActiveConstraint, ...]:
    """Return the constraints that limit an optimum."""
    if not (optimum.multipliers.any() or optimum.end_multipliers.size):
        return ()
    motion, grid = optimum.motion, optimum.motion.grid
    each = multipliers_of(grid.rows, optimum.multipliers, motion.curve_ends)
    ends = grid.ends.by_item(optimum.end_multipliers)
    for item in grid.conditions.ends:
        own = ends[id(item)][None]
        each.append(Multipliers(item, own, np.zeros(1), np.ones(own.shape, dtype=np.bool_)))
    least, most = (share * abs(motion.cost) for share in (_MIN_SAVING, _MAX_SAVING))
    return active_of(each, grid.t[[0, -1]], least, most)


def is_kept(motion: NodeMotion) -> bool:
    """Whether a motion satisfies all conditions."""
    # Written so that NaN is not.
    ends = np.abs(motion.c).max(initial=0.0) <= ENDS_MET and not motion.elsewhere
    return bool(motion.violation <= 0.0 and ends)


def rank_of(motion: NodeMotion, begun: NodeMotion) -> tuple[bool, bool, float]:
    """Return the sort key of motions, the smaller the better.

    A unit of violation, or all of it where the motion that all `begun` with has less, has a penalty
    in multiples of the cost of that one: where no condition can be satisfied, not at any price.
    """
    most = UNKEPT * abs(begun.objective)
    if is_kept(motion):
        return False, False, motion.objective
    of_all = min(1.0, _unmet(begun)) or 1.0
    return True, motion.objective > most, motion.objective + most * _unmet(motion) / of_all


def _unmet(motion: NodeMotion) -> float:
    """Return by how much conditions are broken."""
    far = max(motion.elsewhere.values(), default=0.0)
    return motion.violation + float(np.abs(motion.c).max(initial=0.0)) + far

"""Published method on successive grids: optimisation on one grid, then on halved ones.

It ends where the cost has converged.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self, TypeVar

import numpy as np

from selfmotion.basics import (
    Array,
    BreakdownError,
    Counts,
    Flags,
    ProblemError,
    read_only,
    shown,
)
from selfmotion.model.motion import Evaluation, Grid
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.optimise import (
    Callback,
    Function,
    Iteration,
    Minimum,
    Optimizer,
    QuasiNewton,
    Status,
)
from selfmotion.planning.paper.ends import Eliminated, closed, from_unknowns, to_unknowns
from selfmotion.planning.paper.objective import Objective, parts_of, require_finite_at, unmet
from selfmotion.planning.rollout import MAX_HALVINGS, MinimumNormMotion
from selfmotion.problem.constraints import BoundConstraint

# Relative change of the cost between two grids at which it has converged.
_AGREEMENT = 1e-4
# Ratio of the costs on successive grids that indicates divergence.
_COST_GROWTH = 1.5
# Such ratios in succession after which refinement ends: the path leaves the workspace between
# nodes.
_MAX_GROWTHS = 2
# Largest number of bases of the unknowns on one grid.
_MAX_BASES = 200
# Relative decrease of the cost that justifies another basis.
_MIN_DECREASE = 1e-6
# Statuses after which another basis is tried.
_MAY_NEED_NEW_BASIS = (Status.PRECISION, Status.GRADIENT)
# Statuses after which the grid is not refined.
_FINAL_STATUSES = (
    Status.UNBOUNDED,
    Status.GRADIENT,
    Status.INFEASIBLE,
    Status.MAX_EVALUATIONS,
)


class _Recorder:
    """Callback of an optimiser: records iterates as decision vectors, stops it for a new basis.

    Parameters
    ----------
    to_decision : callable
        Returns the decision vector of an iterate, and whether another basis is better from there.
    callback : callable or None
        The user's; called with each `Iteration` of decision vectors.
    skips_first : bool
        Whether the first iterate is recorded already, as the last one in another basis.

    Attributes
    ----------
    iterates : list of Iteration
    needs_new_basis : bool
    """

    def __init__(
        self,
        to_decision: Callable[[Array], tuple[Array, bool]],
        callback: Callback | None,
        skips_first: bool,
    ) -> None:
        self._to_decision, self._callback = to_decision, callback
        self._skips_next = skips_first
        self.iterates: list[Iteration] = []
        self.needs_new_basis = False

    def __call__(self, iteration: Iteration) -> bool:
        """Record an iterate; return whether the optimiser has to stop."""
        if self._skips_next:
            self._skips_next = False
            return False
        point, is_far = self._to_decision(iteration.x)
        self.iterates.append(replace(iteration, x=read_only(point)))
        stops = self._callback is not None and bool(self._callback(self.iterates[-1]))
        self.needs_new_basis = is_far and not stops
        return is_far or stops


@dataclass(frozen=True, eq=False)
class MethodInputs:
    """Inputs of the published method that are the same on all grids.

    Attributes
    ----------
    formulation : Formulation
        Its null motion and costs are used; of its constraints, only `ends`.
    minimum_norm : MinimumNormMotion
        The motion at x = 0.
    free : bool
        Whether the start may move along its self-motion.
    ends : tuple of BoundConstraint
        Equality constraints on the ends of the motion, bound to that at x = 0; they are eliminated.
    optimizer : Optimizer
        Minimises the cost.
    counts : Counts
        Counter of evaluations.
    limit : int or None
        Largest value of `counts.evaluations`; None for no limit.
    callback : callable or None
        Called with each `Iteration` of decision vectors; returning True stops.
    """

    formulation: Formulation
    minimum_norm: MinimumNormMotion
    free: bool
    ends: tuple[BoundConstraint, ...]
    optimizer: Optimizer
    counts: Counts
    limit: int | None
    callback: Callback | None

    def on(self, grid: Grid) -> Objective:
        """Return the objective on a grid."""
        return Objective.of(
            self.formulation,
            self.minimum_norm,
            grid=grid,
            free=self.free,
            ends=self.ends,
            counts=self.counts,
        )

    def minimum(
        self,
        function: Function,
        x: Array,
        inverse_hessian: Array | None,
        to_decision: Callable[[Array], tuple[Array, bool]] = lambda x: (x, False),
        skips_first: bool = False,
    ) -> tuple[Minimum, list[Iteration], bool]:
        """Return a function's minimum, the iterates, and whether a new basis is needed.

        Iterates are decision vectors; see `_Recorder`. For a new basis the optimiser was stopped.
        """
        recorder = _Recorder(to_decision, self.callback, skips_first)
        # Without unknowns any optimiser will do; a user's may not accept an empty vector.
        optimizer = self.optimizer if len(x) else QuasiNewton()
        minimum = optimizer.minimize(
            function, x, inverse_hessian, max_evaluations=self.limit, callback=recorder
        )
        _require_minimum(minimum, x, optimizer)
        return minimum, recorder.iterates, recorder.needs_new_basis


def _require_minimum(minimum: Any, x: Array, optimizer: Optimizer) -> None:
    """Raise ProblemError where a user's optimiser returns no finite minimum."""
    is_minimum = isinstance(minimum, Minimum)
    if is_minimum and np.shape(minimum.x) == x.shape and np.all(np.isfinite(minimum.x)):
        return
    what = f"x = {shown(minimum.x)}" if is_minimum else shown(minimum)
    raise ProblemError(
        f"optimizer: {type(optimizer).__name__} returned {what}, expected a Minimum of "
        f"{len(x)} finite numbers; selfmotion.testing.check_optimizer checks an optimiser"
    )


_Motion = TypeVar("_Motion", bound="PublishedMotion")


@dataclass(frozen=True, eq=False)
class PublishedMotion:
    """A motion of the published method on one grid; made by `selfmotion.planning.planner`.

    Attributes
    ----------
    method : MethodInputs
    objective : Objective
        The cost as a function of x on one grid.
    x : (size,)
        The decision vector [z | coefficients].
    inverse_hessian : (size, size) or None
        The optimiser's last estimate; None before the first optimisation.
    status : Status
        How the last optimisation ended; INFEASIBLE where the ends cannot be met from here.
    history : tuple of Iteration
        Iterations on all grids so far.
    """

    method: MethodInputs
    objective: Objective
    x: Array
    inverse_hessian: Array | None = None
    status: Status = Status.STOPPED
    history: tuple[Iteration, ...] = ()

    @property
    def coefficients(self) -> Array:
        """The null motion's coefficients, (size without z,)."""
        return parts_of(self.objective, self.x)[1].copy()

    @property
    def steps(self) -> int:
        """Number N of steps of the grid."""
        return self.objective.grid.steps

    @cached_property
    def cost(self) -> float:
        """The cost F(x)."""
        return self.objective.value(self.x)

    @cached_property
    def nodes(self) -> Array:
        """The motion at the nodes of its grid, (N + 1, n) [rad or m]."""
        return read_only(self.objective.samples(self.x).q[self.objective.grid.node_stages])

    @cached_property
    def unmet(self) -> tuple[str, ...]:
        """Violated conditions on ends, in words."""
        return unmet(self.objective, self.x)

    @property
    def evaluation(self) -> Evaluation:
        """The motion with its costs."""
        return self.objective.at(self.x)

    @property
    def minimum_norm_evaluation(self) -> Evaluation:
        """The motion at x = 0 on this grid."""
        return self.objective.at(np.zeros_like(self.x))

    def refined(self, where: Flags | None = None) -> Self:
        """Return the motion with all steps halved, or those of the mask (N,).

        The end conditions are met again; the cost is not optimised.

        Raises
        ------
        BreakdownError
            The motion breaks down on that grid.
        """
        return self._with_objective(self.method.on(self.objective.grid.halved(where)))

    def optimised(self) -> Self:
        """Return the optimum on this grid; after a keyboard interrupt, the best motion so far."""
        if self.unmet:
            return replace(self, status=Status.INFEASIBLE)
        motion, size = self, None
        try:
            for _ in range(_MAX_BASES):
                previous = motion
                motion, size = motion._optimised_in_basis(size)
                # Without a step, other combinations may meet the ends.
                if size is None or motion.status not in _MAY_NEED_NEW_BASIS:
                    break
                if not previous.cost - motion.cost > _MIN_DECREASE * abs(motion.cost):
                    break
        except KeyboardInterrupt:
            return replace(motion, status=Status.INTERRUPTED)
        return motion

    def converged(self) -> Self:
        """Return the optimum on this grid, then on halved grids until the cost converges."""
        try:
            return _on_finer_grids(self._with_objective(self.objective).optimised())
        except KeyboardInterrupt:
            return replace(self, status=Status.INTERRUPTED)

    def _optimised_in_basis(self, size_before: int | None) -> tuple[Self, int | None]:
        """Return the optimum in one basis of the unknowns, and their number.

        None where nothing is eliminated, or the ends cannot be met in this basis. `size_before` is
        the number of unknowns of the previous basis; None for the first.
        """
        method, objective, inverse = self.method, self.objective, self.inverse_hessian
        size = None
        if objective.ends and len(self.x):
            function = Eliminated(objective, self.x)
            size, y = function.size, np.zeros(function.size)
            if size_before not in (None, size):
                # Conditions are dependent here that are not elsewhere.
                return self, None
            if not function.is_met(y):
                return replace(self, status=Status.INFEASIBLE), None
            inverse = None if inverse is None else to_unknowns(function, inverse)
            minimum, iterates, needs_new_basis = method.minimum(
                function, y, inverse, function.where, skips_first=size_before is not None
            )
            x = function.point(minimum.x)
            inverse = from_unknowns(function, minimum.x, minimum.inverse_hessian)
        else:
            minimum, iterates, needs_new_basis = method.minimum(objective, self.x, inverse)
            x, inverse = np.array(minimum.x), minimum.inverse_hessian
        status = Status.PRECISION if needs_new_basis else minimum.status
        history = (*self.history, *iterates)
        optimum = replace(self, x=x, inverse_hessian=inverse, status=status, history=history)
        return optimum, size

    def _with_objective(self, objective: Objective) -> Self:
        """Return the motion with another objective of the same unknowns, and its ends met."""
        if not np.isfinite(objective.value(self.x)):
            require_finite_at(objective, self.x)
        x = closed(objective, self.x) if objective.ends and len(self.x) else self.x
        return replace(self, objective=objective, x=x)


def _on_finer_grids(motion: _Motion) -> _Motion:
    """Return the optimum on the first halved grid on which its cost has converged."""
    growths = 0
    most = motion.method.minimum_norm.grid.steps * 2**MAX_HALVINGS
    try:
        while motion.steps < most and not _is_final(motion.status):
            finer = motion.refined()
            cost, change = motion.cost, _change(motion.cost, finer.cost)
            growths = growths + 1 if finer.cost > _COST_GROWTH * abs(cost) else 0
            if growths == _MAX_GROWTHS:
                return finer
            motion = finer.optimised()
            # The optimum has to agree, too: on a coarse grid it may be no motion.
            if max(change, _change(cost, motion.cost)) <= _AGREEMENT:
                break
    except BreakdownError:
        # On a finer grid there is no such motion: the present one is judged.
        pass
    except KeyboardInterrupt:
        motion = replace(motion, status=Status.INTERRUPTED)
    return motion


def _is_final(status: Status) -> bool:
    """Whether an optimisation ended so that the grid is not refined."""
    return status.is_cut_short or status in _FINAL_STATUSES


def _change(before: float, after: float) -> float:
    """Return the relative change of a cost."""
    return abs(after - before) / max(abs(before), float(np.finfo(float).tiny))

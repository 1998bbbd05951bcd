"""The published method from one start, on grids as fine as the cost needs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self, TypeVar

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
from selfmotion.planning.rollout import MOST_HALVINGS, MinimumNormMotion
from selfmotion.problem.constraints import BoundConstraint

# Relative agreement of the cost on a grid and on the halved one.
_AGREEMENT = 1e-4
# Factor of a rise of the cost from grid to grid.
_RISE = 1.5
# Such grids in turn that show a cost without limit: the path leaves the workspace between nodes.
_RISES = 2
# Changes of the unknowns' basis far from the reference …
_CHARTS = 200
# … while the cost falls by this share with each.
_FALL = 1e-6
# Statuses that a change of basis may mend …
_STUCK = (Status.PRECISION, Status.GRADIENT)
# … and those after which nothing goes on.
_OVER = (Status.UNBOUNDED, Status.GRADIENT, Status.INFEASIBLE, Status.MAX_EVALUATIONS)


@dataclass(frozen=True, eq=False)
class Method:
    """Common data of all solutions from one start; see `solve`.

    Attributes
    ----------
    formulation : Formulation
    minimum_norm : MinimumNormMotion
    free : bool
    ends : tuple of BoundConstraint
    optimizer : Optimizer
    counts : Counts
    limit : int or None
        Of `Counts.evaluations`.
    callback : callable or None
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
        where: Callable[[Array], tuple[Array, bool]] = lambda x: (x, False),
        known: bool = False,
    ) -> tuple[Minimum, list[Iteration], bool]:
        """Return a function's minimum, the decision vectors on the way, and whether to go on.

        `where` returns these, and whether another basis is better from there; `known` is whether
        the callback has had the start.
        """
        iterates: list[Iteration] = []
        goes_on = False

        def note(iteration: Iteration) -> bool:
            nonlocal goes_on
            point, is_far = where(iteration.x)
            iterates.append(replace(iteration, x=read_only(point)))
            if known and len(iterates) == 1:
                return False
            stops = self.callback is not None and bool(self.callback(iterates[-1]))
            goes_on = is_far and not stops
            return is_far or stops

        # Of no unknowns any point is the minimum.
        optimizer = self.optimizer if len(x) else QuasiNewton()
        found = optimizer.minimize(
            function, x, inverse_hessian, max_evaluations=self.limit, callback=note
        )
        what = f"x = {shown(found.x)}" if isinstance(found, Minimum) else shown(found)
        if (
            not isinstance(found, Minimum)
            or np.shape(found.x) != x.shape
            or not np.all(np.isfinite(found.x))
        ):
            raise ProblemError(
                f"optimizer: {type(optimizer).__name__} returned {what}, expected a Minimum of "
                f"{len(x)} finite numbers; selfmotion.testing.check_optimizer checks an optimiser"
            )
        return found, iterates[known:], goes_on


@dataclass(frozen=True, eq=False)
class Solution:
    """A motion of the published method on one grid; made by `solve`.

    Attributes
    ----------
    method : Method
    objective : Objective
        On its grid.
    x : (size,)
        The decision vector [z | coefficients].
    inverse_hessian : (size, size) or None
        The optimiser's last estimate; None before the first optimisation.
    status : Status
        How the last optimisation ended; INFEASIBLE where the ends cannot be met from here.
    history : tuple of Iteration
        On all grids.
    """

    method: Method
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
        """Of its grid."""
        return self.objective.grid.steps

    @cached_property
    def cost(self) -> float:
        """F."""
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
        """Return it with half the step length, for all or some of the steps (N,).

        With its ends met there, but not optimised anew.

        Raises
        ------
        BreakdownError
            The motion breaks down on that grid.
        """
        return self._on(self.method.on(self.objective.grid.halved(where)))

    def again(self) -> Self:
        """Return the optimum on its grid, from here; after an interruption, the best so far."""
        if self.unmet:
            return replace(self, status=Status.INFEASIBLE)
        found, size = self, None
        try:
            for _ in range(_CHARTS):
                before = found
                found, size = found._optimised(size)
                # Without a step, other combinations may meet the ends.
                if size is None or found.status not in _STUCK:
                    break
                if not before.cost - found.cost > _FALL * abs(found.cost):
                    break
        except KeyboardInterrupt:
            return replace(found, status=Status.INTERRUPTED)
        return found

    def settled(self) -> Self:
        """Return the optimum on its grid, and on halved ones until the cost agrees."""
        try:
            return _converged(self._on(self.objective).again())
        except KeyboardInterrupt:
            return replace(self, status=Status.INTERRUPTED)

    def _optimised(self, before: int | None) -> tuple[Self, int | None]:
        """Return the optimum as far as the unknowns lead, and their number; None for x itself.

        `before` is the number of earlier iterations: the callback has had the start then.
        """
        method, objective, inverse = self.method, self.objective, self.inverse_hessian
        size = None
        if objective.ends and len(self.x):
            function = Eliminated(objective, self.x)
            size, y = function.size, np.zeros(function.size)
            if before not in (None, size):
                # Conditions are dependent here that are not elsewhere.
                return self, None
            if not function.is_met(y):
                return replace(self, status=Status.INFEASIBLE), None
            inverse = None if inverse is None else to_unknowns(function, inverse)
            found, iterates, left = method.minimum(
                function, y, inverse, function.where, before is not None
            )
            x = function.point(found.x)
            inverse = from_unknowns(function, found.x, found.inverse_hessian)
        else:
            found, iterates, left = method.minimum(objective, self.x, inverse)
            x, inverse = np.array(found.x), found.inverse_hessian
        status = Status.PRECISION if left else found.status
        history = (*self.history, *iterates)
        better = replace(self, x=x, inverse_hessian=inverse, status=status, history=history)
        return better, size

    def _on(self, objective: Objective) -> Self:
        """Return it with another objective of the same unknowns, with its ends met."""
        if not np.isfinite(objective.value(self.x)):
            require_finite_at(objective, self.x)
        x = closed(objective, self.x) if objective.ends and len(self.x) else self.x
        return replace(self, objective=objective, x=x)


_Solution = TypeVar("_Solution", bound=Solution)


def solve(
    formulation: Formulation,
    minimum_norm: MinimumNormMotion,
    *,
    free: bool = False,
    ends: Sequence[BoundConstraint] = (),
    optimizer: Optimizer | None = None,
    counts: Counts | None = None,
    most: int | None = None,
    callback: Callback | None = None,
    x0: Array | None = None,
) -> Solution:
    """Return the optimum of the published method around a motion at x = 0.

    On its grid, then on halved ones, until the cost agrees with that on the grid before.

    Parameters
    ----------
    formulation : Formulation
        Its null motion and costs are used; of its constraints, only `ends`.
    minimum_norm : MinimumNormMotion
        The motion at x = 0.
    free : bool
        Whether the start may move along its self-motion.
    ends : sequence of BoundConstraint
        Equalities on the ends of the motion, bound to that at x = 0; they are eliminated.
    optimizer : Optimizer, optional
        By default `QuasiNewton`.
    counts : Counts, optional
        Where work is added up.
    most : int, optional
        Evaluations of F at most.
    callback : callable, optional
        Called with each `Iteration`, of decision vectors; returning True stops.
    x0 : (size,), optional
        Initial decision vector; by default, and if that is no motion, 0.

    Returns
    -------
    Solution
        After an interruption from the keyboard, the best so far.

    Raises
    ------
    BreakdownError
        The motion at x = 0 breaks down.
    ProblemError
        A cost has no finite value on the initial motion, a condition on the ends is no equality, or
        a user's optimiser returns no decision vector.
    """
    counts = Counts() if counts is None else counts
    limit = None if most is None else counts.evaluations + most
    own = QuasiNewton() if optimizer is None else optimizer
    method = Method(formulation, minimum_norm, free, tuple(ends), own, counts, limit, callback)
    objective = method.on(minimum_norm.grid)
    x = np.zeros(objective.size)
    if x0 is not None and np.isfinite(objective.value(x0)):
        x = np.array(x0, dtype=np.float64)
    return Solution(method, objective, x).settled()


def _converged(found: _Solution) -> _Solution:
    """Return the optimum on halved grids, once its cost agrees with that on the one before."""
    rises, most = 0, found.method.minimum_norm.grid.steps * 2**MOST_HALVINGS
    try:
        while found.steps < most and not (found.status.is_cut_short or found.status in _OVER):
            finer = found.refined()
            before, changed = found.cost, _change(found.cost, finer.cost)
            rises = rises + 1 if finer.cost > _RISE * abs(before) else 0
            if rises == _RISES:
                return finer
            found = finer.again()
            # The optimum has to agree, too: on a coarse grid it may be no motion.
            if max(changed, _change(before, found.cost)) <= _AGREEMENT:
                break
    except BreakdownError:
        # On a finer grid there is no such motion: the present one is judged.
        pass
    except KeyboardInterrupt:
        found = replace(found, status=Status.INTERRUPTED)
    return found


def _change(before: float, after: float) -> float:
    """Return the relative change of a cost."""
    return abs(after - before) / max(abs(before), float(np.finfo(float).tiny))

"""Primal-dual interior-point method on the self-motion manifolds of all nodes at once.

Rows h(w) ≤ 0 are elastic, h + s - e = 0 with s, e > 0 and a penalty ρ e, so that a start may
violate limits or be inside a body. Each step is Newton's for the perturbed KKT conditions

    ∇F + λᵀ∂h = 0,   s λ = μ,   e (ρ - λ) = μ,   with a barrier parameter μ that falls

(J. Nocedal, S. Wright, "Numerical Optimization", 2nd ed., chapter 19; elastic variables: R.
Fletcher, "Practical Methods of Optimization", 2nd ed., 14.3). Eliminating the steps of s, e and λ
leaves a matrix of the nodes alone. Each row involves two neighbours, so that the matrix is
block-tridiagonal, and a step takes time in proportion to the number of nodes. A step moves the
curve along linear rows, and is retracted onto the path, see `moved_along`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.planning.nodes.motion import NodeMotion, moved_along
from selfmotion.planning.nodes.newton_kernels import (
    largest_share,
    merit_of_rows,
    move_rows,
    row_residuals,
    slope_of_rows,
)
from selfmotion.planning.nodes.newton_system import Change, ElasticRows, Model, System
from selfmotion.planning.nodes.settings import SETTINGS
from selfmotion.planning.optimise import Status


class Step(NamedTuple):
    """An iteration.

    Attributes
    ----------
    motion : NodeMotion
    slope : float
        Norm of the gradient of the objective.
    length : float
        Accepted share of Newton's step; 0 of the first iteration.
    """

    motion: NodeMotion
    slope: float
    length: float


Callback = Callable[[Step], bool]
"""Called with each iteration; True stops."""


@dataclass(frozen=True, eq=False)
class Optimum:
    """Result of Newton's method.

    Attributes
    ----------
    motion : NodeMotion
    multipliers : (R,)
        λ of all rows; 0 of inactive ones.
    status : Status
    promised : float
        Predicted decrease of the cost by another step.
    end_multipliers : (E,)
        Of the conditions on the ends.
    is_rough : bool
        Whether it is within the loose tolerances alone.
    """

    motion: NodeMotion
    multipliers: Array
    status: Status
    promised: float
    end_multipliers: Array
    is_rough: bool


def minimise(
    start: NodeMotion,
    callback: Callback,
    multipliers: Array | None = None,
    *,
    roughly: bool = False,
    max_iterations: int = SETTINGS.max_iterations,
    mu_first: float = SETTINGS.mu_first,
) -> Optimum:
    """Return the local optimum near a motion.

    Parameters
    ----------
    start : NodeMotion
    callback : callable
    multipliers : (R,), optional
        Warm start: those of a neighbouring optimum.
    roughly : bool
        Whether loose tolerances are enough: the result is a start of another optimisation.
    max_iterations : int
        Limit of iterations.
    mu_first : float
        First barrier parameter without multipliers, in the unit of `NewtonSettings.mu_first`.
    """
    solver = _Solver(start, multipliers, mu_first, roughly=roughly)
    smallest, stalled, short = np.inf, 0, 0
    for _ in range(max_iterations):
        status = solver.advance(callback)
        if status is not None:
            return solver.optimum(status)
        short = short + 1 if solver.length < SETTINGS.short_length else 0
        if short == SETTINGS.short_steps:
            # As where no step is accepted at all.
            ended = Status.PRECISION if solver.promises_little else Status.INFEASIBLE
            return solver.optimum(ended)
        violation, stalled = solver.motion.violation, stalled + 1
        falls = violation < SETTINGS.stall_factor * smallest
        if falls or violation <= SETTINGS.gauss_newton_violation:
            smallest, stalled = violation, 0
        if stalled >= SETTINGS.stall_iterations:
            return solver.optimum(Status.INFEASIBLE)
    return solver.optimum(Status.MAX_ITERATIONS)


class _Solver:
    """Iterate of Newton's method: a motion, slacks, multipliers and the barrier parameter.

    s, e and λ are those of the active rows, in their order; `length` is the accepted share of the
    last step.
    """

    def __init__(
        self, start: NodeMotion, multipliers: Array | None, mu_first: float, *, roughly: bool
    ) -> None:
        self.motion, h = start, start.h
        # Of the active rows, (K,).
        self._h = np.zeros(0)
        self._cost_scale = max(abs(start.objective), np.finfo(float).tiny)
        each = self._cost_scale / max(int((h > -1e2).sum()), 1)
        self._looseness = SETTINGS.rough_factor if roughly else 1.0
        self._finest_barrier, self._rho = SETTINGS.mu_last * each, SETTINGS.rho * self._cost_scale
        # From the multipliers of a neighbouring optimum, the finest is as near.
        ends_early = roughly and (multipliers is None or not multipliers.any())
        self._last_barrier = SETTINGS.mu_warm * each if ends_early else self._finest_barrier
        self._barrier = (mu_first if multipliers is None else SETTINGS.mu_warm) * each
        self._rho_updates = 0
        self._active: Flags = np.zeros(len(h), dtype=np.bool_)
        self._slacks = self._elastics = self._multipliers = np.zeros(0)
        self._update_active_set()
        if multipliers is not None:
            _warm_start(self, multipliers)
        self._merit_penalty, self._predicted, self.length, self._shift = 0.0, np.inf, 0.0, 0.0
        self._end_multipliers = np.zeros(start.grid.ends.count)
        self._multiplier_change = np.inf if self._multipliers.size else 0.0

    def _update_active_set(self) -> None:
        """Add rows that are near to being violated to the active set."""
        motion = self.motion
        x = motion.h
        near = motion.grid.rows.near(x) | self._active
        if np.count_nonzero(near) == len(self._slacks):
            self._h = x[self._active]
            return
        slacks = np.maximum(-x, SETTINGS.min_slack) + SETTINGS.first_elastic
        full = slacks, x + slacks, np.minimum(self._barrier / slacks, 0.5 * self._rho)
        for values, own in zip(
            full, (self._slacks, self._elastics, self._multipliers), strict=True
        ):
            values[self._active] = own
        self._active, self._h = near, x[near]
        self._slacks, self._elastics, self._multipliers = (values[near] for values in full)

    @property
    def promises_little(self) -> bool:
        """Whether the predicted decrease is so small that rounding may hide it."""
        return self._predicted <= SETTINGS.rounding * self._cost_scale

    def optimum(self, status: Status) -> Optimum:
        """Return the iterate as a result."""
        return Optimum(
            self.motion,
            self._rows.of_all(self._multipliers),
            status,
            self._predicted,
            self._end_multipliers,
            not self._is_fine,
        )

    def advance(self, callback: Callback) -> Status | None:
        """Take a step; return the status where the method ends."""
        if self._predicts_convergence():
            callback(Step(self.motion, 0.0, self.length))
            return Status.CONVERGED
        model = Model.of(self.motion, self._rows, self._end_multipliers)
        if model is None:
            return Status.GRADIENT
        slope = float(np.linalg.norm(model.gradient))
        if callback(Step(self.motion, slope, self.length)):
            return Status.STOPPED
        system = self._system(model)
        if system is None:
            return Status.GRADIENT
        while True:
            step = self._step(system)
            last = self._is_last_barrier
            self._multiplier_change = _relative_change(self, step.multipliers)
            converged = last and _is_converged(self, self._looseness)
            converged &= self._multiplier_change <= SETTINGS.multiplier_tolerance
            if (converged or _is_barrier_solved(self)) and _raise_rho(self):
                system = self._system(model)
                if system is None:
                    return Status.GRADIENT
                return self._line_search(model, self._step(system))
            if converged:
                self._end_multipliers = step.end_multipliers
                return Status.CONVERGED
            if last or not _is_barrier_solved(self):
                return self._line_search(model, step)
            self._barrier = max(
                self._last_barrier,
                min(SETTINGS.kappa_mu * self._barrier, self._barrier**SETTINGS.theta_mu),
            )

    @property
    def _is_last_barrier(self) -> bool:
        """Whether μ does not fall any more; without active rows there is no barrier."""
        return not self._multipliers.size or self._barrier <= self._last_barrier

    @property
    def _is_fine(self) -> bool:
        """Whether the iterate is within the tightest tolerances."""
        is_low = not self._multipliers.size or self._barrier <= self._finest_barrier
        return is_low and _is_converged(self, 1.0)

    @property
    def _rows(self) -> ElasticRows:
        return ElasticRows(
            self._h,
            self._slacks,
            self._elastics,
            self._multipliers,
            self._rho,
            self._active,
        )

    def _system(self, model: Model) -> System | None:
        """Return the factorised linear system; None where it is singular."""
        found = System.of(self.motion, model, self._rows, self._barrier, self._shift)
        if found is not None:
            self._shift = found.shift
        return found

    def _step(self, system: System) -> Change:
        """Return the step for the present μ."""
        step = system.step(self._barrier)
        self._predicted = step.promised
        return step

    def _predicts_convergence(self) -> bool:
        """Whether quadratic convergence predicts no further decrease."""
        promised = self._predicted / self._cost_scale
        full = self.length == 1.0
        if not (full and promised <= SETTINGS.quadratic_share and self._is_last_barrier):
            return False
        if self._multiplier_change > np.sqrt(SETTINGS.multiplier_tolerance):
            return False
        before, self._predicted = self._predicted, promised**2 * self._cost_scale
        if _is_converged(self, self._looseness):
            return True
        self._predicted = before
        return False

    def _line_search(self, model: Model, step: Change) -> Status | None:
        """Take a step as far as a backtracking line search on the merit function allows."""
        motion, r = self.motion, step.nodes.shape[1] // 3
        promise = _raise_merit_penalty(self, model, step)
        merit = _merit(self, motion, self._h, self._slacks, self._elastics)
        largest = float(np.abs(step.nodes[:, :r]).max())
        length = SETTINGS.max_change / max(largest, SETTINGS.max_change)
        for values, change in ((self._slacks, step.slacks), (self._elastics, step.elastics)):
            length = min(length, _to_boundary(values, change))
        is_opposed, tried = False, 0
        while length >= SETTINGS.min_length:
            tried += 1
            new = moved_along(motion, length * step.nodes, model.around.changes)
            if new is not None and np.isfinite(new.objective):
                moved = np.empty((2, len(self._slacks)))
                h = new.h[self._active]
                given = h, self._slacks, self._elastics, step.slacks, step.elastics
                move_rows(*given, length, moved)
                gained = merit - _merit(self, new, h, *moved)
                # Written so that NaN is rejected; 1e-13 is rounding of the merit.
                if gained >= -SETTINGS.armijo * length * min(promise, 0.0) - 1e-13 * abs(merit):
                    share = min(
                        _to_boundary(self._multipliers, step.multipliers),
                        _to_boundary(self._rho - self._multipliers, -step.multipliers),
                    )
                    self._multipliers = self._multipliers + share * step.multipliers
                    self._slacks, self._elastics = moved
                    self.motion, self.length = new, length
                    self._end_multipliers = step.end_multipliers
                    self._update_active_set()
                    return None
                if abs(gained) > SETTINGS.visible * abs(merit):
                    is_opposed = gained < 0.5 * length * promise
                # The kinks of the penalty are no parabola: most steps are cut once or twice.
                is_far = tried > SETTINGS.halvings
                length = (
                    _shorter(length, promise, gained) if is_far else SETTINGS.backtracking * length
                )
            else:
                length *= SETTINGS.backtracking
        conditions = self._multipliers.size or len(self._end_multipliers)
        if self.promises_little and (conditions or not is_opposed):
            return Status.PRECISION
        # A large predicted decrease that no step has, or a rise in place of one: the gradient is
        # wrong, or rows conflict.
        return Status.INFEASIBLE if conditions else Status.GRADIENT


def _shorter(length: float, slope: float, gained: float) -> float:
    """Return the length to try after one that is rejected.

    Of the parabola through what the merit function is and how steep it falls at the start, and what
    it `gained` there, as far as it is within bounds [NW 3.5].
    """
    bent = -gained - slope * length
    least = -0.5 * slope * length**2 / bent if bent > 0.0 > slope else np.inf
    return max(SETTINGS.backtracking_least * length, min(SETTINGS.backtracking * length, least))


def _warm_start(solver: _Solver, multipliers: Array) -> None:
    """Warm start: set s, e, λ and μ by multipliers of all rows, (R,)."""
    h, known = solver._h, multipliers[solver._active]
    usual = solver._barrier / np.maximum(-h, SETTINGS.min_slack_warm)
    solver._multipliers = np.clip(np.maximum(known, usual), None, 0.5 * solver._rho)
    slacks = np.maximum(-h, solver._barrier / solver._multipliers)
    solver._elastics = np.maximum(h + slacks, 0.0) + solver._barrier / (
        solver._rho - solver._multipliers
    )
    solver._slacks = np.maximum(slacks, solver._elastics - h)
    # Multipliers of other rows need a larger μ: the mean product with these slacks.
    product = float(np.mean(solver._slacks * solver._multipliers)) if len(h) else 0.0
    most = SETTINGS.mu_first / SETTINGS.mu_warm * solver._barrier
    solver._barrier = min(max(solver._barrier, product), most)


def _raise_rho(solver: _Solver) -> bool:
    """Penalty update: raise ρ where violated rows have multipliers near it; return whether."""
    saturated = solver._multipliers > SETTINGS.saturated * solver._rho
    saturated &= solver._h > SETTINGS.violated
    if solver._rho_updates == SETTINGS.max_rho_updates or not saturated.any():
        return False
    solver._rho_updates += 1
    solver._rho *= SETTINGS.rho_factor
    return True


def _relative_change(solver: _Solver, step: Array) -> float:
    """Return the change of the multipliers by a step, relative to their sum."""
    known = float(solver._multipliers.sum()) + SETTINGS.multiplier_floor * solver._cost_scale
    return float(np.abs(step).sum()) / known


def _is_converged(solver: _Solver, looseness: float) -> bool:
    """Whether residuals and predicted decrease are within the tolerances, or a multiple of them."""
    with_rows = solver._multipliers.size > 0
    tolerance = SETTINGS.cost_tolerance_with_rows if with_rows else SETTINGS.cost_tolerance
    tolerance *= solver._cost_scale * looseness
    if not solver._predicted <= tolerance:
        return False
    primal, complementary = _residuals(solver)
    met = primal <= SETTINGS.row_tolerance * looseness
    met &= complementary <= SETTINGS.complementarity * solver._barrier
    return bool(met and np.abs(solver.motion.c).max(initial=0.0) <= SETTINGS.end_tolerance)


def _is_barrier_solved(solver: _Solver) -> bool:
    """Whether the barrier problem is solved to κ_ε μ."""
    allowed = SETTINGS.kappa_epsilon * solver._barrier
    if not solver._predicted <= allowed:
        return False
    primal, complementary = _residuals(solver)
    return bool(primal <= SETTINGS.barrier_row_tolerance and complementary <= allowed)


def _residuals(solver: _Solver) -> tuple[float, float]:
    """Return the largest primal residual of rows that matter, and that of complementarity."""
    barrier = solver._barrier
    rows = solver._h, solver._slacks, solver._elastics, solver._multipliers
    return row_residuals(*rows, solver._rho, barrier, SETTINGS.inactive_share * barrier)


def _raise_merit_penalty(solver: _Solver, model: Model, step: Change) -> float:
    """Make a step a direction of descent of the merit function; return its derivative along it.

    Along Newton's step residuals close to first order, so that the derivative is that of cost and
    barrier terms minus ν times all residuals, with the penalty ν [NW 18.36].
    """
    rows = solver._h, solver._slacks, solver._elastics, step.slacks, step.elastics
    by_rows, gap = slope_of_rows(*rows, solver._rho, solver._barrier)
    slope = float(np.vdot(model.gradient, step.nodes)) + by_rows
    gap += float(np.abs(solver.motion.c).sum())
    if gap > 0.0:
        dearest = 1.5 * float(np.abs(step.end_multipliers).max(initial=0.0))
        solver._merit_penalty = max(solver._merit_penalty, 2.0 * slope / gap, dearest)
    solver._merit_penalty = max(solver._merit_penalty, SETTINGS.min_merit_penalty * solver._rho)
    return slope - solver._merit_penalty * gap


def _merit(solver: _Solver, motion: NodeMotion, h: Array, slacks: Array, elastics: Array) -> float:
    penalty = solver._merit_penalty
    rows = merit_of_rows(h, slacks, elastics, solver._rho, solver._barrier, penalty)
    return motion.objective + rows + penalty * float(np.abs(motion.c).sum())


def _to_boundary(values: Array, step: Array) -> float:
    """Return the largest share of a step, at most 1, by the fraction-to-the-boundary rule."""
    # Without compilation the kernel returns a scalar of NumPy.
    return float(largest_share(values, step, SETTINGS.tau))

"""One minimisation by sequential quadratic programming, step by step."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from selfmotion.basics import Array, ProblemError, read_only
from selfmotion.optimise.base import (
    Callback,
    ConstrainedFunction,
    Iteration,
    Minimum,
    Status,
    inverse_metric,
)
from selfmotion.optimise.derivative import is_misleading
from selfmotion.optimise.penalty import IGNORED, ExactPenalty, Point
from selfmotion.optimise.restoration import restored, scanned
from selfmotion.optimise.rows import DenseRows, Rows, ScaledRows, pulled_back
from selfmotion.optimise.step import Step, best_step
from selfmotion.optimise.update import damped, renewed

if TYPE_CHECKING:
    from selfmotion.optimise.sqp import SequentialQuadratic

# A step is taken when the penalty function falls by this share of what the model expects, and
# corrected first when it falls by less than the second.
_TAKEN, _POOR, _GOOD = 1e-3, 0.1, 0.75
# The trust region shrinks to this share of a step that failed, and grows by this factor.
_SHRINK, _GROW = 0.3, 2.5
# It is at first this many times the step that would lower a quadratic cost to nothing, and not
# worth going on with below this share of that.
_FIRST_REGION, _LAST_REGION = 2.0, 1e-9
# Variables are scaled by no less than this share of the largest scale, squared.
_FLATTEST = 1e-12
# Converged is what neither the present matrix nor the first foresees a gain from: of more than this
# share of F for the first, which is asked so often.
_DOUBTFUL, _DOUBTS = 1e-4, 3
# So many relaxed steps in turn have to take the violation to this share: conditions otherwise pull
# in opposite directions here, and are to be restored on another way.
_PATIENCE, _PROGRESS = 4, 0.7
# Trials of one step.
_TRIALS = 40


class Minimisation:
    """The state of one minimisation; p, gradients and rows are those of scaled variables."""

    def __init__(
        self,
        method: "SequentialQuadratic",
        function: ConstrainedFunction,
        x0: Array,
        max_evaluations: int | None,
        callback: Callback | None,
    ) -> None:
        self._method, self._function, self._callback = method, function, callback
        self._limit = np.inf if max_evaluations is None else max_evaluations
        self._history: list[Iteration] = []
        self._iterations, self._doubts = 0, 0
        here = self._point(np.array(x0, dtype=np.float64))
        if here is None:
            raise ProblemError("optimiser: the cost or a condition at the start is not finite")
        self._here = self._best = self._begun = here
        self._gradient = np.zeros(len(x0))
        self._rows: Rows = DenseRows(np.zeros((0, len(x0))))
        self._multipliers = np.zeros(len(here.at.h))
        self._begin(np.eye(len(x0)))

    def _begin(self, inverse_hessian: Array) -> None:
        """Scale the variables; begin with a new trust region and penalty."""
        values, vectors = np.linalg.eigh(inverse_hessian)
        least = _FLATTEST * float(np.max(values, initial=0.0))
        self._scale = vectors * np.sqrt(np.maximum(values, least))
        self._h, self._penalty = np.eye(len(values)), ExactPenalty()
        self._modelled = self._here.x
        self._region = _FIRST_REGION * max(np.sqrt(2.0 * abs(self._here.cost)), 1e-3)
        self._first_region, self._smallest = self._region, _LAST_REGION * self._region
        # The violations that relaxed steps in turn arrived at.
        self._relaxed: list[float] = []

    def until_done(self, inverse_hessian: Array | None) -> Status:
        """Descend, and where that ends in contradictions, begin again elsewhere."""
        status = self._descend(inverse_hessian)
        for attempt in range(self._method.restorations):
            if status is not Status.INFEASIBLE:
                return status
            before = self._best.at.worst
            status = self._begin_again(attempt)
            if attempt and self._best.at.worst > _PROGRESS * before:
                break
        went_astray = status is Status.INFEASIBLE and self._best.kept
        return Status.PRECISION if went_astray else status

    def _begin_again(self, attempt: int) -> Status:
        """Go on from the best point, after restoring its conditions if they are violated.

        At the second time from a point far away: small steps have led nowhere.
        """
        self._here, ended = self._best, None
        if not self._here.kept:
            x = self._afar() if attempt == 1 else self._here.x
            x, ended = restored(self._function, x, 10.0**attempt, self._limit, self._note)
            self._go(self._point(x) or self._here)
        return self._descend(None) if ended is None else ended

    def _afar(self) -> Array:
        """Return the best of some points around the first one, along the flattest directions."""
        order = np.argsort(-np.linalg.norm(self._first_scale, axis=0))
        full = np.sqrt(2.0 * abs(self._begun.cost)) * self._first_scale[:, order]
        return scanned(self._function, self._begun.x, full)

    def minimum(self, status: Status) -> Minimum:
        """Return the best point found."""
        end = self._here if status is Status.CONVERGED else self._best
        return Minimum(
            read_only(end.x),
            end.cost,
            self._scale @ self._h @ self._scale.T,
            tuple(self._history),
            status,
            read_only(self._multipliers),
        )

    def _descend(self, inverse_hessian: Array | None) -> Status:
        """Take steps until nothing is left to gain, or conditions pull in opposite directions."""
        if inverse_hessian is None:
            inverse_hessian = inverse_metric(self._function.metric(self._here.x))
        self._begin(inverse_hessian)
        if self._here is self._begun:
            self._first_scale = self._scale
        self._derive()
        if self._record("none", 0.0):
            return Status.STOPPED
        while self._iterations < self._method.max_iterations:
            self._iterations += 1
            status = self._iterate()
            if status is Status.CONVERGED and self._is_doubtful():
                self._h, self._doubts = np.eye(len(self._h)), self._doubts + 1
                self._region = self._first_region
            elif status is not None:
                return status
        return Status.MAX_ITERATIONS

    def _is_doubtful(self) -> bool:
        """Whether the first matrix foresees much more than the present one.

        That may have been bent where conditions were violated, far from here.
        """
        if self._doubts >= _DOUBTS:
            return False
        first = np.eye(len(self._h))
        step = best_step(self._gradient, first, self._here.at, self._rows, self._first_region)
        return step.gain > _DOUBTFUL * abs(self._here.cost)

    def _iterate(self) -> Status | None:
        try:
            hessian = np.linalg.inv(self._h)
        except np.linalg.LinAlgError:
            # Steps in which the gradient hardly changed left nothing of it: begin as at first.
            self._h = np.eye(len(self._h))
            hessian = self._h
        hessian = 0.5 * (hessian + hessian.T)
        for _ in range(_TRIALS):
            step = best_step(self._gradient, hessian, self._here.at, self._rows, self._region)
            self._multipliers = step.multipliers
            status = self._finished(step)
            if status is not None:
                return status
            self._penalty.raise_for(self._here, step)
            p, there, ratio = self._try(step, hessian)
            size = float(np.max(np.abs(p)))
            if there is not None and ratio >= _TAKEN:
                break
            self._region = _SHRINK * min(size, self._region)
        else:
            return self._without_progress(step)
        if ratio > _GOOD and size > 0.9 * self._region:
            self._region *= _GROW
        elif ratio < _POOR:
            self._region *= 0.5
        update = self._accept(p, there, step, hessian)
        return Status.STOPPED if self._record(update, 1.0) else None

    def _finished(self, step: Step) -> Status | None:
        """Return why there is nothing more to do, before a step is tried."""
        here = self._here
        small = step.gain <= self._method.tolerance * max(abs(here.cost), np.finfo(float).tiny)
        # A trust region that failures made small says nothing about what is left to gain.
        inside = float(np.max(np.abs(step.p), initial=0.0)) < 0.99 * self._region
        if not step.relaxed and here.kept and small:
            return Status.CONVERGED if inside else self._without_progress(step)
        if step.relaxed and self._stuck():
            return Status.INFEASIBLE
        if self._region < self._smallest or not np.any(step.p):
            return self._without_progress(step)
        if self._function.evaluations >= self._limit:
            return Status.MAX_EVALUATIONS
        return None

    def _without_progress(self, step: Step) -> Status:
        """Return why steps of any length fail."""
        here, p = self._here, self._scale @ step.p
        slope = float(self._gradient @ step.p)
        if self._function.evaluations + 2 > self._limit:
            return Status.MAX_EVALUATIONS
        if is_misleading(self._function.value, here.x, here.cost, p, slope):
            return Status.GRADIENT
        return Status.PRECISION if here.kept else Status.INFEASIBLE

    def _stuck(self) -> bool:
        """Whether relaxed steps no longer take out what is violated."""
        worst = self._relaxed
        return len(worst) > _PATIENCE and worst[-1] > _PROGRESS * worst[-1 - _PATIENCE]

    def _try(self, step: Step, hessian: Array) -> tuple[Array, Point | None, float]:
        """Return a step, corrected where that helps, where it leads, and how well it was foreseen.

        The last is the fall of the penalty function as a share of the one expected.
        """
        there = self._reach(step.p)
        ratio = self._penalty.share(self._here, there, step)
        curved = there is not None and there.at.worst > max(step.worst, IGNORED)
        spent = self._function.evaluations >= self._limit
        if there is None or ratio >= _POOR or not curved or spent or step.relaxed:
            return step.p, there, ratio
        # Second-order correction: the conditions as they are there, linear from there on.
        shifted = replace(there.at, h=there.at.h - self._rows.along(step.p))
        p = best_step(self._gradient, hessian, shifted, self._rows, self._region).p
        corrected = self._reach(p)
        better = self._penalty.share(self._here, corrected, step)
        if better > ratio:
            return p, corrected, better
        return step.p, there, ratio

    def _accept(self, p: Array, there: Point | None, step: Step, hessian: Array) -> str:
        """Go there; return how H was renewed."""
        if there is None:
            raise RuntimeError("a step is taken only to where F is finite")
        before = self._gradient + pulled_back(self._rows, step.multipliers)
        self._go(there)
        self._derive()
        if step.relaxed:
            self._relaxed.append(there.at.worst)
        else:
            self._relaxed.clear()
        y = self._gradient + pulled_back(self._rows, step.multipliers) - before
        self._h, update = renewed(self._h, p, damped(y, p, hessian), "fletcher")
        if there.kept and self._is_far():
            self._model_anew()
        return update

    def _is_far(self) -> bool:
        """Whether a quadratic cost would have fallen to nothing on the way from the last metric."""
        way = np.linalg.solve(self._scale, self._here.x - self._modelled)
        return float(way @ way) > 2.0 * abs(self._here.cost)

    def _model_anew(self) -> None:
        """Take the Gauss-Newton matrix of here: steps from far away have bent the present one."""
        inward = np.linalg.inv(self._scale)
        self._h = inward @ inverse_metric(self._function.metric(self._here.x)) @ inward.T
        self._modelled = self._here.x

    def _reach(self, p: Array) -> Point | None:
        return self._point(self._here.x + self._scale @ p)

    def _point(self, x: Array) -> Point | None:
        """Return what is known at x; None where F or a condition is not finite."""
        cost = self._function.value(x)
        if not np.isfinite(cost):
            return None
        at = self._function.conditions(x)
        return Point(x, cost, at) if np.all(np.isfinite(at.h)) else None

    def _derive(self) -> None:
        x = self._here.x
        gradient, rows = self._function.gradient(x), self._function.condition_rows(x)
        # What is not finite in a row is not so along any direction with parts of all variables.
        if not np.all(np.isfinite(np.append(gradient, rows.along(np.ones(len(x)))))):
            raise ProblemError(
                "optimiser: the cost and the conditions are finite, but a derivative is not"
            )
        self._gradient, self._rows = self._scale.T @ gradient, ScaledRows(rows, self._scale)

    def _go(self, there: Point) -> None:
        self._here = there
        if there.better(self._best):
            self._best = there

    def _record(self, update: str, step: float) -> bool:
        here, count = self._here, self._function.evaluations
        # Of a motion in an instant it is beyond all numbers.
        with np.errstate(over="ignore", invalid="ignore"):
            size = float(np.linalg.norm(np.linalg.solve(self._scale.T, self._gradient)))
        return self._note(Iteration(read_only(here.x), here.cost, size, update, step, count))

    def _note(self, iteration: Iteration) -> bool:
        self._history.append(iteration)
        return self._callback is not None and bool(self._callback(iteration))

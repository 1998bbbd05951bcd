"""Newton's method on the self-motion manifolds of all nodes at once: one solver for all problems.

Rows h(w) ≤ 0 are elastic, h + s - e = 0 with s, e > 0 and a price ρ on e, so that a start far
beyond limits or inside a body is no dead end. The primal-dual interior-point method goes towards

    ∇F + λᵀ∂h = 0,   s λ = μ,   e (ρ - λ) = μ   for smaller and smaller μ

(J. Nocedal, S. Wright, "Numerical Optimization", 2nd ed., chapter 19; elastic variables: R.
Fletcher, "Practical Methods of Optimization", 2nd ed., 14.3). Eliminated, the steps of s, e and λ
leave a matrix of the nodes alone: each row knows two neighbours, so that it is block-tridiagonal,
and a step takes as much time as there are nodes. A step moves the curve as linear rows say, and
comes onto the path from there, see `NodeMotion.along`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.planning.nodes.motion import NodeMotion
from selfmotion.planning.nodes.newton_system import WILD, Change, ElasticRows, Model, System
from selfmotion.planning.optimise import Status

# The cost is right to this share of itself once a step promises no more; where rows count.
_AGREES, _AGREES_BOUND = 1e-8, 1e-6
# A step that promises more than this share of the cost, and lowers it by nothing, is no rounding.
_ROUNDING = 1e-5
# Slacks and multipliers go no further than this share towards 0 in one step.
_INWARD = 0.995
# A step is taken if it does at least this share of what it promises, and cut by half otherwise.
_SHARE, _SHORTEST = 1e-4, 1e-7
# Nodes go no further than this in one step [rad or m].
_FARTHEST = 0.5
# Barriers begin with this share of the cost for all rows, and end with that; slacks begin with at
# least so much [units of h]. Where multipliers are known, with these.
_FIRST, _LAST, _SLACK = 1e-1, 1e-6, 1e-1
_KNOWN_FIRST, _KNOWN_SLACK = 1e-5, 1e-3
# A row that comes in begins with so much of e.
_ELASTIC = 1e-3
# ρ is this many times the cost for a unit of h. Where a barrier is solved, and a row is broken by
# more than this and its multiplier more than this share of ρ, it is cheaper to break than to keep:
# ρ grows by this factor, so often.
_ELASTIC_COST = 10.0
_BROKEN, _GIVEN_UP, _DEARER, _MOST_RAISES = 1e-6, 0.9, 100.0, 4
# A barrier is solved to this many times itself, before it falls to this share, or this power; at
# the end products of slack and price may be this many times the barrier.
_SOLVED, _FALL, _POWER, _CENTRED = 10.0, 0.2, 1.5, 30.0
# Rows are linear to this [units of h] before a barrier falls, and at the end.
_ABOUT_MET, _MET = 1e-2, 1e-7
# Multipliers are known where a step changes them by no more than this share of all; together they
# are no less than this share of the cost. Between stiff rows a step promises little, whatever these
# say.
_SETTLED, _NO_MULTIPLIER = 1e-2, 1e-3
# Of a row that counts by less than this share of the barrier, the gap does not matter.
_IDLE = 1e-2
# What is asked of the ends is met to this [rad, rad/s].
_MET_ENDS = 1e-9
# Where a rough optimum will do, all of this may be so many times worse.
_ROUGHLY = 100.0
# After a full step that promised less than this share of the cost, the next one promises about its
# square: there is no need to look around for it.
_LITTLE = 1e-5
# A gap costs this share of ρ at least: where it begins closed, a step could open it for nothing.
_LEAST_PENALTY = 3e-3
# Steps after which the method is given up: it needs fifteen, forty where limits bind all over.
_MOST = 80
# Or where in so many what is broken most, by more than WILD, has not fallen below this share: on
# the way to where all is kept it falls by more, in vain it hardly moves.
_STALE, _FALLS = 12, 0.97


class Step(NamedTuple):
    """An iteration.

    Attributes
    ----------
    motion : NodeMotion
    slope : float
        Norm of the gradient of what is minimised.
    length : float
        Share of Newton's step that was taken; 0 of the first.
    """

    motion: NodeMotion
    slope: float
    length: float


Callback = Callable[[Step], bool]
"""Called with each iteration; True stops."""


@dataclass(frozen=True, eq=False)
class Optimum:
    """Where Newton's method ended.

    Attributes
    ----------
    motion : NodeMotion
    multipliers : (R,)
        λ of all rows; 0 of those that did not count.
    status : Status
    promised : float
        By how much another step would lower the cost.
    end_multipliers : (E,)
        Of what is asked of the ends.
    """

    motion: NodeMotion
    multipliers: Array
    status: Status
    promised: float
    end_multipliers: Array


def minimise(
    begin: NodeMotion,
    callback: Callback,
    multipliers: Array | None = None,
    *,
    roughly: bool = False,
    most: int = _MOST,
) -> Optimum:
    """Return the optimum near a motion.

    Parameters
    ----------
    begin : NodeMotion
    callback : callable
    multipliers : (R,), optional
        Of an optimum near by.
    roughly : bool
        Whether it is enough where such an optimum can be begun with: rows keep off what binds.
    most : int
        Iterations.
    """
    solver = _Solver(begin, multipliers, roughly=roughly)
    least, since = np.inf, 0
    for _ in range(most):
        status = solver.advance(callback)
        if status is not None:
            return solver.optimum(status)
        broken, since = solver.motion.violation, since + 1
        if broken < _FALLS * least or broken <= WILD:
            least, since = broken, 0
        if since >= _STALE:
            return solver.optimum(Status.INFEASIBLE)
    return solver.optimum(Status.MAX_ITERATIONS)


class _Solver:
    """The state of Newton's method: a motion, slacks, multipliers and the barrier.

    Of rows, s, e and λ are those of the rows that count, in their order.
    """

    def __init__(self, begin: NodeMotion, multipliers: Array | None, *, roughly: bool) -> None:
        self.motion, h = begin, begin.h
        self._size = max(abs(begin.aim), np.finfo(float).tiny)
        each = self._size / max(int((h > -1e2).sum()), 1)
        self._roughly, last = roughly, _KNOWN_FIRST if roughly else _LAST
        self._least, self._elastic_cost = last * each, _ELASTIC_COST * self._size
        self._barrier = (_FIRST if multipliers is None else _KNOWN_FIRST) * each
        self._raises = 0
        self._kept: Flags = np.zeros(len(h), dtype=np.bool_)
        self._slacks = self._elastics = self._multipliers = np.zeros(0)
        self._admit()
        if multipliers is not None:
            self._begin_with(multipliers)
        self._penalty, self._promised, self._length, self._shift = 0.0, np.inf, 0.0, 0.0
        self._end_multipliers = np.zeros(begin.grid.ends.count)
        self._changing = np.inf if self._multipliers.size else 0.0

    def _begin_with(self, multipliers: Array) -> None:
        """Begin with known multipliers of all rows, (R,)."""
        h, known = self._h, multipliers[self._kept]
        usual = self._barrier / np.maximum(-h, _KNOWN_SLACK)
        self._multipliers = np.clip(np.maximum(known, usual), None, 0.5 * self._elastic_cost)
        slacks = np.maximum(-h, self._barrier / self._multipliers)
        self._elastics = np.maximum(h + slacks, 0.0) + self._barrier / (
            self._elastic_cost - self._multipliers
        )
        self._slacks = np.maximum(slacks, self._elastics - h)
        # Where multipliers are not those of the rows, as far off as they are.
        off = float(np.mean(self._slacks * self._multipliers)) if len(h) else 0.0
        self._barrier = min(max(self._barrier, off), _FIRST / _KNOWN_FIRST * self._barrier)

    def _grows_dearer(self) -> bool:
        """Let rows cost more to break where that is cheaper than to keep them; return whether."""
        given_up = (self._h > _BROKEN) & (self._multipliers > _GIVEN_UP * self._elastic_cost)
        if self._raises == _MOST_RAISES or not given_up.any():
            return False
        self._raises += 1
        self._elastic_cost *= _DEARER
        return True

    @property
    def _h(self) -> Array:
        """Rows that count."""
        return self.motion.h[self._kept]

    @property
    def _gap(self) -> Array:
        return self._h + self._slacks - self._elastics

    def _admit(self) -> None:
        """Let rows in that have come near to being broken."""
        motion = self.motion
        near = motion.grid.rows.near(motion.h) | self._kept
        if near.sum() == self._kept.sum():
            return
        x = motion.h
        slacks = np.maximum(-x, _SLACK) + _ELASTIC
        full = slacks, x + slacks, np.minimum(self._barrier / slacks, 0.5 * self._elastic_cost)
        for values, own in zip(
            full, (self._slacks, self._elastics, self._multipliers), strict=True
        ):
            values[self._kept] = own
        self._kept = near
        self._slacks, self._elastics, self._multipliers = (values[near] for values in full)

    def optimum(self, status: Status) -> Optimum:
        """Return where it is now."""
        return Optimum(
            self.motion,
            self._rows.of_all(self._multipliers),
            status,
            self._promised,
            self._end_multipliers,
        )

    def advance(self, callback: Callback) -> Status | None:
        """Take a step; return how the method ended, if it did."""
        if self._arrived():
            callback(Step(self.motion, 0.0, self._length))
            return Status.CONVERGED
        model = Model.of(self.motion, self._rows, self._end_multipliers)
        if model is None:
            return Status.GRADIENT
        slope = float(np.linalg.norm(model.gradient))
        if callback(Step(self.motion, slope, self._length)):
            return Status.STOPPED
        system = self._system(model)
        if system is None:
            return Status.GRADIENT
        while True:
            step = self._step(system)
            last = not self._multipliers.size or self._barrier <= self._least
            self._changing = self._share_of(step.multipliers)
            there = last and self._is_there() and self._changing <= _SETTLED
            if (there or self._is_solved()) and self._grows_dearer():
                system = self._system(model)
                if system is None:
                    return Status.GRADIENT
                return self._move(model, self._step(system))
            if there:
                self._end_multipliers = step.end_multipliers
                return Status.CONVERGED
            if last or not self._is_solved():
                return self._move(model, step)
            self._barrier = max(self._least, min(_FALL * self._barrier, self._barrier**_POWER))

    @property
    def _rows(self) -> ElasticRows:
        return ElasticRows(
            self._h,
            self._slacks,
            self._elastics,
            self._multipliers,
            self._elastic_cost,
            self._kept,
        )

    def _system(self, model: Model) -> System | None:
        """Solve for a step; None where the matrix says nothing."""
        found = System.of(self.motion, model, self._rows, self._barrier, self._shift)
        if found is not None:
            self._shift = found.shift
        return found

    def _step(self, system: System) -> Change:
        """Return the step for the present barrier."""
        step = system.step(self._barrier)
        self._promised = step.promised
        return step

    def _arrived(self) -> bool:
        """Whether the last step says that another one would promise nothing."""
        promised = self._promised / self._size
        if not (self._length == 1.0 and promised <= _LITTLE and self._barrier <= self._least):
            return False
        if self._changing > np.sqrt(_SETTLED):
            return False
        before, self._promised = self._promised, promised**2 * self._size
        if self._is_there():
            return True
        self._promised = before
        return False

    def _share_of(self, step: Array) -> float:
        """Return how much of all multipliers a step changes them by."""
        known = float(self._multipliers.sum()) + _NO_MULTIPLIER * self._size
        return float(np.abs(step).sum()) / known

    def _is_there(self) -> bool:
        """Whether another step would promise nothing, and all is met."""
        agrees = (_AGREES_BOUND if self._multipliers.size else _AGREES) * self._size
        if self._roughly:
            agrees *= _ROUGHLY
        met = self._open <= _MET * (_ROUGHLY if self._roughly else 1.0)
        met &= bool(np.abs(self.motion.c).max(initial=0.0) <= _MET_ENDS)
        return bool(met and self._promised <= agrees and self._off <= _CENTRED * self._barrier)

    def _is_solved(self) -> bool:
        """Whether the problem with the present barrier is solved well enough."""
        allowed = _SOLVED * self._barrier
        met = self._open <= _ABOUT_MET
        return bool(met and self._promised <= allowed and self._off <= allowed)

    @property
    def _open(self) -> float:
        """The largest gap that counts.

        On very short intervals rates are known to few digits: what costs next to nothing is met.
        """
        gap = np.abs(self._gap)
        return float(gap[self._multipliers * gap > _IDLE * self._barrier].max(initial=0.0))

    @property
    def _off(self) -> float:
        """How far products of slacks and multipliers are off the barrier."""
        by_slack = np.abs(self._slacks * self._multipliers - self._barrier).max(initial=0.0)
        left = self._elastics * (self._elastic_cost - self._multipliers)
        return float(max(by_slack, np.abs(left - self._barrier).max(initial=0.0)))

    def _move(self, model: Model, step: Change) -> Status | None:
        """Go along a step as far as it does what it promises."""
        motion, r = self.motion, step.nodes.shape[1] // 3
        gap = float(np.abs(motion.c).sum() + np.abs(self._gap).sum())
        slope = float((model.gradient * step.nodes).sum()) + float(
            np.sum(
                (self._elastic_cost - self._barrier / self._elastics) * step.elastics
                - self._barrier / self._slacks * step.slacks
            )
        )
        if gap > 0.0:
            # So that the step lowers the merit, whichever way the cost goes.
            dearest = 1.5 * float(np.abs(step.end_multipliers).max(initial=0.0))
            self._penalty = max(self._penalty, 2.0 * slope / gap, dearest)
        self._penalty = max(self._penalty, _LEAST_PENALTY * self._elastic_cost)
        merit = self._merit(motion, self._slacks, self._elastics)
        promise = slope - self._penalty * gap
        farthest = float(np.abs(step.nodes[:, :r]).max())
        length = _FARTHEST / max(farthest, _FARTHEST)
        for values, change in ((self._slacks, step.slacks), (self._elastics, step.elastics)):
            length = min(length, _longest(values, change))
        while length >= _SHORTEST:
            new = motion.along(length * step.nodes, model.around.changes)
            if new is not None and np.isfinite(new.aim):
                elastics = self._elastics + length * step.elastics
                # A gap below 0 closes for nothing; one above costs the penalty, not ρ: else the
                # rows' curvature stops the steps.
                slacks = np.maximum(
                    self._slacks + length * step.slacks, elastics - new.h[self._kept]
                )
                gained = merit - self._merit(new, slacks, elastics)
                # Written so that NaN is no gain; what is below rounding is none to look for.
                if gained >= -_SHARE * length * min(promise, 0.0) - 1e-13 * abs(merit):
                    share = min(
                        _longest(self._multipliers, step.multipliers),
                        _longest(self._elastic_cost - self._multipliers, -step.multipliers),
                    )
                    self._multipliers = self._multipliers + share * step.multipliers
                    self._slacks, self._elastics = slacks, elastics
                    self.motion, self._length = new, length
                    self._end_multipliers = step.end_multipliers
                    self._admit()
                    return None
            length *= 0.5
        if self._promised <= _ROUNDING * self._size:
            return Status.PRECISION
        # What a good step promises and none does is no rounding: the gradient is wrong.
        asked = self._multipliers.size or len(self._end_multipliers)
        return Status.INFEASIBLE if asked else Status.GRADIENT

    def _merit(self, motion: NodeMotion, slacks: Array, elastics: Array) -> float:
        barrier = self._barrier * float(np.log(slacks).sum() + np.log(elastics).sum())
        gap = np.abs(motion.h[self._kept] + slacks - elastics).sum() + np.abs(motion.c).sum()
        elastic = self._elastic_cost * float(elastics.sum())
        return motion.aim + elastic - barrier + self._penalty * float(gap)


def _longest(values: Array, step: Array) -> float:
    """Return the share of a step, at most 1, that keeps positive values well above 0."""
    falling = step < 0.0
    if not falling.any():
        return 1.0
    return min(1.0, float(np.min(_INWARD * -values[falling] / step[falling])))

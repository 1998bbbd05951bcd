"""Newton's method on the self-motion manifolds of all nodes at once.

Where conditions h(w) ≤ 0 count, the primal-dual interior-point method: with slacks s > 0 and prices
λ > 0, it goes towards h + s = 0, ∇F + λᵀ∂h = 0 and s λ = μ, for smaller and smaller μ (J. Nocedal,
S. Wright, "Numerical Optimization", 2nd ed., chapter 19). Each condition knows three nodes, so that
all matrices stay block-banded, and a step takes as much time as there are nodes.
"""

import numpy as np

from selfmotion.basics import Array, Ints
from selfmotion.nodes.conditions import spread
from selfmotion.nodes.ends import Border
from selfmotion.nodes.motion import NodeMotion
from selfmotion.nodes.objective import Around, scattered
from selfmotion.nodes.optimum import Optimum, Step, Told
from selfmotion.optimise import Banded, Status

# The cost is right to this share of itself once a step promises no more; where conditions count.
_AGREES, _AGREES_BOUND = 1e-8, 1e-6
# A step that promises more than this share of the cost, and lowers it by nothing, is no rounding.
_ROUNDING = 1e-6
# The matrix of a step that promised no more than this share of the cost is that of its end as well.
_LITTLE = 1e-3
# Slacks and prices go no further than this share towards 0 in one step.
_INWARD = 0.995
# A step is taken if it does at least this share of what it promises, and cut by half otherwise.
_SHARE, _SHORTEST = 1e-4, 1e-6
# Motions that cost nothing, as of a joint whose axis the tool is on, are left alone: the matrix has
# this share of its usual entry more on the diagonal, which is above rounding there.
_FLAT = 1e-11
# One that is not positive definite gets this share of its largest entry on the diagonal, or a
# third of what the last one needed; then more by this factor, again and again.
_SHIFT, _LESS, _MORE = 1e-6, 1.0 / 3.0, 8.0
# Nodes go no further than this in one step [rad or m]; one that would go beyond that is none of a
# matrix that says something.
_FARTHEST, _TRUSTED = 0.5, 5.0
# Barriers begin with this share of the cost for all conditions, and end with that; slacks begin
# with at least so much [units of h]. Where prices are known, with these.
_FIRST, _LAST, _SLACK = 1e-1, 1e-6, 1e-1
_KNOWN_FIRST, _KNOWN_SLACK = 1e-4, 1e-3
# A barrier is solved to this many times itself, before it falls to this share, or this power.
_SOLVED, _FALL, _POWER = 10.0, 0.2, 1.5
# Conditions are met to this [units of h].
_MET = 1e-7
# What is asked of the ends is met to this [rad, rad/s].
_MET_ENDS = 1e-9
# So many steps in turn, each this short a share of Newton's, lead nowhere.
_STUCK, _TINY = 5, 0.02
# Iterations after which the method is given up: it needs ten, thirty where limits bind.
_MOST = 80


def minimise(begin: NodeMotion, columns: Ints, told: Told, prices: Array | None = None) -> Optimum:
    """Return the optimum near a motion, keeping some columns of the conditions.

    Parameters
    ----------
    begin : NodeMotion
    columns : (c,)
        Of h, see `NodeConditions`; may be none.
    told : callable
    prices : (N + 1, c), optional
        Of an optimum near by.
    """
    solver = _Solver(begin, columns, prices)
    for _ in range(_MOST):
        status = solver.advance(told)
        if status is not None:
            return solver.optimum(status)
    return solver.optimum(Status.MAX_ITERATIONS)


class _Solver:
    """The state of Newton's method: a motion, slacks, prices and the barrier."""

    def __init__(self, begin: NodeMotion, columns: Ints, prices: Array | None) -> None:
        self.motion, self._columns = begin, columns
        h = begin.wanted[:, columns]
        each = max(abs(begin.aim), np.finfo(float).tiny) / max(h.size, 1)
        self._least = _LAST * each
        if prices is None:
            self._barrier, self._slacks = _FIRST * each, np.maximum(-h, _SLACK)
            self._prices = self._barrier / self._slacks
        else:
            self._barrier = _KNOWN_FIRST * each
            usual = self._barrier / np.maximum(-h, _KNOWN_SLACK)
            self._prices = np.maximum(prices, usual)
            self._slacks = np.maximum(-h, self._barrier / self._prices)
        self._penalty, self._promised, self._length = 0.0, np.inf, 0.0
        self._tiny, self._shift = 0, 0.0
        self._matrix: Banded | None = None
        self._end_prices = np.zeros(begin.grid.ends.count)

    def optimum(self, status: Status) -> Optimum:
        """Return where it is now."""
        return Optimum(self.motion, self._prices, status, self._promised, self._end_prices)

    def advance(self, told: Told) -> Status | None:
        """Take a step; return how the method ended, if it did."""
        motion = self.motion
        motion.grid.counts.gradients += 1
        slopes = scattered(motion.grid.cost.slopes(motion.samples, motion.partials))
        by_both, by_prices, continuity = slopes, slopes, motion.grid.continuity
        if continuity is not None:
            by_both = slopes + scattered(continuity.slopes(motion.samples))
        gradient = motion.charts.pulled(motion.place, by_both[:, 0], by_both[:, 1])
        gradient.reshape(-1)[motion.grid.held] = 0.0
        is_there = self._is_there(gradient)
        if told(Step(motion, float(np.linalg.norm(gradient)), self._length)):
            return Status.STOPPED
        if is_there:
            return Status.CONVERGED
        if self._columns.size:
            prices = np.zeros_like(motion.h)
            prices[:, self._columns] = self._prices
            by_prices = slopes + motion.grid.conditions.pulled(motion.samples.checked, prices)
        if len(motion.c):
            by_prices = by_prices + motion.grid.ends.pulled(self._end_prices, len(slopes))
        around = Around.of(motion.charts, motion.nu, by_prices)
        if around is None:
            return Status.GRADIENT
        curved = around.curvature
        rows, by_jumps = self._rows(around), self._by_jumps(around)
        ends = motion.grid.ends.border(motion.c, around.changes, motion.grid.held)
        intervals = motion.grid.cost.curvature(motion.samples, motion.partials, around.changes)
        if self._columns.size:
            conditions = motion.grid.conditions
            bending = conditions.bending(motion.samples.checked, prices, around.changes)
            if bending is not None:
                curved, intervals = curved + bending[0], intervals + bending[1]
        gap = motion.wanted[:, self._columns] + self._slacks
        while True:
            step = self._step(gradient, curved, intervals, by_jumps, rows, gap, ends)
            if step is None:
                return Status.GRADIENT
            by_slack, by_price = self._others(rows, gap, step)
            size = max(abs(motion.aim), np.finfo(float).tiny)
            met = np.abs(gap).max(initial=0.0) <= _MET
            met &= bool(np.abs(motion.c).max(initial=0.0) <= _MET_ENDS)
            last = not self._columns.size or self._barrier <= self._least
            agrees = _AGREES_BOUND if self._columns.size else _AGREES
            if self._promised <= agrees * size and met and last:
                return Status.CONVERGED
            if last or not self._solved(gap):
                break
            self._barrier = max(self._least, min(_FALL * self._barrier, self._barrier**_POWER))
        return self._move(gradient, gap, step, by_slack, by_price)

    def _is_there(self, gradient: Array) -> bool:
        """Whether another step would promise nothing, by the matrix of the last one.

        Only where nothing is asked of the motion but to cost little: of what else counts, the
        matrix knows prices that change. The look around, which is most of a step, is spared then.
        """
        motion = self.motion
        size = max(abs(motion.aim), np.finfo(float).tiny)
        asked = self._columns.size or len(self._end_prices) or motion.grid.continuity is not None
        if asked or self._matrix is None or self._promised > _LITTLE * size:
            return False
        solved = self._matrix.solve(gradient.ravel())
        if solved is None:
            return False
        promised = float(gradient.ravel() @ solved)
        if promised > _AGREES * size:
            return False
        self._promised = promised
        return True

    def _rows(self, around: Around) -> Array:
        """Return ∂h/∂w of the columns, (N + 1, c, 6r); nothing moves what is held."""
        count, _, _, size = around.changes.shape
        if not self._columns.size:
            return np.zeros((count, 0, 3 * size))
        motion = self.motion
        return motion.grid.conditions.rows(motion.samples.checked, around.changes, self._columns)

    def _by_jumps(self, around: Around) -> Array:
        """Return the derivatives by w of what jumps of q̈ weigh, (N + 1, 6r, j)."""
        continuity, (count, _, _, size) = self.motion.grid.continuity, around.changes.shape
        if continuity is None:
            return np.zeros((count, 3 * size, 0))
        return np.swapaxes(continuity.tangents(around.changes), 1, 2)

    def _solved(self, gap: Array) -> bool:
        """Whether the problem with the present barrier is solved well enough."""
        off = np.abs(self._slacks * self._prices - self._barrier).max(initial=0.0)
        allowed = _SOLVED * self._barrier
        return bool(self._promised <= allowed and off <= allowed and np.abs(gap).max() <= 1e-2)

    def _step(
        self,
        gradient: Array,
        curved: Array,
        intervals: Array,
        by_jumps: Array,
        rows: Array,
        gap: Array,
        ends: Border,
    ) -> Array | None:
        """Return Newton's step of the coordinates, (N + 1, 2r)."""
        count, size = gradient.shape
        ratio = self._prices / self._slacks
        turned = np.swapaxes(rows, 1, 2)
        right = gradient.flatten()
        if rows.shape[1]:
            pressure = (self._barrier / self._slacks + ratio * gap)[:, :, None]
            right += spread((turned @ pressure)[:, :, 0]).ravel()
            right[self.motion.grid.held] = 0.0
        wide = bool(rows.shape[1] or by_jumps.shape[2])
        largest = float(np.abs(curved).max() + np.abs(intervals).max())
        diagonals = np.abs(np.diagonal(intervals, axis1=1, axis2=2)).ravel()
        usual = float(np.partition(diagonals, len(diagonals) // 2)[len(diagonals) // 2])
        shift = _FLAT * usual
        while shift <= 1e6 * largest:
            matrix = Banded(count, size, 2 if wide else 1)
            matrix.add(0, 0, curved)
            matrix.add_pairs(0, intervals)
            if wide:
                near = turned @ (ratio[:, :, None] * rows)
                matrix.add_triples(near + by_jumps @ np.swapaxes(by_jumps, 1, 2))
            matrix.add_diagonal(shift)
            matrix.hold(self.motion.grid.held)
            solved = matrix.solve(np.column_stack([-right, ends.columns]))
            if solved is not None:
                step, prices = ends.met_by(solved)
                if np.abs(step.reshape(count, 2, -1)[:, 0]).max() <= _TRUSTED:
                    self._shift, self._end_prices, self._matrix = shift, prices, matrix
                    self._promised = float(-(right + ends.columns @ prices) @ step)
                    return step.reshape(count, size)
            shift = max(_MORE * shift, _SHIFT * largest, _LESS * self._shift)
        return None

    def _others(self, rows: Array, gap: Array, step: Array) -> tuple[Array, Array]:
        """Return the steps of slacks and prices that go with one of the coordinates."""
        if not gap.size:
            return gap, gap
        near = np.zeros((len(step), 3, step.shape[1]))
        near[1:, 0], near[:, 1], near[:-1, 2] = step[:-1], step, step[1:]
        by_slack = -gap - (rows @ near.reshape(len(step), -1, 1))[:, :, 0]
        by_price = (self._barrier - self._prices * by_slack) / self._slacks - self._prices
        return by_slack, by_price

    def _move(
        self, gradient: Array, gap: Array, step: Array, by_slack: Array, by_price: Array
    ) -> Status | None:
        """Go along a step as far as it does what it promises."""
        motion, charts, r = self.motion, self.motion.charts, step.shape[1] // 2
        off = float(np.abs(gap).sum() + np.abs(motion.c).sum())
        slope = float((gradient * step).sum()) - self._barrier * float(
            (by_slack / self._slacks).sum()
        )
        if off > 0.0:
            # So that the step lowers the merit, whichever way the cost goes.
            self._penalty = max(self._penalty, 2.0 * slope / off)
        merit = self._merit(motion, self._slacks, gap)
        promise = slope - self._penalty * off
        farthest = float(np.abs(step[:, :r]).max())
        length = min(_longest(self._slacks, by_slack), _FARTHEST / max(farthest, _FARTHEST))
        while length >= _SHORTEST and self._tiny < _STUCK:
            epsilon = charts.null_motions(motion.nu + length * step[:, r:])
            found = charts.centred(length * step[:, :r], epsilon)
            if found is not None:
                new = motion.grid.at(*found)
                h = new.wanted[:, self._columns]
                slacks = np.maximum(self._slacks + length * by_slack, -h)
                gained = merit - self._merit(new, slacks, h + slacks)
                # Written so that NaN is no gain; what is below rounding is none to look for.
                rounding = 1e-13 * abs(merit)
                if gained >= -_SHARE * length * min(promise, 0.0) - rounding:
                    self.motion, self._slacks = new, slacks
                    share = _longest(self._prices, by_price)
                    self._prices = self._prices + share * by_price
                    self._length = length
                    self._tiny = self._tiny + 1 if length < _TINY else 0
                    return None
            length *= 0.5
        if self._columns.size or len(self._end_prices):
            return Status.INFEASIBLE
        # What a good step promises and none does is no rounding: the gradient is wrong.
        precise = self._promised <= _ROUNDING * max(abs(motion.aim), np.finfo(float).tiny)
        return Status.PRECISION if precise else Status.GRADIENT

    def _merit(self, motion: NodeMotion, slacks: Array, gap: Array) -> float:
        barrier = self._barrier * float(np.log(slacks).sum())
        off = float(np.abs(gap).sum() + np.abs(motion.c).sum())
        return motion.aim - barrier + self._penalty * off


def _longest(values: Array, step: Array) -> float:
    """Return the share of a step, at most 1, that keeps positive values well above 0."""
    falling = step < 0.0
    if not falling.any():
        return 1.0
    return min(1.0, float(np.min(_INWARD * -values[falling] / step[falling])))

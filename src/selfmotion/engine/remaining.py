"""What another null motion could still save: an estimate, from one gradient and one matrix.

Around a finished motion, with g and M the gradient and the Gauss-Newton matrix of the cost with
respect to a fine spline that is added to its null motion, the quadratic model falls by ½ gᵀM⁻¹g;
where constraints bind, by what the quadratic programme over the linearised conditions finds.
"""

from functools import cache, cached_property

import numpy as np

from selfmotion.basics import Array
from selfmotion.engine.objective import Objective
from selfmotion.motion import BSplineNullMotion
from selfmotion.optimise import DenseRows, Residuals, ScaledRows, best_step

# Intervals of the finest spline, and of coarser ones that it contains; coefficients beyond which
# matrices would take longer than the rest of a plan.
_INTERVALS, _MOST = (8, 16, 32, 64), 220
# Directions in which the cost hardly bends are not trusted further than this share allows.
_FLAT = 1e-9
# The model is believed within this many times its own step.
_REACH = 3.0


def finest(rows: int) -> BSplineNullMotion:
    """Return the spline that the estimate is made in: of 64 intervals, or fewer for many rows."""
    fitting = [count for count in _INTERVALS if rows * (count + 3) <= _MOST]
    return BSplineNullMotion(max(fitting, default=_INTERVALS[0]))


class Remaining:
    """What is left to save around a motion, by splines of more and more intervals.

    Parameters
    ----------
    fine : Objective
        Its null motion is a spline of the most intervals, added to the motion's own.
    x : (size,)
        Where the motion is, its spline 0.
    bound : bool
        Whether conditions count.
    """

    def __init__(self, fine: Objective, x: Array, *, bound: bool) -> None:
        self._fine, self._parts = fine, [len(part) for part in fine.parts(x)]
        self._finest = fine.null_motion.functions.shape[1] - 3
        self._gradient, self._metric = fine.gradient(x), fine.metric(x)
        none = Residuals(np.zeros(0), np.zeros(0), np.zeros(0, dtype=bool))
        self._at = fine.conditions(x) if bound else none
        none_of_it = DenseRows(np.zeros((0, fine.size)))
        self._rows = fine.condition_rows(x) if bound else none_of_it

    @cached_property
    def most(self) -> float:
        """What the finest spline would save [cost]."""
        return self.saving(self._finest)

    def saving(self, intervals: int) -> float:
        """Return what a spline of so many intervals (8, 16, …) would save [cost]."""
        z, _ = self._parts
        inner = np.kron(np.eye(self._fine.null_motion.rows), _within(intervals, self._finest))
        basis = np.zeros((self._fine.size, z + inner.shape[1]))
        basis[:z, :z] = np.eye(z)
        basis[z:, z:] = inner
        values, vectors = np.linalg.eigh(basis.T @ self._metric @ basis)
        if not values[-1] > 0.0:
            # Nothing that the spline moves costs anything.
            return 0.0
        scale = basis @ (vectors / np.sqrt(np.maximum(values, _FLAT * values[-1])))
        slope, bend = scale.T @ self._gradient, scale.T @ self._metric @ scale
        reach = _REACH * float(np.linalg.norm(slope))
        if reach == 0.0:
            return 0.0
        step = best_step(slope, bend, self._at, ScaledRows(self._rows, scale), reach)
        return 0.0 if step.relaxed else max(step.gain, 0.0)

    def intervals(self, left: float) -> int:
        """Return the fewest intervals that leave no more than `left` of what can be saved."""
        finest = self._finest
        return next(n for n in _INTERVALS if n == finest or self.most - self.saving(n) <= left)


@cache
def _within(intervals: int, finest: int) -> Array:
    """Return the matrix from a spline's coefficients to those of the finest one, (K', K)."""
    t = np.linspace(0.0, 1.0, 8 * finest + 1)
    coarse, fine = (BSplineNullMotion(count).functions(t, 1.0) for count in (intervals, finest))
    return np.asarray(np.linalg.lstsq(fine, coarse)[0])

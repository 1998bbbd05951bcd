"""The step of sequential quadratic programming: a model of the Lagrangian, conditions linearised.

Minimise gᵀp + ½ pᵀBp where h + A p ≤ 0 (= 0 for equalities) and |p| ≤ Δ. Where linearised
conditions contradict each other or the trust region, they are relaxed together, in proportion to
their tolerances: first by the least t with h + A p ≤ t · tolerance for some p within the region,
then a little more, which leaves room to choose p by its cost.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array
from selfmotion.optimise.base import Residuals
from selfmotion.optimise.quadratic import minimize_quadratic
from selfmotion.optimise.rows import Rows

# Equalities may be met to this share of their tolerance, so that dependent ones stay consistent.
_SLACK = 1e-3
# Inequalities may use this share of their tolerance; the rest is for their curvature.
AIM = 0.7
# Share of what the relaxation could take out that is left for the cost.
_ROOM = 0.1
# Weight of the length of p against t in finding the least t, at the border of the region.
_SHORT = 1e-4


@dataclass(frozen=True, eq=False)
class Step:
    """A step of the model.

    Attributes
    ----------
    p : (d,)
    multipliers : (C,)
        ≥ 0 for inequalities; 0 where conditions were relaxed.
    gain : float
        -gᵀp - ½ pᵀBp: what the model expects F to fall by.
    worst : float
        The largest violation that is left in the linearised conditions, in tolerances.
    relaxed : bool
        Whether the conditions contradict each other within the trust region.
    """

    p: Array
    multipliers: Array
    gain: float
    worst: float
    relaxed: bool


def best_step(gradient: Array, hessian: Array, at: Residuals, rows: Rows, region: float) -> Step:
    """Return the step within a trust region |p| ≤ `region` (in each component)."""
    if not len(gradient):
        return Step(gradient, np.zeros(len(at.h)), 0.0, at.worst, at.worst > 1.0)
    model = _Model(gradient, hessian, at, rows, region)
    found = model.minimum(0.0)
    relaxed = found is None
    if found is None:
        least = model.least_violation()
        for room in (_ROOM, 0.5, 1.0):
            found = model.minimum(least + room * max(at.worst - least, 0.0))
            if found is not None:
                break
        else:
            found = np.zeros_like(gradient), np.zeros(len(at.h)), at.worst
    p, multipliers, worst = found
    return Step(p, multipliers, -float(gradient @ p + 0.5 * p @ hessian @ p), worst, relaxed)


class _Model:
    """The model of the Lagrangian, with those of the conditions that some p would violate.

    Programmes are solved with the conditions that are known to matter; what their solutions violate
    is added until there is nothing more. So solutions are those with all conditions.
    """

    def __init__(
        self, gradient: Array, hessian: Array, at: Residuals, rows: Rows, region: float
    ) -> None:
        self._gradient, self._hessian, self._all, self._rows = gradient, hessian, at, rows
        self._region, self._counted = region, np.zeros(len(at.h), dtype=bool)
        self._which = np.zeros(0, dtype=np.intp)
        self._table = np.zeros((0, len(gradient)))
        self._count(at.equality | (at.h > -at.tolerance))

    def minimum(self, relaxation: float) -> tuple[Array, Array, float] | None:
        """Return the best p (d,), multipliers (C,) and the worst violation; None for no p.

        Conditions may be violated by so many tolerances.
        """
        reach = np.full(len(self._gradient), self._region)
        while True:
            at = self._some
            room = np.maximum(relaxation, np.where(at.equality, _SLACK, AIM)) * at.tolerance
            lower = np.where(at.equality, -at.h - room, -np.inf)
            found = minimize_quadratic(
                self._hessian, self._gradient, self._table, lower, -at.h + room, reach
            )
            if found is None:
                return None
            p, prices = found
            linear = self._along(p)
            if not self._count(linear.excess > max(relaxation, AIM) + _SLACK):
                multipliers = np.zeros(len(self._all.h))
                multipliers[self._which] = prices
                return p, multipliers, linear.worst

    def least_violation(self) -> float:
        """Return the least t with h + A p ≤ t · tolerance (|h + A p| for equalities)."""
        size, scale = len(self._gradient), max(self._all.worst, 1.0)
        hessian = np.diag(np.append(np.full(size, _SHORT), 1.0))
        reach = np.append(np.ones(size), np.inf)
        while True:
            h, equality = self._some.h, self._some.equality
            # In units of the region, of tolerances and of the violation, all of order 1.
            table = self._table * (self._region / self._some.tolerance[:, None])
            above = np.column_stack([table, np.full(len(h), -scale)])
            below = np.column_stack([-table[equality], np.full(int(equality.sum()), -scale)])
            both, shares = np.vstack([above, below]), h / self._some.tolerance
            upper = -np.append(shares, -shares[equality])
            none = np.full(len(upper), -np.inf)
            found = minimize_quadratic(hessian, np.zeros_like(reach), both, none, upper, reach)
            if found is None:
                return scale
            least = float(found[0][-1]) * scale
            linear = self._along(found[0][:-1] * self._region)
            if not self._count(linear.excess > max(least, AIM) + _SLACK):
                return least

    @property
    def _some(self) -> Residuals:
        at, which = self._all, self._which
        return Residuals(at.h[which], at.tolerance[which], at.equality[which])

    def _along(self, p: Array) -> Residuals:
        return Residuals(self._all.h + self._rows.along(p), self._all.tolerance, self._all.equality)

    def _count(self, violated: npt.NDArray[np.bool_]) -> bool:
        """Count these conditions, too; return whether any of them was not counted so far."""
        more = np.flatnonzero(violated & ~self._counted)
        if not len(more):
            return False
        self._counted[more] = True
        self._which = np.append(self._which, more)
        self._table = np.vstack([self._table, self._rows.picked(more)])
        return True

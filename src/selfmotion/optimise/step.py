"""The step of sequential quadratic programming: a model of the Lagrangian, conditions linearised.

Minimise gᵀp + ½ pᵀBp where h + A p ≤ 0 (= 0 for equalities) and |p| ≤ Δ. Where linearised
conditions contradict each other or the trust region, they are relaxed together, in proportion to
their tolerances: first by the least t with h + A p ≤ t · tolerance for some p within the region,
then a little more, which leaves room to choose p by its cost.
"""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array
from selfmotion.optimise.base import Residuals
from selfmotion.optimise.quadratic import minimize_quadratic

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


def best_step(gradient: Array, hessian: Array, at: Residuals, rows: Array, region: float) -> Step:
    """Return the step within a trust region |p| ≤ `region` (in each component)."""
    if not len(gradient):
        return Step(gradient, np.zeros(len(at.h)), 0.0, at.worst, at.worst > 1.0)
    reach = np.full(len(gradient), region)
    # A condition that no p within the region violates cannot matter.
    change = region * np.abs(rows).sum(axis=1)
    slack = _SLACK * at.tolerance
    near = np.where(at.equality, np.abs(at.h) + change > slack, at.h + change > 0.0)
    some = Residuals(at.h[near], at.tolerance[near], at.equality[near])
    h, tolerance, equality = some.h, some.tolerance, some.equality
    a = rows[near]

    def bands(relaxation: float) -> tuple[Array, Array]:
        room = np.maximum(relaxation, np.where(equality, _SLACK, AIM)) * tolerance
        return np.where(equality, -h - room, -np.inf), -h + room

    found = minimize_quadratic(hessian, gradient, a, *bands(0.0), reach)
    relaxed = found is None
    if found is None:
        least = _least_violation(some, a, region)
        before = at.worst
        for room in (_ROOM, 0.5, 1.0):
            found = minimize_quadratic(
                hessian, gradient, a, *bands(least + room * max(before - least, 0.0)), reach
            )
            if found is not None:
                break
        else:
            found = np.zeros_like(gradient), np.zeros(len(a))
    p, prices = found
    multipliers = np.zeros(len(at.h))
    multipliers[near] = prices
    linear = Residuals(at.h + rows @ p, at.tolerance, at.equality)
    return Step(p, multipliers, -float(gradient @ p + 0.5 * p @ hessian @ p), linear.worst, relaxed)


def _least_violation(at: Residuals, rows: Array, region: float) -> float:
    """Return the least t with h + A p ≤ t · tolerance (|h + A p| for equalities), |p| ≤ region."""
    h, tolerance, equality = at.h, at.tolerance, at.equality
    size = rows.shape[1]
    scale = max(at.worst, 1.0)
    # In units of the region and of the violation, both of order 1.
    above = np.column_stack([rows * region, -tolerance * scale])
    below = np.column_stack([-rows[equality] * region, -tolerance[equality] * scale])
    both = np.vstack([above, below]) / np.append(tolerance, tolerance[equality])[:, None]
    upper = -np.append(h, -h[equality]) / np.append(tolerance, tolerance[equality])
    hessian = np.diag(np.append(np.full(size, _SHORT), 1.0))
    reach = np.append(np.ones(size), np.inf)
    found = minimize_quadratic(
        hessian, np.zeros(size + 1), both, np.full(len(upper), -np.inf), upper, reach
    )
    return scale if found is None else float(found[0][-1]) * scale

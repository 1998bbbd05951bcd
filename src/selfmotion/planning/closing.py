"""Equalities met to rounding, at the end of an optimisation."""

import numpy as np

from selfmotion.basics import Array
from selfmotion.engine import Objective

# Equalities are met to this [rad, rad/s], which Newton's method needs a few steps for.
_CLOSED, _STEPS = 1e-11, 12


def closed(objective: Objective, x: Array, inverse_hessian: Array) -> Array:
    """Return a point near `x` at which the equalities are met, by Newton's method.

    The step is the smallest in the metric of H⁻¹ that takes out the residual, so that it hardly
    changes the cost: -H Gᵀ(G H Gᵀ)⁻¹ h with G = ∂h/∂x. Where that leads no nearer: the nearest.

    Parameters
    ----------
    objective : Objective
    x : (size,)
    inverse_hessian : (size, size)
        H.
    """
    best, nearest = x, np.inf
    for _ in range(_STEPS):
        if not np.isfinite(sum(objective.terms(x).values())):
            break
        at = objective.conditions(x)
        residual = at.h[at.equality]
        miss = float(np.max(np.abs(residual), initial=0.0))
        # Conditions that contradict each other, or are out of reach, are not met by more steps.
        if not miss < nearest:
            break
        best, nearest = x, miss
        if miss < _CLOSED:
            break
        # A motion that hardly holds together has derivatives beyond all numbers.
        with np.errstate(over="ignore", invalid="ignore"):
            rows = objective.condition_rows(x).picked(np.flatnonzero(at.equality))
        if not np.all(np.isfinite(rows)):
            break
        spread = inverse_hessian @ rows.T
        # Least squares: conditions may depend on each other.
        x = x - spread @ np.linalg.lstsq(rows @ spread, residual)[0]
    return best

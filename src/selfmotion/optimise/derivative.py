"""Whether a gradient is that of the function."""

from collections.abc import Callable

import numpy as np

from selfmotion.basics import Array

# The difference is taken over this share of the step that the method wanted, and means something
# where it is so many times its own rounding.
_SHARE, _ABOVE_ROUNDING = 1e-4, 1e3
# The slope and the difference are taken for the same within this factor.
_FACTOR = 2.0


def is_misleading(
    value: Callable[[Array], float], x: Array, cost: float, step: Array, slope: float
) -> bool:
    """Return whether F does not change along `step` as its slope there says.

    One central difference; False where rounding hides the answer, or F is infinite nearby.

    Parameters
    ----------
    value : callable
        F.
    x, step : (size,)
    cost, slope : float
        F(x) and ∇F(x)ᵀ step.
    """
    rounding = float(np.finfo(float).eps) * abs(cost)
    if not abs(slope) * _SHARE > _ABOVE_ROUNDING * rounding:
        return False
    rise = value(x + _SHARE * step) - value(x - _SHARE * step)
    if not np.isfinite(rise):
        return False
    ratio = rise / (2.0 * _SHARE * slope)
    return not 1.0 / _FACTOR <= ratio <= _FACTOR

"""When a gradient misleads."""

import numpy as np
import pytest

from selfmotion.basics import Array
from selfmotion.planning.optimise.quasi_newton import is_misleading

X, STEP = np.array([1.0, -2.0]), np.array([0.5, 0.25])


@pytest.mark.parametrize("share", [-1.0, 0.0, 0.3, 0.49, 0.51, 1.0, 1.9, 2.1, 10.0])
def test_a_gradient_misleads_where_it_is_wrong_by_more_than_a_factor_of_two(share: float) -> None:
    gradient = np.array([3.0, 1.0])
    curved = 40.0

    def value(x: Array) -> float:
        s = x - X
        return 5.0 + float(gradient @ s) + curved * float(s @ s)

    claimed = float(gradient @ STEP) / share if share else 1e9
    assert is_misleading(value, X, 5.0, STEP, claimed) is not (0.5 <= share <= 2.0)


@pytest.mark.parametrize(("cost", "slope", "says"), [(1e9, -1e-3, False), (1e9, -1e5, True)])
def test_what_rounding_hides_does_not_mislead(cost: float, slope: float, says: bool) -> None:
    """Of a constant; and nothing is said where F is infinite nearby."""
    assert is_misleading(lambda x: cost, X, cost, STEP, slope) is says
    assert not is_misleading(lambda x: np.inf if x[0] > 1.0 else cost, X, cost, STEP, slope)
    # A difference counts from a thousand roundings on.
    least = 1e3 * np.finfo(float).eps * cost / 1e-4
    assert is_misleading(lambda x: cost, X, cost, STEP, 1.01 * least)
    assert not is_misleading(lambda x: cost, X, cost, STEP, 0.99 * least)

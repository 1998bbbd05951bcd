"""Windows: how a null motion comes to rest."""

import numpy as np
import pytest

from selfmotion.model.motion import resting_window


@pytest.mark.parametrize("orders", [(0, 0), (1, 0), (0, 2), (1, 1), (2, 2)])
def test_the_window_vanishes_to_its_orders_and_is_at_most_1(orders: tuple[int, int]) -> None:
    t, h = np.linspace(0.0, 3.0, 2001), 1e-6
    window = resting_window(t, 3.0, orders)
    assert 0.9999 < window.max() <= 1.0 + 1e-12
    for order, near in zip(orders, (np.array([h, 2 * h]), 3.0 - np.array([h, 2 * h])), strict=True):
        one, two = resting_window(near, 3.0, orders)
        # Twice as far from an end, s^a is 2^a times as much.
        assert two / one == pytest.approx(2.0**order, rel=1e-5)

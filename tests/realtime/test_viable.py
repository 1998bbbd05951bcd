"""Commands that can always be stopped: how fast is viable."""

import numpy as np
import pytest

from selfmotion.realtime.law import braking_distance, fastest, viable_accelerations


@pytest.mark.parametrize("seed", range(50))
def test_the_fastest_rate_uses_all_the_room(seed: int) -> None:
    rng = np.random.default_rng(seed)
    room, most, h = 10.0 ** rng.uniform(-8, 1), rng.uniform(0.5, 20.0), 10.0 ** rng.uniform(-3, -2)
    w = fastest(room, most, h)
    # Rounding, where thousands of cycles are added up.
    assert h * w + braking_distance(w, most, h) == pytest.approx(room, rel=1e-9)


def test_a_box_without_any_acceleration_to_choose_is_no_trouble() -> None:
    low, high = viable_accelerations(1.0, 0.0, -1.0, 1.0, 1.0, 5.0, 1e-3)
    assert low <= high <= 0.0

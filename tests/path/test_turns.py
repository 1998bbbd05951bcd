"""Turning: scipy's rotation spline, with rates that are those of the orientations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, RotationSpline

from selfmotion.path.waypoints import Turning

# Sums of some products of numbers below 10.
ROUNDING = 1e-12


@pytest.mark.parametrize("largest", [0.0, 1e-9, 0.1, 3.0])
def test_it_is_the_spline_of_scipy(largest: float) -> None:
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.3, 1.0, 8))
    first = Rotation.from_quat([[0.1, -0.2, 0.3, 0.9]])
    steps = Rotation.from_rotvec(largest * rng.uniform(-0.5, 0.5, (8, 3)))
    turns = [first[0]]
    for step in steps[1:]:
        turns.append(turns[-1] * step)
    turned = Rotation.concatenate(turns)
    spline = RotationSpline(t, turned)
    times = np.concatenate([t, rng.uniform(t[0], t[-1], 50)])
    rotation, rates = Turning(t, turned.as_quat(scalar_first=True)).at(times)
    np.testing.assert_allclose(rotation, spline(times).as_matrix(), atol=ROUNDING)
    # scipy's rates are in the axes that turn.
    expected = spline(times).apply(spline(times, 1))
    np.testing.assert_allclose(rates, expected, atol=ROUNDING)
    # Rates in the wrong axes are seen.
    if largest > 0.01:
        assert np.abs(rates - spline(times, 1)).max() > 1e-3

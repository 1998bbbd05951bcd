"""Velocity functions are resolved where nothing has looked yet, and turned as they say."""

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array

WAY = 1e-10


def bump(t: float, center: float, width: float) -> float:
    return float(np.exp(-(((t - center) / width) ** 2)) / (width * np.sqrt(np.pi)))


@pytest.mark.parametrize("place", np.random.default_rng(0).uniform(0.1, 0.9, 12))
@pytest.mark.parametrize("width", [0.012, 0.05, 0.5])
def test_no_smooth_sidestep_is_lost(place: float, width: float) -> None:
    """20 mm in next to no time, and 0.3 rad: wherever they are."""
    duration = 4.0 if width < 0.1 else 60.0

    def velocity(t: float) -> Array:
        found = np.zeros(6)
        found[0] = 0.02 * np.sin(np.pi * t / duration) ** 2
        found[1] = 0.02 * bump(t, place * duration, width)
        found[5] = 0.3 * bump(t, place * duration, width)
        return found

    path = sm.paths.TwistPath(pin.SE3.Identity(), velocity, duration)
    end = path.pose(duration)
    assert end.translation[1] == pytest.approx(0.02, abs=WAY)
    assert float(np.linalg.norm(pin.log3(end.rotation))) == pytest.approx(0.3, abs=WAY)

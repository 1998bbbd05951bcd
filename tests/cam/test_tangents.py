"""Turns on the spot go the shorter way, in steps that are no half turns."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from selfmotion.shop.cam.tangents import turning


@pytest.mark.parametrize("angle", [0.0, 0.4, -1.5, 1.7, -2.5, 3.1])
def test_a_turn_on_the_spot_is_about_the_tools_axis_and_the_shorter_way(angle: float) -> None:
    first = np.asarray(pin.exp3(np.array([0.3, -0.8, 0.5])))
    last = first @ np.asarray(pin.exp3(np.array([0.0, 0.0, angle])))
    found = turning(first, last)
    np.testing.assert_array_equal(found[0], first)
    np.testing.assert_array_equal(found[-1], last)
    steps = [pin.log3(a.T @ b) for a, b in pairwise(found)]
    np.testing.assert_allclose(np.sum(steps, axis=0), [0.0, 0.0, angle], atol=1e-9)
    # A step of more than a quarter turn is divided, and no other.
    assert len(steps) == (1 if abs(angle) <= 0.5 * np.pi else 2)
    assert max(np.linalg.norm(step) for step in steps) <= 0.5 * np.pi


def test_a_quarter_turn_is_one_step_either_way() -> None:
    """The most for which the shortest turn is known well: square corners have no pose more."""
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    for last in (quarter, quarter.T):
        assert len(turning(np.eye(3), last)) == 2
    assert len(turning(quarter, quarter.T)) == 3

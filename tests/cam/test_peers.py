"""Arcs through three points: on one circle, in their order, and as near to it as chords are."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from selfmotion.shop.cam import arcs
from selfmotion.shop.cam.peers import _arc

# Of centres that follow from points by products of their distances.
ROUNDING = 1e-9


@pytest.mark.parametrize("seed", range(6))
def test_an_arc_through_three_points_is_on_their_circle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    center, radius = rng.normal(size=3), rng.uniform(0.05, 0.5)
    turn = np.asarray(pin.exp3(rng.normal(size=3)))
    # The middle is between both ends, anywhere.
    last = rng.uniform(0.5, 6.0)
    angles = np.array([0.0, rng.uniform(0.1, 0.9) * last, last])
    plane = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(3)])
    points = center + radius * plane @ turn.T
    found = _arc(Path("it"), 1, *points)
    for part, end in zip(found, points[1:], strict=True):
        np.testing.assert_allclose(part[-1], end, atol=ROUNDING)
    every = np.vstack([points[:1], *found])
    away = (every - center) @ turn
    np.testing.assert_allclose(np.linalg.norm(every - center, axis=1), radius, atol=ROUNDING)
    np.testing.assert_allclose(away[:, 2], 0.0, atol=ROUNDING)
    # They go round once, forwards; chords are near to the circle.
    steps = np.diff(np.unwrap(np.arctan2(away[:, 1], away[:, 0])))
    assert (steps > 0.0).all()
    assert steps.sum() == pytest.approx(last)
    sagitta = radius * (1.0 - np.cos(0.5 * steps))
    assert sagitta.max() <= arcs._CHORD_TOLERANCE * (1.0 + ROUNDING)


def test_three_points_on_a_line_are_a_line() -> None:
    ends = np.array([[0.0, 0.0, 0.0], [0.1, 0.2, 0.0], [0.2, 0.4, 0.0]])
    first, last = _arc(Path("it"), 1, *ends)
    np.testing.assert_array_equal(first, ends[1:2])
    np.testing.assert_array_equal(last, ends[2:])

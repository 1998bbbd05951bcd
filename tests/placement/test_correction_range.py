"""How far a correction may go: sizes are bisected until they are known well enough."""

import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import silent
from selfmotion.work.placement import Corner, correction_range
from selfmotion.work.placement.correction_range import _first_order_range, _RangeSearch
from selfmotion.work.placement.places import COORDINATES, places_of
from support.gantries import gantry

# Largest size that is looked for [m].
MOST = 1.0


class Sized(_RangeSearch):
    """Corners that hold up to a size, without motions."""

    def __init__(self, largest: float) -> None:
        super().__init__(None, None, silent)  # type: ignore[arg-type]
        self.largest, self.sizes = largest, list[float]()

    def _corners_at(self, size, directions) -> list[Corner]:  # type: ignore[no-untyped-def]
        assert len(directions) == 14
        self.sizes.append(size)
        return [Corner(directions[0][0], size, "too far" if size > self.largest else "")]


@pytest.mark.parametrize("estimate", [0.0, 0.02, 5.0])
@pytest.mark.parametrize("largest", [0.0137, 0.1, 0.4321, 2.0])
def test_the_largest_size_is_known_to_a_share_of_itself(
    monkeypatch: pytest.MonkeyPatch, largest: float, estimate: float
) -> None:
    """Whatever joint limits say to first order."""
    monkeypatch.setattr(correction_range, "_first_order_range", lambda *_: estimate)
    found = Sized(largest)
    size = found.search(range(3), "m", MOST).size / correction_range._INSCRIBED
    share = 1.0 - 0.5**correction_range._HALVINGS
    assert min(share * largest, MOST) <= size <= min(largest, MOST)
    # No size after that is asked for: before the last one it was not known.
    low = max((each for each in found.sizes[:-1] if each <= largest), default=0.0)
    high = min((each for each in found.sizes[:-1] if each > largest), default=math.inf)
    assert low < MOST
    assert low < share * high


def test_nothing_is_claimed_where_no_size_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(correction_range, "_first_order_range", lambda *_: 0.01)
    side = Sized(0.0).search(range(3, 6), "rad", MOST)
    assert side.size == 0.0
    assert "too far" in side.stops


def test_directions_are_the_axes_and_the_middles_of_octants() -> None:
    """All of length 1, no two alike, and none without its opposite."""
    every = correction_range._DIRECTIONS
    np.testing.assert_allclose(np.linalg.norm(every, axis=1), 1.0)
    products = every @ every.T - 2.0 * np.eye(len(every))
    assert products.max() < 0.9
    assert (products.min(axis=1) <= -1.0 + 1e-12).all()


@pytest.mark.parametrize("of", ["part", "base"])
def test_to_first_order_slides_go_as_far_as_their_limits(tmp_path: Path, of: str) -> None:
    """A part takes the slides along; a base that moves leaves them behind."""
    limits = [
        f'lower="{low}" upper="{high}" velocity="9" effort="9"'
        for low, high in ((-0.5, 0.8), (-0.9, 0.4), (-1.0, 1.5), (-3.0, 3.0))
    ]
    arm = gantry(tmp_path, limits)
    start, end = np.array([0.1, -0.2, 0.3]), np.array([0.2, 0.1, 0.3])
    line = sm.paths.Line(pin.SE3(np.eye(3), start), pin.SE3(np.eye(3), end), 1.0)
    plan = sm.plan(sm.Problem(arm, line, "position", np.append(start, 0.0)))
    places = places_of([plan.problem], of, () if of == "part" else None, None, COORDINATES)
    lower, upper = arm.lower[:3], arm.upper[:3]
    above, below = upper - np.maximum(start, end), np.minimum(start, end) - lower
    for k in range(3):
        for sign in (-1.0, 1.0):
            direction = sign * np.eye(6)[k]
            goes_up = (sign > 0.0) == (of == "part")
            expected = above[k] if goes_up else below[k]
            assert _first_order_range(places, plan, direction) == pytest.approx(expected)

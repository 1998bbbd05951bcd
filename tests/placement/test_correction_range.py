"""How far a correction may go: sizes are bisected until they are known well enough."""

import math

import numpy as np
import pytest

from selfmotion.basics import silent
from selfmotion.work.placement import Corner, correction_range
from selfmotion.work.placement.correction_range import _RangeSearch

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

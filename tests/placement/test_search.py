"""From a place downhill, on costs by a formula: derivatives, steps and bounds."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from selfmotion.basics import Array
from selfmotion.planning.result import Plan
from selfmotion.work.placement import Tried, search
from selfmotion.work.placement.place import _Here
from selfmotion.work.placement.places import Places
from selfmotion.work.placement.search import Box, Descent

LOW, HIGH = np.array([-1.0, 2.0]), np.array([1.0, 6.0])
BOX = Box(LOW, HIGH)
# Central differences of a quadratic are exact up to rounding over their distance squared.
ROUNDING = 1e-8
SLOPE, BEND = np.array([3.0, -2.0]), np.array([[6.0, 1.0], [1.0, 2.0]])


def quadratic(place: Array) -> float:
    """Return a cost with these derivatives by shares of the box where x is in its middle."""
    away = BOX.share(place) - 0.5
    return float(10.0 + SLOPE @ away + 0.5 * away @ BEND @ away)


class Formula(Places):
    """Places whose costs are a formula; notes which are planned."""

    def __init__(self, cost: Callable[[Array], float]) -> None:
        super().__init__((), "part", frozenset(), np.zeros(3), ("x", "y"))
        object.__setattr__(self, "cost", cost)
        object.__setattr__(self, "planned", [])

    def tried(self, place: Array, near: Sequence[Plan] = (), thorough: bool = False) -> Tried:
        self.planned.append(BOX.share(place))  # type: ignore[attr-defined]
        return Tried(place, self.cost(place))  # type: ignore[attr-defined]


def descent(cost: Callable[[Array], float], share: Sequence[float]) -> tuple[Descent, Tried]:
    """Return a descent, and the place at shares of the box where it begins."""
    places = Formula(cost)
    begun = places.tried(BOX.at(np.array(share)))
    return Descent(places, BOX, lambda _: None), begun


def planned(found: Descent) -> Array:
    return np.array(found.places.planned)  # type: ignore[attr-defined]


@pytest.mark.parametrize("share", [(0.5, 0.5), (0.2, 0.9)])
def test_derivatives_are_by_shares_of_the_box(share: tuple[float, float]) -> None:
    found, begun = descent(quadratic, share)
    expected = SLOPE + BEND @ (np.array(share) - 0.5)
    slope, bend = found._derivatives(begun, both=True)
    np.testing.assert_allclose(slope, expected, rtol=ROUNDING)
    np.testing.assert_allclose(bend, np.diag(BEND), rtol=1e3 * ROUNDING)
    # By one side alone up to the curvature over that distance.
    slope, bend = found._derivatives(begun, both=False)
    np.testing.assert_allclose(slope, expected, atol=4.0 * search._DIFFERENCE)
    assert not bend.any()


@pytest.mark.parametrize("share", [(0.0, 1.0), (1.0, 0.0), (0.5, 1.0)])
def test_no_place_beyond_the_box_is_planned(share: tuple[float, float]) -> None:
    """Derivatives at its ends are taken to one side."""
    found, begun = descent(quadratic, share)
    slope, _ = found._derivatives(begun, both=True)
    expected = SLOPE + BEND @ (np.array(share) - 0.5)
    np.testing.assert_allclose(slope, expected, atol=4.0 * search._DIFFERENCE)
    found.run(begun)
    shares = planned(found)
    assert shares.min() >= 0.0
    assert shares.max() <= 1.0


def test_a_bound_that_holds_is_followed() -> None:
    """The cost rises inwards from one end: only differences look there."""
    found, begun = descent(lambda place: float(BOX.share(place) @ [50.0, -1.0]), (0.0, 0.0))
    arrived = found.run(begun)
    np.testing.assert_allclose(BOX.share(arrived.place), [0.0, 1.0], atol=ROUNDING)
    assert planned(found)[:, 0].max() <= search._DIFFERENCE * (1.0 + ROUNDING)


def test_a_bound_that_holds_takes_nothing_from_a_step() -> None:
    """However little the cost falls outwards: the whole length is for what can move."""
    found, begun = descent(lambda place: float(BOX.share(place) @ [-0.9, -0.5]), (1.0, 0.0))
    found.run(begun)
    # After the place itself and one difference for each coordinate.
    np.testing.assert_allclose(planned(found)[3], [1.0, search._LONGEST], atol=ROUNDING)


def test_how_costs_bend_across_a_bound_that_holds_is_of_no_account() -> None:
    """Along it costs are the same, and so are all steps, whichever way they bend across."""

    def along(twist: float) -> Array:
        def cost(place: Array) -> float:
            x, y = BOX.share(place)
            return float(1.0 + x * (5.0 + twist * (y - 0.2)) + 20.0 * (y - 0.7) ** 4)

        found, begun = descent(cost, (0.0, 0.2))
        arrived = found.run(begun)
        assert abs(BOX.share(arrived.place)[1] - 0.7) < abs(BOX.share(begun.place)[1] - 0.7)
        return planned(found)

    # The first step takes slopes, all others the changes of them.
    one, other = along(4.0), along(-4.0)
    assert len(one) > 10
    np.testing.assert_allclose(one, other, atol=1e2 * ROUNDING)


def test_no_step_is_longer_than_the_longest() -> None:
    found, begun = descent(lambda place: float(BOX.share(place) @ [-3.0, -4.0]), (0.0, 0.0))
    assert found.run(begun).cost < begun.cost
    places = planned(found)
    # From each place to the next one beyond differences.
    lengths = np.linalg.norm(np.diff(places, axis=0), axis=1)
    longest = search._LONGEST + 2.0 * search._DIFFERENCE
    assert search._LONGEST - 2.0 * search._DIFFERENCE <= lengths.max() <= longest


def test_a_step_that_does_not_gain_is_halved() -> None:
    """Beyond a wall costs are high: what is returned lies before it, and is cheaper."""

    def walled(place: Array) -> float:
        share = BOX.share(place)
        return 9.0 if share[0] > 0.2 else 1.0 - float(share[0])

    found, begun = descent(walled, (0.1, 0.5))
    better = found._along(begun, np.array([0.1, 0.5]), np.array([0.3, 0.0]))
    assert better is not None
    assert better.cost < begun.cost
    assert found._along(begun, np.array([0.1, 0.5]), np.array([-0.1, 0.0])) is None


def test_a_step_that_gains_at_an_eighth_of_its_length_is_found() -> None:
    """And none below that."""

    def walled(place: Array) -> float:
        share = float(BOX.share(place)[0])
        return 9.0 if share > edge else 1.0 - share

    for part, is_found in ((8.0, True), (16.0, False)):
        edge = 1.01 * search._LONGEST / part
        found, begun = descent(walled, (0.0, 0.5))
        better = found._along(begun, np.array([0.0, 0.5]), np.array([search._LONGEST, 0.0]))
        assert (better is not None) is is_found


def test_beginnings_are_the_same_each_time_and_all_over_the_box() -> None:
    """Each quarter of the box has as many; more of them are others."""
    first, again, more = (search.beginnings(BOX, *which) for which in ((0, 15), (0, 15), (15, 31)))
    np.testing.assert_array_equal(first, again)
    assert not {place.tobytes() for place in first} & {place.tobytes() for place in more}
    shares = np.array([BOX.share(place) for place in [*first, *more]])
    assert shares.min() >= 0.0
    assert shares.max() < 1.0
    quarters = 2 * (shares[:, 0] >= 0.5) + (shares[:, 1] >= 0.5)
    # The corner is left out.
    assert sorted(np.bincount(quarters).tolist()) == [7, 8, 8, 8]


def test_a_box_holds_its_ends_and_nothing_beyond() -> None:
    for share in ((0.0, 0.0), (1.0, 0.5), (1.0, 1.0)):
        assert BOX.holds(BOX.at(np.array(share)))
    for share in ((-0.01, 0.5), (0.5, 1.01)):
        assert not BOX.holds(BOX.at(np.array(share)))


def test_each_place_is_noted_and_told_as_it_is_planned() -> None:
    told: list[int] = []
    here = _Here(Formula(quadratic), BOX, lambda stage, done, total: told.append(done))
    first = here.every(search.beginnings(BOX, 0, 4))
    assert here.tried == first
    more = here.near([(BOX.at(np.array([0.5, share])), first[0]) for share in (0.1, 0.9)])
    assert here.tried == [*first, *more]
    assert told == [1, 2, 3, 4, 5, 6]
    ((arrived, tried),) = here.descents(first[:1])
    assert arrived.cost <= first[0].cost
    assert len(here.tried) == told[-1] == 6 + len(tried)

"""A map over two coordinates of a place, on costs by a formula."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.planning.result import Plan
from selfmotion.work.placement import Placement, Tried, results
from selfmotion.work.placement.places import Places
from selfmotion.work.placement.search import Box

NAMES = ("x", "y", "yaw")
BEST = np.array([0.1, -0.2, 0.3])


class Formula(Places):
    """Places that cost more the farther they are from the best."""

    def tried(self, place: Array, near: tuple[Plan, ...] = (), thorough: bool = False) -> Tried:  # type: ignore[override]
        return Tried(place, 1.0 + float(np.sum((place - BEST) ** 2)))


def placement() -> Placement:
    """Return the best place of a base, without plans."""
    places = Formula((), "base", frozenset(), np.zeros(3), NAMES)
    box, best = Box(np.full(3, -0.5), np.full(3, 0.5)), places.tried(BEST)
    place = dict(zip(NAMES, BEST.tolist(), strict=True))
    known = places, box, best
    return Placement("base", place, pin.SE3.Identity(), (), (), 1.0, 2.0, (), (), *known)


@pytest.mark.parametrize("names", [None, ("x", "y"), ("yaw", "x")])
def test_a_map_varies_two_coordinates_and_leaves_the_others_at_best(
    names: tuple[str, str] | None,
) -> None:
    """By default the first two."""
    drawn = placement().map(names, points=3)
    first, second = names or NAMES[:2]
    assert drawn.names == (first, second)
    np.testing.assert_allclose(drawn.across, [-0.5, 0.0, 0.5])
    for i, up in enumerate(drawn.up):
        for j, across in enumerate(drawn.across):
            place = BEST.copy()
            place[NAMES.index(first)], place[NAMES.index(second)] = across, up
            assert drawn.costs[i, j] == pytest.approx(1.0 + np.sum((place - BEST) ** 2))
    # Where the base moves no part has an outline.
    assert drawn.outline.shape == (0, 2)


def test_the_outline_of_a_part_is_about_its_best_place(monkeypatch: pytest.MonkeyPatch) -> None:
    """From above; wherever the part is drawn in the problem, and as large."""
    drawn = np.array([[3.0, 5.0], [3.4, 5.0], [3.4, 5.2]])
    monkeypatch.setattr(results, "footprint", lambda problems, bodies: drawn)
    outline = replace(placement(), of="part").map(points=2).outline
    half = np.array([0.2, 0.1])
    np.testing.assert_allclose(outline.min(axis=0), BEST[:2] - half)
    np.testing.assert_allclose(outline.max(axis=0), BEST[:2] + half)


@pytest.mark.parametrize("names", [("x",), ("x", "x"), ("x", "z"), NAMES])
def test_a_map_is_of_two_different_coordinates_of_the_box(names: tuple[str, ...]) -> None:
    with pytest.raises(sm.errors.PlanError, match="a map is over two of x, y, yaw"):
        placement().map(names)


def test_a_map_has_its_costs_written_in_it_unless_more_points_are_asked_for() -> None:
    few, many = placement().map(), placement().map(points=20)
    assert few.costs.shape == few.costs.T.shape
    written = [drawn.svg().count(f">{drawn.costs[0, 0]:.3g}</text>") for drawn in (few, many)]
    assert written[0] > 0
    assert written[1] == 0


@pytest.mark.parametrize(
    ("before", "said"),
    [
        (4.0, "cost 1 (4 at the present place, 75.0% less)"),
        (0.0, "cost 1 (0 at the present place, 0.0% less)"),
        (np.inf, "cost 1 (no verified motion at the present place)"),
        (np.nan, "cost 1 (the present place is not in the box)"),
    ],
)
def test_what_another_place_saves_is_said(before: float, said: str) -> None:
    assert said in str(replace(placement(), cost_before=before))

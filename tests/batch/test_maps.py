"""Maps of what a grid costs: every problem is in one cell, which says how it ended."""

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import pytest

from selfmotion.work.batch import Row, labels, maps

X, Y, YAW = "workpiece.frame.position.0", "workpiece.frame.position.1", "workpiece.frame.rpy_deg.2"
NS = "{http://www.w3.org/2000/svg}"


def row(name: str, settings: dict[str, Any], cost: float | None, why: str = "far") -> Row:
    if cost is None:
        error = f"the pose is <not> reached: {why} & farther"
        return Row(name, "", Path(name), settings, error=error, reason="out of reach")
    return Row(
        name, "", Path(name), settings, reason="", verified=True, verdict="verified", cost=cost,
        aim=cost,
    )  # fmt: skip


def places() -> list[Row]:
    """Twelve places in two turns of a part, of which some are refused; the eighth is the best."""
    grid = [(x, y, turn) for x in (0.2, 0.4, 0.6) for y in (-0.1, 0.1) for turn in (0, 90)]
    costs = [9, 8, None, 7, 6, None, 5, 1, 2, 3, None, 4]
    return [
        row(f"a-{k:02d}", dict(zip((X, Y, YAW), place, strict=True)), cost)
        for k, (place, cost) in enumerate(zip(grid, costs, strict=True))
    ]


def cells(picture: str) -> dict[str, ElementTree.Element]:
    """Return the cells of a map by what their problem is called."""
    found = ElementTree.fromstring(picture)
    titled = [(group.find(f".//{NS}title"), group) for group in found.iter(f"{NS}g")]
    return {str(t.text).partition(":")[0]: group for t, group in titled if t is not None}


def test_every_problem_is_in_one_cell_that_says_how_it_ended() -> None:
    rows = places()
    pictures = maps(rows, {"a-07": "replays/a-07.html"})
    assert len(pictures) == 2  # one for each turn
    shown = [cells(picture) for picture in pictures]
    assert sorted(name for each in shown for name in each) == [item.name for item in rows]
    for item in rows:
        (cell,) = (each[item.name] for each in shown if item.name in each)
        said = " ".join(text.text or "" for text in cell.iter(f"{NS}text"))
        assert said == (f"{item.cost:.4g}" if item.verified else "out of reach")
        (title,) = cell.iter(f"{NS}title")
        assert title.text == f"{item.name}: {item.error or item.verdict}"
    assert pictures[1].count('href="replays/a-07.html"') == 1


def test_cells_are_where_their_numbers_say() -> None:
    """The first number goes to the right, the second one up."""
    rows = places()
    for picture in maps(rows, {}):
        found = cells(picture)
        for item in rows:
            for other in rows:
                if {item.name, other.name} <= set(found):
                    a, b = (found[each.name].find(f"{NS}rect") for each in (item, other))
                    assert a is not None
                    assert b is not None
                    x, y = (float(a.get(k, "")) - float(b.get(k, "")) for k in "xy")
                    more = [item.settings[key] - other.settings[key] for key in (X, Y)]
                    assert (x > 0, x < 0) == (more[0] > 0, more[0] < 0)
                    assert (y < 0, y > 0) == (more[1] > 0, more[1] < 0)


def test_the_best_is_framed_and_dearer_ones_are_lighter() -> None:
    rows = places()
    both = {name: cell for picture in maps(rows, {}) for name, cell in cells(picture).items()}
    frame = f"{NS}rect[@stroke-width]"
    assert [name for name, cell in both.items() if cell.find(frame) is not None] == ["a-07"]
    light = []
    for item in sorted((item for item in rows if item.verified), key=lambda each: each.cost):
        rect = both[item.name].find(f"{NS}rect")
        assert rect is not None
        light.append(sum(map(int, re.findall(r"\d+", rect.get("fill", "")))))
    assert light == sorted(light)
    assert len(set(light)) == len(light)


@pytest.mark.parametrize("least", [1.0, 0.0])
def test_colours_tell_costs_apart_beside_a_dear_one(least: float) -> None:
    """By ratios where they are positive: 1 and 3 beside 300; one without cost is the best."""
    costs = (least, 3.0, 300.0)
    rows = [row(f"a-{k}", {X: k, Y: k}, cost) for k, cost in enumerate(costs)]
    (picture,) = maps(rows, {})
    fills = [r"rgb\((\d+),(\d+),(\d+)\)", re.escape("rgb(255,243,205)")]
    reds = [int(found[0]) for found in re.findall(fills[0], picture)]
    assert len(re.findall(fills[1], picture)) == 1
    assert reds == sorted(reds)
    # A fifth of the way from 1 to 300, which steps of equal size would leave at a hundredth.
    assert (reds[1] - reds[0] > 255 // 6) == (least > 0.0)


@pytest.mark.parametrize(
    "settings",
    [
        [{}, {}],
        [{"path.duration": 4}, {"path.duration": 5}],
        [{X: 1, "task": "pose"}, {X: 2, "task": "position"}],
        [{X: 1, Y: 0}, {X: 2, Y: 0}],
    ],
)
def test_there_is_no_map_where_fewer_than_two_numbers_vary(
    settings: list[Any],
) -> None:
    assert maps([row(f"a-{k}", each, 1.0) for k, each in enumerate(settings)], {}) == []


def test_lists_count_by_their_numbers_and_files_have_maps_of_their_own() -> None:
    place = "workpiece.frame.position"
    listed = [{place: [x, y, 0.2]} for x in (0.3, 0.4) for y in (-0.1, 0.1)]
    rows = [row(f"{stem}-{k}", each, None) for stem in "ab" for k, each in enumerate(listed)]
    first, second = maps(rows, {})
    assert set(cells(first)) == {f"a-{k}" for k in range(4)}
    assert set(cells(second)) == {f"b-{k}" for k in range(4)}
    assert "none is verified" in first
    assert "x [m]" in first
    assert "y [m]" in first


def test_keys_are_called_differently() -> None:
    assert labels([X, Y, YAW]) == ["x [m]", "y [m]", "yaw [°]"]
    assert labels(["path.duration", "costs.1.mu"]) == ["duration", "mu"]
    assert labels(["start.3", "task"]) == ["start.3", "task"]
    two = [X, "robot.base.position.0"]
    assert labels(two) == two

"""The map of places as a picture: what is drawn lies where its place is, coloured by its cost."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.work.placement import page, picture
from selfmotion.work.placement.picture import _share, legend_of, picture_of

# Columns and rows are of different sizes [m].
ACROSS, UP = np.linspace(-0.2, 0.3, 6), np.linspace(0.1, 0.5, 9)
# Numbers in the picture have one digit after the point.
DRAWN = 0.11
# Lines are apart by this many sizes of their letters.
EASY = 1.4


def cost(x: float, y: float) -> float:
    """Return a cost that rises evenly, and least in one corner."""
    return 1.0 + 0.6 * (x - ACROSS[0]) + 0.3 * (y - UP[0])


def drawn() -> ElementTree.Element:
    """Return the picture of these costs."""
    costs = np.array([[cost(x, y) for x in ACROSS] for y in UP])
    whole = (("",) * len(ACROSS),) * len(UP)
    outline = np.array([[-0.05, 0.2], [0.15, 0.2], [0.15, 0.4]])
    best = np.array([[ACROSS[0], UP[0]], [0.1, 0.3]])
    shown = sm.placement.PlaceMap(("x", "y"), ACROSS, UP, costs, whole, best, outline)
    return ElementTree.fromstring(re.sub(r' xmlns="[^"]*"', "", picture_of(shown)))


def numbers(part: ElementTree.Element, *names: str) -> list[float]:
    return [float(part.get(name, "nan")) for name in names]


def cells_of(root: ElementTree.Element) -> np.ndarray:
    """Return left, top, width and height of all cells, (U, C, 4)."""
    found = [numbers(part, "x", "y", "width", "height") for part in root.iterfind("g/rect")]
    return np.array(found).reshape(len(UP), len(ACROSS), 4)


def pixels_of(root: ElementTree.Element) -> tuple[np.ndarray, np.ndarray]:
    """Return where columns and rows have their middles."""
    cells = cells_of(root)
    return cells[0, :, 0] + 0.5 * cells[0, :, 2], cells[:, 0, 1] + 0.5 * cells[:, 0, 3]


def place_of(root: ElementTree.Element, x: float, y: float) -> tuple[float, float]:
    """Return the place that is drawn at x, y."""
    columns, rows = pixels_of(root)
    return (
        float(np.polyval(np.polyfit(columns, ACROSS, 1), x)),
        float(np.polyval(np.polyfit(rows, UP, 1), y)),
    )


def test_cells_are_side_by_side_and_the_first_row_is_lowest() -> None:
    cells = cells_of(drawn())
    np.testing.assert_allclose(cells[:, 1:, 0], cells[:, :-1, 0] + cells[:, :-1, 2], atol=DRAWN)
    np.testing.assert_allclose(cells[:-1, :, 1], cells[1:, :, 1] + cells[1:, :, 3], atol=DRAWN)
    # Lengths to scale: as many pixels for a metre up as across.
    wide, high = cells[0, 0, 2] / np.diff(ACROSS)[0], cells[0, 0, 3] / np.diff(UP)[0]
    assert wide == pytest.approx(high, rel=0.01)
    _, _, right, bottom = map(float, drawn().get("viewBox", "").split())
    assert cells[..., 0].min() >= 0.0
    assert (cells[..., 0] + cells[..., 2]).max() <= right
    assert cells[..., 1].min() >= 0.0
    assert (cells[..., 1] + cells[..., 3]).max() <= bottom


def test_numbers_of_axes_stand_at_their_columns_and_rows() -> None:
    root = drawn()
    columns, rows = pixels_of(root)
    bottom = max(cell[1] + cell[3] for cell in cells_of(root).reshape(-1, 4))
    below = [part for part in root.iterfind("text") if numbers(part, "y")[0] > bottom]
    beside = [part for part in root.iterfind("text") if part.get("text-anchor") == "end"]
    told = {part.text: numbers(part, "x")[0] for part in below}
    assert told["0"] == pytest.approx(columns[2], abs=DRAWN)
    assert told["300"] == pytest.approx(columns[-1], abs=DRAWN)
    assert len(beside) == len(UP)
    for part, row in zip(beside, rows, strict=True):
        size, y = numbers(part, "font-size", "y")
        # Letters stand on y: their middle is some third of their size above it.
        assert y - 0.5 * size < row < y - 0.2 * size
    # Those of both axes are alike, and smaller than their names.
    sizes = {part.get("font-size") for part in (*beside, *below[:-1])}
    assert len(sizes) == 1
    size, y = numbers(below[-1], "font-size", "y")
    assert float(sizes.pop() or 0) < size
    # Lines of text have room: as far apart as lines of a page that is easy to read.
    assert y - numbers(below[0], "y")[0] >= EASY * size


def test_names_of_axes_are_in_their_middles() -> None:
    root = drawn()
    columns, rows = pixels_of(root)
    (across,) = (part for part in root.iterfind("text") if part.text == "x [mm]")
    assert numbers(across, "x")[0] == pytest.approx(columns.mean(), abs=DRAWN)
    (turned,) = (part for part in root.iterfind("g") if part.get("transform"))
    (up,) = turned.iterfind("text")
    assert up.text == "y [mm]"
    angle, x, y = map(float, re.findall(r"-?[0-9.]+", turned.get("transform", "")))
    assert angle == -90.0
    assert y == pytest.approx(rows.mean(), abs=DRAWN)
    # It is turned about its own middle.
    assert numbers(up, "x")[0] == x
    assert 0.2 < (numbers(up, "y")[0] - y) / numbers(up, "font-size")[0] < 0.5


def test_contours_are_where_costs_are_that_much_above_the_least() -> None:
    root = drawn()
    lines = [part for part in root.iterfind("path") if part.get("stroke") == "#222"]
    told = [part.text for part in root.iterfind("text") if (part.text or "").startswith("+")]
    assert told == ["+5%", "+10%", "+25%"]
    cell = np.hypot(*cells_of(root)[0, 0, 2:])
    for line, more in zip(lines, (0.05, 0.1, 0.25), strict=True):
        for piece in line.get("d", "").split("M")[1:]:
            ends = [tuple(map(float, end.split(","))) for end in piece.split("L")]
            for end in ends:
                assert cost(*place_of(root, *end)) == pytest.approx(1.0 + more, abs=1e-3)
            assert np.hypot(*np.subtract(*ends)) <= cell


def test_numbers_of_contours_are_over_no_cost() -> None:
    root = drawn()
    costs = [text for cell in root.iterfind("g") for text in cell.iterfind("text")]
    told = [part for part in root.iterfind("text") if (part.text or "").startswith("+")]
    for one in told:
        for other in costs:
            (x, y, size), (i, j, _) = (
                numbers(part, "x", "y", "font-size") for part in (one, other)
            )
            assert abs(y - j) > size or abs(x - i) > 3 * size


def test_colours_go_from_the_cheapest_to_the_dearest() -> None:
    fills = [part.get("fill", "") for part in drawn().iterfind("g/rect")]
    mixed = np.array([list(map(int, re.findall(r"\d+", fill))) for fill in fills])
    costs = np.array([cost(x, y) for y in UP for x in ACROSS])
    assert tuple(mixed[np.argmin(costs)]) == picture._BEST
    assert tuple(mixed[np.argmax(costs)]) == picture._WORST
    # All of their three numbers rise with the cost.
    assert (np.diff(mixed[np.argsort(costs)], axis=0) >= 0).all()


def test_costs_are_told_apart_by_ratios_or_by_differences_where_there_are_none() -> None:
    assert _share(2.0, 1.0, 4.0) == pytest.approx(0.5)
    assert _share(1.0, -1.0, 3.0) == _share(1.0, 0.0, 2.0) == 0.5
    assert _share(1.0, 1.0, 1.0) == 0.0
    for least in (-1.0, 0.0, 0.5):
        assert _share(least, least, 3.0) == 0.0
        assert _share(3.0, least, 3.0) == 1.0


def test_numbers_are_written_in_their_cells() -> None:
    """Costs with three digits, as long as there are few cells; else the picture has none."""
    root = drawn()
    cells = [cell for cell in root.iterfind("g") if cell.find("rect") is not None]
    for cell in cells:
        rect, text = cell.find("rect"), cell.find("text")
        assert rect is not None
        assert text is not None
        left, top, wide, high = numbers(rect, "x", "y", "width", "height")
        x, y, size = numbers(text, "x", "y", "font-size")
        assert x == pytest.approx(left + 0.5 * wide, abs=DRAWN)
        assert top + size <= y <= top + high
    costs = [f"{cost(x, y):.3g}" for y in UP for x in ACROSS]
    assert [cell.findtext("text") for cell in cells] == costs


def test_the_places_to_choose_from_and_the_part_are_where_they_are() -> None:
    root = drawn()
    second, first = (numbers(part, "cx", "cy") for part in root.iterfind("circle"))
    assert place_of(root, *first) == pytest.approx((ACROSS[0], UP[0]), abs=1e-3)
    assert place_of(root, *second) == pytest.approx((0.1, 0.3), abs=1e-3)
    (outline,) = root.iterfind("polygon")
    corners = [tuple(map(float, each.split(","))) for each in outline.get("points", "").split()]
    assert place_of(root, *corners[2]) == pytest.approx((0.15, 0.4), abs=1e-3)


def test_the_most_frequent_reasons_are_told_first() -> None:
    """And only so many of them."""
    kinds = page._MOST_REASONS + 1
    reasons = tuple(
        tuple(f"reason {row}" if column <= row else "" for column in range(kinds))
        for row in range(kinds)
    )
    axis = 0.1 * np.arange(float(kinds))
    nothing = np.full((kinds, kinds), np.nan)
    shown = sm.placement.PlaceMap(
        ("x", "y"), axis, axis, nothing, reasons, np.empty((0, 2)), np.empty((0, 2))
    )
    told = re.findall(r"<li>reason (\d+): [^<]*?(?: and (\d+) more)?</li>", page._reasons(shown))
    assert [int(kind) for kind, _ in told] == list(range(kinds - 1, 0, -1))
    # Of the first all but one are counted.
    assert told[0][1] == str(kinds - 1)


@pytest.mark.parametrize(
    ("costs", "reasons", "said"),
    [
        ((1.0, 2.0), ("", ""), ["cost 1 to 2", "as much dearer"]),
        ((1.0, np.nan), ("", "no plan"), ["cost 1 to 1", "in reach, but no plan"]),
        ((np.nan, np.nan), ("out of reach", "no plan"), ["in reach, but no plan", "out of reach"]),
    ],
)
def test_the_legend_says_what_there_is(
    costs: tuple[float, ...], reasons: tuple[str, ...], said: list[str]
) -> None:
    """Of one cost there are no lines of others; the part only where it has an outline."""
    for outline, more in ((np.empty((0, 2)), []), (np.ones((3, 2)), ["the part, to scale"])):
        places = sm.placement.PlaceMap(
            ("x", "y"), ACROSS[:2], UP[:1], np.array([costs]), (reasons,), np.empty((0, 2)), outline
        )
        legend = legend_of(places)
        assert re.findall(r"</i>(.*?)</span>", legend) == [*said, *more]

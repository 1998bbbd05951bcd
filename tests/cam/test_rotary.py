"""Lines of a machine whose table turns: chords are near enough to what they stand for."""

import numpy as np
import pytest

from selfmotion.basics import Array
from selfmotion.shop.cam import rotary
from selfmotion.shop.cam.rotary import HEAD, TABLE, Rotary

CENTER = np.array([0.1, -0.2, 0.3])
# Positions of the machine [m], and how far the table turns meanwhile [rad].
LINES = [
    ((0.0, 0.0, 0.0), (0.5, 0.0, 0.0), 0.1),
    ((0.4, 0.1, 0.0), (0.4, 0.1, 0.0), 1.0),
    ((-0.3, 0.2, 0.1), (0.6, -0.4, 0.1), 0.02),
    ((0.3, 0.0, 0.1), (0.0, 0.3, -0.1), -2.0),
]


def along(table: Rotary, start: Array, goal: Array, turn: float, shares: Array) -> Array:
    """Return where the tool is in the part at shares of a line."""
    return np.array([table.in_part(start + s * (goal - start), {"C": s * turn}) for s in shares])


@pytest.mark.parametrize(("start", "goal", "turn"), LINES)
def test_chords_miss_a_line_by_no_more_than_allowed_and_are_few(
    start: tuple[float, ...], goal: tuple[float, ...], turn: float
) -> None:
    table = Rotary(TABLE, (("C", 1.0),), CENTER)
    first, last = CENTER + start, CENTER + goal
    count = table.chord_count(first, last, {"C": 0.0}, {"C": turn})
    assert count > 1

    def missed(chords: int) -> float:
        at = np.linspace(0.0, 1.0, chords + 1)
        middles = along(table, first, last, turn, 0.5 * (at[1:] + at[:-1]))
        corners = along(table, first, last, turn, at)
        return float(np.linalg.norm(middles - 0.5 * (corners[1:] + corners[:-1]), axis=1).max())

    assert missed(count) <= rotary._CHORD * (1.0 + 1e-6)
    # With half as many they would miss it.
    assert missed(max(1, count // 2)) > rotary._CHORD


def test_where_the_head_turns_a_line_is_one() -> None:
    assert Rotary(HEAD).chord_count(np.zeros(3), np.ones(3), {"C": 0.0}, {"C": 1.0}) == 1


@pytest.mark.parametrize(
    ("given", "axes"),
    [
        ("BC", (("B", 1.0), ("C", 1.0))),
        ("b, -c", (("B", 1.0), ("C", -1.0))),
        ("-A", (("A", -1.0),)),
        (["A", "-C"], (("A", 1.0), ("C", -1.0))),
    ],
)
def test_axes_are_given_as_letters_or_a_list(
    given: object, axes: tuple[tuple[str, float], ...]
) -> None:
    options = {"rotary": "table", "rotary_axes": given, "rotary_center": [0, 0, 0]}
    found = Rotary.of(options)
    assert found is not None
    assert found.axes == axes


@pytest.mark.parametrize("given", ["ABC", "BB", "X", "B-C", 3])
def test_axes_that_are_none_are_refused(given: object) -> None:
    with pytest.raises(ValueError, match="rotary_axes is"):
        Rotary.of({"rotary": "table", "rotary_axes": given, "rotary_center": [0, 0, 0]})

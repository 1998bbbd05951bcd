"""Every bad input of the table is refused in one sentence of ours, the one that the page shows."""

from pathlib import Path

import pytest

import selfmotion as sm
from support.bad_inputs import HEADER, PAGE, all_rows, line_of, page
from support.bad_rows import Row

ROWS = all_rows()


TEXT = PAGE.read_text("utf-8")
SHOWN = set(TEXT.splitlines())


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.area}: {row.given}")
def test_bad_inputs_are_refused_as_the_page_says(row: Row, tmp_path: Path) -> None:
    assert line_of(row, row.seen(tmp_path)) in SHOWN, "run make errors"


def test_the_page_has_these_rows_and_no_others() -> None:
    """In this order; what the lines say is tried row by row."""
    lines = [x for x in TEXT.splitlines() if x.startswith("| ") and x not in HEADER]
    told = [x.removesuffix(" |").split(" | ", 1)[1].replace("\\|", "|") for x in lines]
    shown = {row: line_of(row, seen) for row, seen in zip(ROWS, told, strict=True)}
    assert page(shown) == TEXT, "run make errors"


def test_each_row_is_there_once() -> None:
    given = [(row.area, row.given) for row in ROWS]
    assert len(set(given)) == len(given) >= 1600


def _raised(error: Exception) -> None:
    raise error


@pytest.mark.parametrize(
    ("call", "reason"),
    [
        (lambda _: 3, "nothing is raised"),
        (lambda _: {}["key"], "KeyError"),
        (lambda _: float("text"), "ValueError"),
        (lambda _: _raised(ValueError("of another package")), "of another package"),
    ],
)
def test_errors_that_are_not_ours_do_not_count(call, reason: str, tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match=reason):
        Row("", "it", call).seen(tmp_path)
    assert Row("", "it", lambda _: sm.load_robot("")).seen(tmp_path).startswith("RobotError: ")

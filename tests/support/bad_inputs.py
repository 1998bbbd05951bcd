"""The table of bad inputs: what users give, and what they see of it.

``make errors`` writes `docs/errors.md`; a test checks that it is current.
"""

import tempfile
from itertools import groupby
from pathlib import Path

from support.bad_additions import addition_rows
from support.bad_constraints import constraint_rows
from support.bad_problems import problem_rows, setting_rows
from support.bad_rows import Row
from support.bad_urdfs import loading_rows, rows
from support.bad_values import cost_rows, path_rows

PAGE = Path(__file__).parents[2] / "docs" / "errors.md"
HEADER = ("| given | seen |", "| --- | --- |")
_HEAD = """# What is refused, and how

Written by `make errors`, checked by the tests: {count} inputs that cannot be used,
each with the error that names it. All of them derive from `SelfmotionError`; only a time, an
order or a rate out of range is a `ValueError`. Indices in brackets are Python's, from 0; rows,
lines, pieces and elements of files are counted from 1.
"""


def all_rows() -> list[Row]:
    """Return the whole table, section by section."""
    found = [
        *rows(),
        *loading_rows(),
        *path_rows(),
        *problem_rows(),
        *cost_rows(),
        *constraint_rows(),
        *setting_rows(),
        *addition_rows(),
    ]
    areas = list(dict.fromkeys(row.area for row in found))
    return sorted(found, key=lambda row: areas.index(row.area))


def line_of(row: Row, seen: str) -> str:
    """Return the line of the page for a row."""
    given, told = (text.replace("|", "\\|").replace("<", "&lt;") for text in (row.given, seen))
    return f"| {given} | {told} |"


def page(lines: dict[Row, str]) -> str:
    """Return the page, given the lines of all rows."""
    parts = [_HEAD.format(count=len(lines))]
    for area, members in groupby(lines, key=lambda row: row.area):
        parts += [f"\n## {area}\n", *HEADER]
        parts += [lines[row] for row in members]
    return "\n".join(parts) + "\n"


def main() -> None:
    """Try every row, and write the page."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name).resolve()
        PAGE.write_text(page({row: line_of(row, row.seen(folder)) for row in all_rows()}))


if __name__ == "__main__":
    main()

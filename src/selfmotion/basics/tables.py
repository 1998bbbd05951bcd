"""Tables of numbers in files: columns with any separator."""

import csv
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from selfmotion.basics.arrays import Array
from selfmotion.basics.errors import FileFormatError
from selfmotion.basics.files import lines_of, text_of
from selfmotion.basics.inputs import number_in

# Marks of comment lines.
_COMMENTS = ("#", "%", "//")
_DECIMAL_COMMA = re.compile(r"[+-]?[0-9]*,[0-9]+([eE][+-]?[0-9]+)?")
# A cell in quotation marks, of which two stand for one within (RFC 4180) …
_QUOTED = re.compile(r'"(?:[^"]|"")*"')
# … and what only such a cell has within: separators of columns, marks, brackets of a unit.
_PROTECTED = set(",;\t\"'([")
# Largest number of characters of a line: files with more are of another kind.
_LONGEST = 100_000
# Name of a column that is left out.
LEFT_OUT = "-"


def read_table(file: Path) -> tuple[list[str], Array]:
    """Read a table of numbers with a header line: names and values of `read_rows`."""
    names, values, _, _ = read_rows(file)
    return names, values


def read_rows(
    file: Path,
    texts: Sequence[str] = (),
    check: Callable[[Sequence[str]], object] | None = None,
    *,
    columns: Sequence[str] | None = None,
    named: Callable[[str], str] = str,
    usual: Mapping[int, str] | None = None,
) -> tuple[list[str], Array, list[int], dict[str, list[str]]]:
    """Read a table of numbers with a header line, and return the line of each row.

    Columns are separated by comma, semicolon or tab, whichever the header has most of, or else by
    spaces. Lines that begin with #, % or // and empty ones are left out, a byte order mark is not
    seen; where the first row is of numbers, the comment before it may be the header. Decimal commas
    are read where no comma separates.

    Parameters
    ----------
    file : path
    texts : sequence of str
        Columns that hold texts.
    check : callable, optional
        Is called with the names of the columns of numbers before rows are read: it raises for one
        that has no meaning.
    columns : sequence of str, optional
        Names of the columns, in place of a header or without one; "-" leaves one out.
    named : callable
        Returns the meaning of a title.
    usual : dict, optional
        Number of columns → the header that such a table may be missing, for messages.

    Returns
    -------
    names : list of str
        Of the columns of numbers.
    values : (N, C)
    lines : list of int
    cells : dict
        The columns of `texts` that the table has, as they are.

    Raises
    ------
    FileFormatError
        The file cannot be read, has no header, no rows, a name twice, or a row that is short, long
        or not numeric; the line is named.
    """
    comments, remaining = _lines(file)
    titles, rows, line = _header(file, comments, remaining, columns, usual or {}, check, named)
    mark = _mark(remaining[0][1])
    if rows and len(_cells(rows[0][1], mark)) != len(titles):
        own = _mark(rows[0][1])
        mark = own if len(_cells(rows[0][1], own)) == len(titles) else mark
    names = [LEFT_OUT if title == LEFT_OUT else named(title) for title in titles]
    twice = sorted({name for name in names if name != LEFT_OUT and names.count(name) > 1})
    if twice:
        raise FileFormatError(f"{file}: line {line}: column '{twice[0]}' appears twice")
    plain = [k for k, name in enumerate(names) if name not in (*texts, LEFT_OUT)]
    if check is not None:
        check([names[k] for k in plain])
    cells_of: dict[str, list[str]] = {name: [] for name in names if name in texts}
    values, numbers = [], []
    for number, text in rows:
        cells = _cells(text, mark)
        if len(cells) == len(names) + 1 and not cells[-1]:
            cells.pop()
        if len(cells) != len(names):
            raise FileFormatError(
                f"{file}: line {number} has {len(cells)} values, expected {len(names)}"
                f"{_hint(cells, names, mark)}"
            )
        where = f"{file}: line {number}: "
        values.append([_number(cells[k], where + names[k], mark) for k in plain])
        numbers.append(number)
        for name, column in cells_of.items():
            column.append(cells[names.index(name)])
    found = np.array(values, dtype=np.float64).reshape(len(values), len(plain))
    return [names[k] for k in plain], found, numbers, cells_of


def _header(
    file: Path,
    comments: Sequence[tuple[int, str]],
    remaining: Sequence[tuple[int, str]],
    columns: Sequence[str] | None,
    usual: Mapping[int, str],
    check: Callable[[Sequence[str]], object] | None,
    named: Callable[[str], str],
) -> tuple[list[str], Sequence[tuple[int, str]], int]:
    """Return the titles of the columns, the lines of the rows, and on which line titles stand."""
    line, first = remaining[0]
    cells = _cells(first, _mark(first))
    is_row = all(_as_float(cell, _mark(first)) is not None for cell in cells)
    if columns is not None:
        return list(columns), remaining if is_row else remaining[1:], line
    if not is_row:
        titles = _titles(first)
        return titles, remaining[1:], line
    before = [each for each in comments if each[0] < line]
    if before and check is not None:
        titles = _titles(before[-1][1].lstrip("#%/ "))
        if len(titles) == len(cells):
            try:
                check([named(title) for title in titles])
            except FileFormatError:
                pass
            else:
                return titles, remaining, before[-1][0]
    known = usual.get(len(cells))
    add = (
        f"add {known} (or say --set path.columns={known})"
        if known
        else "add one that names its columns"
    )
    raise FileFormatError(f"{file}: line {line}: has no header, only numbers; {add}")


def _titles(line: str) -> list[str]:
    """Return the titles in a header; units in brackets belong to the word before them."""
    joined = line if _protects(line) else re.sub(r"\s+([\[(])", r"\1", line)
    titles = _cells(joined, _mark(joined))
    return titles[:-1] if titles[1:] and not titles[-1] else titles


def _mark(line: str) -> str:
    """Return the separator of a line's columns, "" for spaces."""
    for mark in (";", "\t", ""):
        # The commas of 0,4;-0,05;0,3 are decimal ones.
        cells = _cells(line, mark)
        if len(cells) > 1 and all(_as_float(cell, mark) is not None for cell in cells):
            return mark
    # Quotation marks protect separators.
    bare = _QUOTED.sub("", line)
    mark = max(",;\t", key=bare.count)
    return mark if mark in bare else ""


def _protects(line: str) -> bool:
    """Return whether quotation marks hold something that is no separator, though it looks so."""
    return any(_PROTECTED & set(cell[1:-1]) for cell in _QUOTED.findall(line))


def _cells(line: str, mark: str) -> list[str]:
    if mark and _protects(line):
        quoted = csv.reader([line], delimiter=mark, skipinitialspace=True)
        return [cell.strip() for cell in next(quoted)]
    cells = line.split(mark) if mark else line.split()
    return [cell.strip().strip("\"'").strip() for cell in cells]


def _hint(cells: Sequence[str], names: Sequence[str], mark: str) -> str:
    if mark == "," and len(cells) == 2 * len(names):
        return "; are these decimal commas? separate the columns by semicolons"
    return ""


def _lines(file: Path) -> tuple[list[tuple[int, str]], list[tuple[int, str]]]:
    """Return the comments of a table and its other lines, and which they are, no empty ones."""
    try:
        content = file.read_bytes()
    except OSError as error:
        raise FileFormatError(f"{file}: cannot be read: {error.strerror or error}") from error
    lines = lines_of(text_of(file, content))
    long = next((k for k, line in enumerate(lines, 1) if len(line) > _LONGEST), None)
    if long is not None:
        raise FileFormatError(
            f"{file}: line {long}: has {len(lines[long - 1])} characters, expected {_LONGEST} at "
            f"most"
        )
    all_lines = [(k, line.strip(" ")) for k, line in enumerate(lines, 1) if line.strip()]
    remaining = [each for each in all_lines if not each[1].startswith(_COMMENTS)]
    if not remaining:
        raise FileFormatError(f"{file}: is empty, expected a header line and rows of numbers")
    return [each for each in all_lines if each[1].startswith(_COMMENTS)], remaining


def _as_float(cell: str, mark: str) -> float | None:
    """Return the number in a cell, None where it is none."""
    is_comma = mark != "," and _DECIMAL_COMMA.fullmatch(cell)
    return number_in(cell.replace(",", ".") if is_comma else cell)


def _number(cell: str, where: str, mark: str) -> float:
    found = _as_float(cell, mark)
    if found is not None:
        return found
    said = f"is '{cell[:40]}'" if cell else "is empty"
    raise FileFormatError(f"{where}: {said}, expected a number")

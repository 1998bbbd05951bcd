"""Tables in files: columns of numbers with any separator, and nested ones with SI units."""

import csv
import json
import math
import re
import tomllib
from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from selfmotion.basics.arrays import TURN, Array, is_number, number_in
from selfmotion.basics.errors import FileFormatError, nearest
from selfmotion.basics.files import lines_of, text_of, write_text

# Marks of comment lines.
_COMMENTS = ("#", "%", "//")
_DECIMAL_COMMA = re.compile(r"[+-]?[0-9]*,[0-9]+([eE][+-]?[0-9]+)?")
# A title in quotation marks with a separator of columns in it, or such a mark itself.
_QUOTED = re.compile(r'"[^"]*[,;\t"(\[][^"]*"')
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
    joined = line if _QUOTED.search(line) else re.sub(r"\s+([\[(])", r"\1", line)
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


def _cells(line: str, mark: str) -> list[str]:
    if mark and _QUOTED.search(line):
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


# TOML, JSON and YAML files as nested tables, with SI units throughout.

# Keys with a number for each joint.
_RATES = ("deceleration", "limit", "offset")
PER_JOINT = (*_RATES, "lock", "lower", "posture", "q", "qd", "qdd", "start", "upper")
# Keys that may end in _deg or _mm: nothing else is an angle or a length, or a rate of one.
_BANDS = ("acceleration", "band", "center", "half", "speed", "target", "velocity")
# Values above a turn are in degrees.
_WITHIN_A_TURN = ("corner_angle", "rotation", "rotation_vector", "rpy", "turn_tolerance")
_TURNS = (*_WITHIN_A_TURN, "lead", "tilt", "margin", "turn_acceleration", "turn_rate", "within")
ANGLES = frozenset((*_BANDS, *_TURNS, *PER_JOINT))
_SIZES = ("length", "lift", "radius", "rise", "rotary_center", "size", "standoff", "tolerance")
_WAYS = ("amplitude", "by", "distance", "feed", "jump", "pitch", "position", "positions", "retreat")
LENGTHS = frozenset((*_BANDS, *_WAYS, *_SIZES))
# Former name of `clearance`.
FORMER_CLEARANCE = "collision"
# Largest depth of nested tables or lists; real files have less than ten.
_DEEPEST = 50
_SUFFIXES = {"_deg": (ANGLES, math.pi / 180.0), "_mm": (LENGTHS, 1e-3)}
# Tables of joints with angles.
_TABLES_OF_NUMBERS = tuple(f"{name}_deg" for name in PER_JOINT)
# Similarity at which an unknown key is taken for a known one.
_ALIKE = 0.8
# Rows of relaxations, of position …
_MOVED = ("x", "y", "z")
# … and of rotation.
_TURNED = ("rx", "ry", "rz")
# Tables whose numbers have no unit.
_UNITLESS = ("optimiser.",)
# Keys that are shares there, of a feed.
_SHARES = ("path.within",)
# A margin is a share …
_MARGIN = "margin"
# … but of limits of position an angle or a length.
_OF_POSITIONS = "JointPositionLimits"


def read_document(file: Path) -> dict[str, Any]:
    """Read a table from a .toml, .json, .yaml or .yml file, units as they are.

    Raises
    ------
    FileFormatError
        The file is missing, is not of the kind that its suffix says, or holds no table.
    """
    found = read_values(file)
    if not isinstance(found, dict):
        raise FileFormatError(f"{file}: holds a {type(found).__name__}, expected a table of keys")
    return found


def read_values(file: Path) -> Any:
    """Read a table, or a list; see `read_document`."""
    try:
        found = _parse(file, file.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise FileFormatError(f"{file}: cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{file}: is not UTF-8 text: {error}") from error
    level = [found]
    for _ in range(_DEEPEST):
        inner = [list(item.values()) if isinstance(item, dict) else item for item in level]
        level = [value for item in inner if isinstance(item, list) for value in item]
        level = [item for item in level if isinstance(item, dict | list)]
    if level:
        raise FileFormatError(f"{file}: more than {_DEEPEST} tables or lists lie in each other")
    return found


def _parse(file: Path, text: str) -> Any:
    match file.suffix:
        case ".toml":
            try:
                return tomllib.loads(text)
            except (ValueError, RecursionError) as error:
                raise FileFormatError(f"{file}: is not TOML: {error}") from error
        case ".json":
            try:
                return json.loads(text, object_pairs_hook=_without_twins)
            except (ValueError, RecursionError) as error:
                raise FileFormatError(f"{file}: is not JSON: {error}") from error
        case ".yaml" | ".yml":
            return _parse_yaml(file, text)
    raise FileFormatError(f"{file}: has suffix '{file.suffix}', expected .toml, .json or .yaml")


def _parse_yaml(file: Path, text: str) -> Any:
    import yaml

    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

    class Loader(loader):  # type: ignore[misc, valid-type]  # its base is known when it runs
        """Safe loader without duplicate keys and aliases."""

        def construct_mapping(self, node: Any, deep: bool = False) -> Any:
            keys = [self.construct_object(key) for key, _ in node.value]
            _without_twins([(key, None) for key in keys if isinstance(key, Hashable)])
            return super().construct_mapping(node, deep=deep)

    try:
        _check_events(file, yaml.parse(text, Loader=loader))
        # `ros2 topic echo` ends each message with a line of its own.
        return next(iter(yaml.load_all(text, Loader=Loader)), None)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise FileFormatError(f"{file}: is not YAML: {' '.join(str(error).split())}") from error


def _without_twins(pairs: list[tuple[Any, Any]]) -> dict[Any, Any]:
    """Return a table of its keys and values; ValueError if a key is there twice."""
    table: dict[Any, Any] = {}
    for key, value in pairs:
        if key in table:
            raise ValueError(f"key '{key}' is given twice; keep one")
        table[key] = value
    return table


def _check_events(file: Path, events: Iterable[Any]) -> None:
    """Refuse events of a small file that would exhaust memory, before anything is built."""
    import yaml

    depth = 0
    for event in events:
        mark: Any = event.start_mark
        if isinstance(event, yaml.AliasEvent):
            raise FileFormatError(
                f"{file}: line {mark.line + 1}: '*{event.anchor}' stands for something "
                f"else, expected it written out"
            )
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > _DEEPEST:
            raise FileFormatError(
                f"{file}: line {mark.line + 1}: more than {_DEEPEST} tables or lists "
                f"lie in each other"
            )


def write_document(file: Path, document: Mapping[str, Any]) -> None:
    """Write a table as .toml, .json or .yaml, whichever the suffix says; atomically."""
    match file.suffix:
        case ".toml":
            import tomli_w

            text = tomli_w.dumps(_without_null(document))
        case ".json":
            text = json.dumps(document, indent=1) + "\n"
        case ".yaml" | ".yml":
            import yaml

            dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
            text = yaml.dump(document, Dumper=dumper, sort_keys=False, default_flow_style=None)
        case _:
            raise FileFormatError(f"{file}: has suffix '{file.suffix}', expected .toml or .json")
    write_text(file, text)


def _without_null(value: Any) -> Any:
    """Return a value as TOML can hold it: without keys of JSON's null, which count as absent."""
    if isinstance(value, Mapping):
        return {key: _without_null(item) for key, item in value.items() if item is not None}
    return [_without_null(item) for item in value] if isinstance(value, list) else value


def in_si(table: Mapping[str, Any], where: str = "") -> dict[str, Any]:
    """Return a table with keys ``NAME_deg`` [°] and ``NAME_mm`` [mm] as ``NAME`` [rad], [m].

    JSON's null counts as a key that is not there.

    Raises
    ------
    FileFormatError
        A key with such an ending is no angle or length, is given twice, or holds no numbers; or an
        angle in radians is more than a turn.
    """
    found: dict[str, Any] = {}
    _check_rows(table, where)
    for key, value in table.items():
        if value is None:
            continue
        name, factor = key, None
        for suffix, (allowed, scale) in _SUFFIXES.items():
            if key.endswith(suffix):
                name, factor = key.removesuffix(suffix), scale
                _check_unit(name, suffix, where, allowed, table.get("kind"))
        if name in found:
            raise FileFormatError(f"{where}{key}: '{name}' is given twice, in two units; keep one")
        inner = _inner(value, f"{where}{name}")
        if factor is None:
            _check_radians(name, inner, where)
        found[name] = inner if factor is None else _scaled(inner, factor, f"{where}{key}")
    return found


def is_share(key: str, kind: object) -> bool:
    """Whether a key has no unit in a table of some kind, though it has one in others."""
    is_margin = key.rpartition(".")[2] == _MARGIN
    return key.endswith(_SHARES) or (is_margin and kind != _OF_POSITIONS)


def _check_unit(name: str, suffix: str, where: str, allowed: Collection[str], kind: object) -> None:
    """Refuse a key that is none, or has no such unit in a table of some kind."""
    share = is_share(f"{where}{name}", kind)
    if name in allowed and not where.startswith(_UNITLESS) and not share:
        return
    what = "angle" if suffix == "_deg" else "length"
    near = nearest(name + suffix, [each + suffix for each in allowed], _ALIKE)
    if near and name not in allowed:
        raise FileFormatError(f"{where}{name}{suffix}: unknown key{near}")
    known = "" if name in allowed else f", expected one of: {', '.join(sorted(allowed))}"
    known = ", it is a share here, without a unit" if share else known
    raise FileFormatError(f"{where}{name}{suffix}: '{name}' is no {what}{known}")


def _check_rows(table: Mapping[str, Any], where: str) -> None:
    """Refuse a band in mm of rows that turn, and one in degrees of rows that do not."""
    rows = table.get("rows")
    several = [rows] if isinstance(rows, str) else rows if isinstance(rows, list) else []
    for row in several:
        turns = row in _TURNED
        wrong, right = ("_mm", "_deg") if turns else ("_deg", "_mm")
        if f"band{wrong}" in table and (turns or row in _MOVED):
            what = "an angle" if turns else "a length"
            raise FileFormatError(f"{where}band{wrong}: row '{row}' is {what}; say band{right}")


def _check_radians(name: str, value: Any, where: str) -> None:
    """Refuse an angle in radians that can only be meant in degrees."""
    if name not in _WITHIN_A_TURN:
        return
    for item in value if isinstance(value, list) else [value]:
        if isinstance(item, int | float) and TURN < abs(item) < math.inf:
            raise FileFormatError(
                f"{where}{name}: {item:g} rad is more than a turn; in degrees say {name}_deg"
            )


def _inner(value: Any, where: str) -> Any:
    if isinstance(value, Mapping):
        return in_si(value, f"{where}.")
    if isinstance(value, list):
        return [_inner(item, f"{where}[{k}]") for k, item in enumerate(value)]
    return value


def _scaled(value: Any, factor: float, where: str) -> Any:
    if isinstance(value, list):
        return [_scaled(item, factor, where) for item in value]
    if isinstance(value, dict) and where.endswith(_TABLES_OF_NUMBERS):
        return {key: _scaled(item, factor, where) for key, item in value.items()}
    if not is_number(value):
        raise FileFormatError(f"{where}: is {value!r}, expected numbers")
    try:
        return value * factor
    except OverflowError:
        raise FileFormatError(f"{where}: is {value!r}, expected finite numbers") from None

"""Keys of a document set from outside: on the command line, and by a grid."""

import itertools
import json
from collections.abc import Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any

from selfmotion.basics import FileFormatError, nearest, read_document, write_document
from selfmotion.shell.documents.named_files import named_from


def set_key(document: dict[str, Any], key: str, value: Any) -> None:
    """Set ``path.duration`` or ``costs.0.weight`` of a document; tables on the way are made.

    Raises
    ------
    FileFormatError
        The way leads through something that is no table, or past the end of a list.
    """
    node: Any = document
    parts = key.split(".")
    last = parts[-1]
    for part, inner in itertools.pairwise(parts):
        if isinstance(node, dict) and part not in node and inner.isdigit():
            raise FileFormatError(
                f"{key}: sets one number of '{part}', which is not there{nearest(part, node)}; "
                f"give all of them in the file, like {part} = [0, 0, 0]"
            )
        node = node.setdefault(part, {}) if isinstance(node, dict) else _item(node, part, key)
    if isinstance(node, dict):
        # The same in another unit gives way.
        name = last.removesuffix("_deg").removesuffix("_mm")
        for other in (name, f"{name}_deg", f"{name}_mm"):
            node.pop(other, None)
        node[last] = value
    else:
        _item(node, last, key)
        node[int(last)] = value


def _item(node: Any, part: str, key: str) -> Any:
    if isinstance(node, list) and part.isdigit() and int(part) < len(node):
        return node[int(part)]
    what = f"a list of {len(node)}" if isinstance(node, list) else repr(node)
    raise FileFormatError(f"{key}: leads to '{part}' of {what}, which is not there")


def parse_setting(text: str) -> tuple[str, Any]:
    """Return key and value of ``KEY=VALUE``, the value as in JSON, or else a text."""
    key, mark, value = text.partition("=")
    if not (mark and key):
        raise FileFormatError(f"--set is '{text}', expected KEY=VALUE like path.duration=6")
    try:
        return key, json.loads(value)
    except ValueError:
        return key, value


def grid_documents(document: Mapping[str, Any]) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """Return each document of a ``[grid]`` with the values that are set in it.

    The grid is a table of keys and lists of values; all combinations are taken, the last key
    fastest.

    Raises
    ------
    FileFormatError
        A value of the grid is no list, or a key leads nowhere.
    """
    plain = {key: value for key, value in document.items() if key != "grid"}
    grid = document.get("grid", {})
    if not isinstance(grid, Mapping):
        raise FileFormatError(f"grid: is {grid!r}, expected a table of keys and lists of values")
    for key, values in grid.items():
        if not (isinstance(values, list) and values):
            raise FileFormatError(
                f"grid.{key}: is {values!r}, expected a list of values (a quoted key, such as "
                f"'path.duration' = [4, 6])"
            )
    found = []
    for values in itertools.product(*grid.values()):
        one, settings = deepcopy(plain), dict(zip(grid, values, strict=True))
        for key, value in settings.items():
            set_key(one, key, value)
        found.append((one, settings))
    return found


def write_combination(file: Path, settings: Mapping[str, Any], target: Path) -> None:
    """Write the problem file that one combination of a file's ``[grid]`` stands for.

    Files that it names beside itself are named from where the new one is.

    Raises
    ------
    FileFormatError
        The file cannot be read, or the new one not be written.
    """
    document = {key: value for key, value in read_document(file).items() if key != "grid"}
    for key, value in settings.items():
        set_key(document, key, value)
    write_document(target, named_from(document, file.resolve().parent, target.resolve().parent))

"""Documents changed from outside: keys on the command line and of a grid, a moved workpiece."""

import itertools
import json
import tomllib
from collections.abc import Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any

from selfmotion.basics import (
    FileFormatError,
    in_si,
    nearest,
    read_document,
    read_values,
    write_document,
)
from selfmotion.model.path import pose_of
from selfmotion.model.task import SE3
from selfmotion.problem.costs import JointVelocity
from selfmotion.problem.problem import KEPT
from selfmotion.shell.documents.named_files import named_from


def set_key(document: dict[str, Any], key: str, value: Any) -> None:
    """Set ``path.duration`` or ``costs.0.weight`` of a document; tables on the way are made.

    An item of a list is its number, or its kind or name: ``constraints.JointVelocityLimits.limit``
    adds that constraint where it is not there, ``constraints.ClosedPath`` is the whole of it, true
    or false. Without a list of costs or constraints, these are the usual ones.

    Raises
    ------
    FileFormatError
        The way leads through something that is no table, or past the end of a list.
    """
    node: Any = document
    parts = key.split(".")
    last = parts[-1]
    for part, inner in itertools.pairwise(parts):
        if isinstance(node, dict):
            if part not in node and node is document and part in _USUAL and not inner.isdigit():
                node[part] = deepcopy(_USUAL[part])
            if part not in node and inner.isdigit():
                raise FileFormatError(
                    f"{key}: sets one number of '{part}', which is not there{nearest(part, node)}; "
                    f"give all of them in the file, like {part} = [0, 0, 0]"
                )
            node = node.setdefault(part, {})
        else:
            node = _item(node, part, key, parts[0])
    if isinstance(node, dict):
        # The same in another unit gives way.
        name = last.removesuffix("_deg").removesuffix("_mm")
        for other in (name, f"{name}_deg", f"{name}_mm"):
            node.pop(other, None)
        node[last] = value
    elif isinstance(node, list) and parts[0] in _USUAL and not last.isdigit():
        _set_whole(node, last, value, key)
    else:
        _item(node, last, key, parts[0])
        node[int(last)] = value


# Lists of kinds, and what they are where a document has none.
_USUAL: Mapping[str, list[dict[str, Any]]] = {
    "costs": [{"kind": JointVelocity.kind}],
    "constraints": [{"kind": item.kind} for item in KEPT],
}


def _item(node: Any, part: str, key: str, section: str) -> Any:
    """Return an item of a list by its number, kind or name; of kinds, a new one."""
    if isinstance(node, list):
        if part.isdigit() and int(part) < len(node):
            return node[int(part)]
        tables = [item for item in node if isinstance(item, dict)]
        found = [item for item in tables if part in (item.get("kind"), item.get("name"))]
        if len(found) == 1:
            return found[0]
        if not found and section in _USUAL and not part.isdigit():
            node.append({"kind": part})
            return node[-1]
    what = f"a list of {len(node)}" if isinstance(node, list) else repr(node)
    raise FileFormatError(f"{key}: leads to '{part}' of {what}, which is not there")


def _set_whole(items: list[Any], kind: str, value: Any, key: str) -> None:
    """Set, add or take away an item of a list of kinds."""
    if not isinstance(value, dict | bool):
        raise FileFormatError(f"{key}: is {value!r}, expected a table of keys, true or false")
    items[:] = [item for item in items if not (isinstance(item, dict) and item["kind"] == kind)]
    if value is not False:
        items.append({"kind": kind, **(value if isinstance(value, dict) else {})})


def parse_setting(text: str, folder: Path = Path()) -> tuple[str, Any]:
    """Return key and value of ``KEY=VALUE``: as in JSON, as in TOML, or else a text.

    Of ``KEY=@FILE`` the value is what a file says, or says of a key that is called so; files that
    it names are looked for beside it, and named from a folder.
    """
    key, mark, value = text.partition("=")
    if not (mark and key):
        raise FileFormatError(f"--set is '{text}', expected KEY=VALUE like path.duration=6")
    name = key.rpartition(".")[2]
    if value.startswith("@"):
        file = Path(value[1:])
        found = read_values(file)
        found = found[name] if isinstance(found, dict) and name in found else found
        return key, named_from(found, file.resolve().parent, folder.resolve(), name)
    for read in (json.loads, _toml):
        try:
            return key, read(value)
        except ValueError:
            continue
    return key, value


def _toml(text: str) -> Any:
    found = tomllib.loads(f"value = {text}")
    if len(found) > 1:
        raise ValueError(text)
    return found["value"]


def keys_of(schema: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the keys of a schema as ``--set`` takes them: ``path.feed``, ``costs.PathLength.mu``.

    Of lists of kinds each kind has its keys.
    """
    found: dict[str, None] = {}

    def add(node: Mapping[str, Any], key: str, seen: tuple[str, ...]) -> None:
        reference = node.get("$ref")
        if reference is not None:
            if reference not in seen:
                add(schema["$defs"][reference.rpartition("/")[2]], key, (*seen, reference))
            return
        for inner in (*node.get("anyOf", ()), *node.get("oneOf", ())):
            add(inner, key, seen)
        if "items" in node and key in _USUAL:
            for kind, place in node["items"].get("discriminator", {}).get("mapping", {}).items():
                add({"$ref": place}, f"{key}.{kind}", seen)
        for name, value in node.get("properties", {}).items():
            if not (name == "kind" and "const" in value and key.startswith(tuple(_USUAL))):
                place = f"{key}.{name}" if key else name
                found[place] = None
                add(value, place, seen)

    add(schema, "", ())
    return tuple(found)


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


def belonging(document: Mapping[str, Any]) -> tuple[str, ...] | None:
    """Return the names of bodies that belong to the workpiece of a document; None without one."""
    piece = document.get("workpiece")
    if not isinstance(piece, Mapping):
        return None
    names = [str(item.get("name")) for item in piece.get("obstacles", [])]
    return (*names, *(["workpiece"] if "mesh" in piece else []))


def moved_workpiece(document: Mapping[str, Any], by: SE3) -> dict[str, Any]:
    """Return a document whose workpiece is moved, with all that is in its frame.

    By a rigid motion in the frame in which the workpiece stands. One without a workpiece gets one,
    in which its paths are.
    """
    piece = document.get("workpiece", {})
    frame = piece.get("frame", {})
    place = by * pose_of(in_si(frame) if isinstance(frame, Mapping) else frame)
    stands = {"position": place.translation.tolist(), "rotation": place.rotation.tolist()}
    return {**document, "workpiece": {**piece, "frame": stands}}

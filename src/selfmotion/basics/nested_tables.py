"""TOML, JSON and YAML files as nested tables, with SI units."""

import json
import math
import re
import tomllib
from collections.abc import Collection, Hashable, Iterable, Mapping
from pathlib import Path
from typing import Any

from selfmotion.basics.errors import FileFormatError, nearest
from selfmotion.basics.files import DOCUMENT_SUFFIXES, lines_of, write_text
from selfmotion.basics.inputs import TURN, is_number

# Keys of poses, tolerances and loads that may end in _deg or _mm.
_ANGLES = frozenset(("rotation", "rotation_vector", "rpy"))
_LENGTHS = frozenset(("center", "position"))
# Values above a turn are in degrees.
_WITHIN_A_TURN = _ANGLES
# Former name of `clearance`.
FORMER_CLEARANCE = "collision"
# Largest depth of nested tables or lists; real files have less than ten.
_DEEPEST = 50
_SUFFIXES = {"_deg": (_ANGLES, math.pi / 180.0), "_mm": (_LENGTHS, 1e-3)}
# Numbers that YAML 1.1 reads in other bases, 010 as 8 and 1:30 as 90, or with underscores.
_UNLIKE_DECIMALS = re.compile(r"[+-]?0[0-9b_]+|.*[:_].*")
# Similarity at which an unknown key is taken for a known one.
_ALIKE = 0.8


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
        content = file.read_bytes()
    except OSError as error:
        raise FileFormatError(f"{file}: cannot be read: {error.strerror or error}") from error
    if file.suffix not in DOCUMENT_SUFFIXES:
        raise FileFormatError(f"{file}: has suffix '{file.suffix}', expected .toml, .json or .yaml")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{file}: is not UTF-8 text: {error}") from error
    # TOML has no lines that end in a carriage return alone.
    found = _parse(file, "\n".join(lines_of(text)))
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
    return _parse_yaml(file, text)


def _parse_yaml(file: Path, text: str) -> Any:
    import yaml

    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

    class Loader(loader):  # type: ignore[misc, valid-type]  # its base is known when it runs
        """Safe loader without duplicate keys and aliases."""

        def construct_mapping(self, node: Any, deep: bool = False) -> Any:
            keys = [self.construct_object(key) for key, _ in node.value]
            _without_twins([(key, None) for key in keys if isinstance(key, Hashable)])
            return super().construct_mapping(node, deep=deep)

        def construct_plain(self, node: Any) -> Any:
            """Return a number; ValueError for one that YAML 1.1 reads otherwise than it looks."""
            if _UNLIKE_DECIMALS.fullmatch(node.value):
                raise ValueError(
                    f"'{node.value}' is {loader.yaml_constructors[node.tag](self, node)} in YAML "
                    f"1.1, and another number elsewhere; write it in decimal digits"
                )
            return loader.yaml_constructors[node.tag](self, node)

    for tag in ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float"):
        Loader.add_constructor(tag, Loader.construct_plain)
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
    for key, value in table.items():
        if value is None:
            continue
        name, factor = key, None
        for suffix, (allowed, scale) in _SUFFIXES.items():
            if key.endswith(suffix):
                name, factor = key.removesuffix(suffix), scale
                _check_unit(name, suffix, where, allowed)
        if name in found:
            raise FileFormatError(f"{where}{key}: '{name}' is given twice, in two units; keep one")
        inner = _inner(value, f"{where}{name}")
        if factor is None:
            _check_radians(name, inner, where)
        try:
            found[name] = inner if factor is None else scaled(inner, factor)
        except ValueError as error:
            raise FileFormatError(f"{where}{key}: {error}") from error
    return found


def _check_unit(name: str, suffix: str, where: str, allowed: Collection[str]) -> None:
    """Refuse a key that is none, or has no such unit."""
    if name in allowed:
        return
    what = "angle" if suffix == "_deg" else "length"
    near = nearest(name + suffix, [each + suffix for each in allowed], _ALIKE)
    if near:
        raise FileFormatError(f"{where}{name}{suffix}: unknown key{near}")
    known = ", ".join(sorted(allowed))
    raise FileFormatError(f"{where}{name}{suffix}: '{name}' is no {what}, expected one of: {known}")


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


def scaled(value: Any, factor: float) -> Any:
    """Return a number, or those of lists or of a table of numbers, times a factor.

    Raises
    ------
    ValueError
        It is something else; the message says what.
    """
    if isinstance(value, Mapping):
        return {key: scaled(item, factor) for key, item in value.items()}
    if isinstance(value, list):
        tables = [item for item in value if isinstance(item, Mapping)]
        if tables:
            raise ValueError(f"is {value!r}, expected numbers")
        return [scaled(item, factor) for item in value]
    if not is_number(value):
        raise ValueError(f"is {value!r}, expected numbers")
    try:
        return value * factor
    except OverflowError:
        raise ValueError(f"is {value!r}, expected finite numbers") from None

"""Whether a document is a problem file: its keys and types, by pydantic."""

import re
from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any

from pydantic import BaseModel, ValidationError

from selfmotion.basics import ANGLES, FORMER_CLEARANCE, LENGTHS, FileFormatError, nearest
from selfmotion.shell.documents.models import clearance_model, document_model, path_model

_UNITS = {"_deg": ANGLES, "_mm": LENGTHS}
# Faults of a file that are told at once.
_TOLD = 3
_SECTIONS = ("path", "null_motion")


def checked(
    document: Mapping[str, Any], written: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return the keys that a document in SI units gives, poses as SE3.

    Keys are told as `written` has them, with their units.

    Raises
    ------
    FileFormatError
        A key is unknown, missing or has a value of the wrong kind; it is named.
    """
    raw = dict(document)
    if FORMER_CLEARANCE in raw:
        if "clearance" in raw:
            raise FileFormatError(
                f"{FORMER_CLEARANCE}: is the former name of clearance; give one of them"
            )
        raw["clearance"] = raw.pop(FORMER_CLEARANCE)
    switched: dict[str, Any] = {}
    for name in ("clearance", "damping"):
        if isinstance(raw.get(name), bool):
            on = raw.pop(name)
            # Without damping there is none by default; self-collision is looked at.
            if on == (name == "damping"):
                switched[name] = {} if on else None
    several = raw.pop("clearance") if isinstance(raw.get("clearance"), list) else None
    if several == []:
        raise FileFormatError(
            "clearance: is an empty list, expected one or more tables; give false for none"
        )
    try:
        found = document_model().model_validate(raw)
    except ValidationError as error:
        raise FileFormatError(_message(error, raw, written)) from error
    table = {**_given(found), **switched}
    if several is not None:
        each = enumerate(several)
        table["clearance"] = [_checked_clearance(item, f"clearance[{k}]") for k, item in each]
    table["path"] = _inner(table["path"], "path")
    for k, item in enumerate(table.get("also", [])):
        if "path" in item:
            item["path"] = _inner(item["path"], f"also[{k}].path")
    return table


def _inner(path: dict[str, Any], where: str) -> dict[str, Any]:
    """Return the table of a tool motion, those that it is made of checked like itself."""
    found = dict(path)
    if isinstance(found.get("path"), dict):
        found["path"] = _checked_path(found["path"], f"{where}.path")
    if "pieces" in found:
        pieces = enumerate(found["pieces"])
        found["pieces"] = [_checked_path(item, f"{where}.pieces[{k}]") for k, item in pieces]
    return found


def _checked_path(given: Any, where: str) -> dict[str, Any]:
    document = {"path": given}
    try:
        model = path_model().model_validate(document)
    except ValidationError as error:
        said = _message(error, document).removeprefix("path").removeprefix(": ")
        mark = ": " if not said.startswith(".") else ""
        raise FileFormatError(f"{where}{mark}{said}") from error
    return _inner(_given(model)["path"], where)


def _checked_clearance(given: Any, where: str) -> Any:
    document = {"clearance": given}
    try:
        model = clearance_model().model_validate(document)
    except ValidationError as error:
        # Of several faults each is named.
        said = re.sub(r"(?m)(^|; )clearance\b", rf"\g<1>{where}", _message(error, document))
        raise FileFormatError(said) from error
    return _given(model)["clearance"]


def _given(value: Any) -> Any:
    """Return models as dictionaries of the keys that were given; values stay as they are."""
    if isinstance(value, BaseModel):
        return {name: _given(getattr(value, name)) for name in value.model_fields_set}
    if isinstance(value, list):
        return [_given(item) for item in value]
    if isinstance(value, dict):
        return {key: _given(item) for key, item in value.items()}
    return value


def _message(
    error: ValidationError, document: Mapping[str, Any], written: Mapping[str, Any] | None = None
) -> str:
    # A key that is misspelt is also missing: what was written says more.
    found = sorted(error.errors(include_url=False), key=lambda item: item["type"] == "missing")
    told = dict.fromkeys(
        f"{_place(item['loc'])}{unit}: {_what(item, document, unit)}"
        for item, unit in ((item, _unit(item["loc"], written)) for item in found)
    )
    rest = f"; and {len(told) - _TOLD} more" if len(told) > _TOLD else ""
    return "; ".join(list(told)[:_TOLD]) + rest


def _place(location: tuple[int | str, ...]) -> str:
    """Return ``costs[1].weight`` for the way to a value, without the kinds on it."""
    text = ""
    for k, part in enumerate(location):
        before = location[k - 1] if k else ""
        if isinstance(part, int):
            text += f"[{part}]"
        elif not (k and (isinstance(before, int) or (k == 1 and before in _SECTIONS))):
            text += f".{part}" if text else part
        elif _is_plain_list(location, k):
            text += f".{part}"
    return text


def _is_plain_list(location: tuple[int | str, ...], k: int) -> bool:
    """Whether what stands at k is a key of a list's item, rather than its kind."""
    return k == 2 and location[0] in ("relaxations", "also")


def _unit(location: tuple[int | str, ...], written: Any) -> str:
    """Return the ending of a key that has a unit in what was written; else empty."""
    inner = written
    for part in location[:-1]:
        listed = isinstance(inner, list) and isinstance(part, int) and part < len(inner)
        # Others are kinds of what is in the table.
        if listed or (isinstance(inner, Mapping) and part in inner):
            inner = inner[part]
    key = location[-1]
    if not isinstance(inner, Mapping) or key in inner:
        return ""
    return next((suffix for suffix in _UNITS if f"{key}{suffix}" in inner), "")


def _what(error: Any, document: Mapping[str, Any], unit: str = "") -> str:
    context = error.get("ctx", {})
    match error["type"]:
        case "value_error":
            return str(context["error"])
        case "missing":
            return "is missing"
        case "extra_forbidden":
            return "unknown key" + _near(error, unit)
        case "union_tag_not_found":
            tag = context["discriminator"].strip("'")
            return f"has no key '{tag}', which says what it is"
        case "union_tag_invalid":
            tag = context["discriminator"].strip("'")
            kinds = re.findall(r"'([^']*)'", context["expected_tags"])
            near = nearest(context["tag"], kinds)
            return f"{tag} is '{context['tag']}', expected one of: {context['expected_tags']}{near}"
        case "model_type" | "dict_type" | "model_attributes_type":
            return f"is {error['input']!r}, expected a table of keys"
        case "list_type":
            return f"is {error['input']!r}, expected a list of tables ([[…]])"
        case "literal_error":
            return f"is {error['input']!r}, expected {context['expected']}"
    return str(error["msg"])


def _near(error: Any, unit: str = "") -> str:
    schema = document_model().model_json_schema()
    known = _known_keys(error["loc"], schema)
    units = [name + suffix for suffix, names in _UNITS.items() for name in known if name in names]
    key = str(error["loc"][-1])
    near = get_close_matches(key, [*known, *units], 1)
    if unit:
        # What has the same unit is what is meant.
        likely = [name for name in known if name in _UNITS[unit]]
        near = [f"{name}{unit}" for name in get_close_matches(key, likely, 1)] or near
    if not near and len(error["loc"]) == 1:
        # One of a table, at the top of the file.
        tables = [f"[{name}]" for name in known if key in _known_keys((name, key), schema)]
        if tables:
            return f"; it belongs to {' or '.join(tables)}"
    return f", did you mean '{near[0]}'?" if near else f", expected one of: {', '.join(known)}"


def _known_keys(location: tuple[int | str, ...], schema: Mapping[str, Any]) -> list[str]:
    """Return the keys of the table in which something stands."""
    node: Any = schema
    definitions = node["$defs"]
    for part in location[:-1]:
        node = _resolved(node, definitions)
        if isinstance(part, int):
            node = node.get("items", node)
        elif part in node.get("properties", {}):
            node = node["properties"][part]
        elif part in node.get("discriminator", {}).get("mapping", {}):
            node = {"$ref": node["discriminator"]["mapping"][part]}
        elif isinstance(node.get("additionalProperties"), dict):
            node = node["additionalProperties"]
    return list(_resolved(node, definitions).get("properties", {}))


def _resolved(node: Any, definitions: Mapping[str, Any]) -> Any:
    while "$ref" in node:
        node = definitions[node["$ref"].rpartition("/")[2]]
    return node

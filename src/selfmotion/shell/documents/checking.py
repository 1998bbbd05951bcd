"""Whether a document is what its model says, and what is said where it is not."""

import re
from collections.abc import Mapping
from functools import cache
from typing import Any, TypeVar

from pydantic import ValidationError

from selfmotion.basics import FORMER_CLEARANCE, FileFormatError, nearest
from selfmotion.shell.documents.one_of import all_tables, unknown_key
from selfmotion.shell.documents.tables import Table, checks

_Model = TypeVar("_Model", bound=Table)
# Faults of a file that are reported at once.
_TOLD = 3
# What has an ending of a key as its unit.
_MEASURES = {"deg": "angle", "mm": "length"}


def checked(model: type[_Model], document: Mapping[str, Any]) -> _Model:
    """Return the table of a document.

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
    if raw.get("clearance") == []:
        raise FileFormatError(
            "clearance: is an empty list, expected one or more tables; give false for none"
        )
    try:
        return model.model_validate(raw)
    except ValidationError as error:
        raise FileFormatError(_message(error, model, raw)) from error


def _message(error: ValidationError, model: type[Table], raw: Mapping[str, Any]) -> str:
    # A key that is misspelt is also missing: what was written says more.
    found = sorted(error.errors(include_url=False), key=lambda item: item["type"] == "missing")
    told = dict.fromkeys(
        f"{_place(item['loc'], raw)}{unit}: {_what(item, model, raw)}"
        for item, unit in ((item, _unit(item["loc"], raw)) for item in found)
    )
    rest = f"; and {len(told) - _TOLD} more" if len(told) > _TOLD else ""
    return "; ".join(list(told)[:_TOLD]) + rest


def _place(location: tuple[int | str, ...], raw: Mapping[str, Any]) -> str:
    """Return ``costs[1].weight`` for the way to a value; a seam has its name."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location)
    match location:
        case ["seams", int() as number, *_]:
            seam = raw["seams"][number]
            name = seam.get("name") if isinstance(seam, Mapping) else None
            if isinstance(name, str):
                rest = text.removeprefix(f".seams[{number}]").removeprefix(".")
                return f"seams, '{name}': {rest}".removesuffix(": ")
    return text.removeprefix(".")


def _unit(location: tuple[int | str, ...], written: Any) -> str:
    """Return the ending of a key that has a unit in what was written; else empty."""
    inner = written
    for part in location[:-1]:
        is_listed = isinstance(inner, list) and isinstance(part, int) and part < len(inner)
        if not (is_listed or (isinstance(inner, Mapping) and part in inner)):
            return ""
        inner = inner[part]
    key = location[-1] if location else ""
    if not isinstance(inner, Mapping) or key in inner:
        return ""
    return next((ending for ending in ("_deg", "_mm") if f"{key}{ending}" in inner), "")


def _what(error: Any, model: type[Table], raw: Mapping[str, Any]) -> str:
    context = error.get("ctx", {})
    match error["type"]:
        case "value_error":
            return str(context["error"])
        case "missing":
            return "is missing"
        case "extra_forbidden":
            return _near(error["loc"], model, raw)
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


def _near(location: tuple[int | str, ...], model: type[Table], raw: Mapping[str, Any]) -> str:
    """Return what to say of an unknown key: the nearest one, or the tables that have it."""
    schema, name = model.model_json_schema(), str(location[-1])
    known = _keys_at(location, schema, raw)
    stem, _, unit = name.rpartition("_")
    if stem in known and unit in _MEASURES:
        told = known[stem].get("description", "a table, whose keys have units of their own")
        return f"'{stem}' is no {_MEASURES[unit]}: {told}"
    said = unknown_key(name, list(known))
    if len(location) == 1 and "did you mean" not in said:
        # One of a table, at the top of the file.
        tables = [f"[{top}]" for top in known if name in _keys_at((top, name), schema, {})]
        if tables:
            return f"unknown key; it belongs to {' or '.join(tables)}"
    return said


def _keys_at(
    location: tuple[int | str, ...], schema: Mapping[str, Any], raw: Mapping[str, Any]
) -> Mapping[str, Any]:
    """Return the keys of the table in which something of a document stands, with schemas."""
    node: Any = schema
    value: Any = raw
    for part in location[:-1]:
        if isinstance(part, int):
            node, value = node["items"], value[part]
        else:
            node = node.get("properties", {}).get(part) or node.get("additionalProperties") or {}
            value = value.get(part) if isinstance(value, Mapping) else None
        node = _chosen(node, value, schema["$defs"])
    found: dict[str, Any] = node.get("properties", {})
    return found


def _chosen(node: Any, value: Any, known: Mapping[str, Any]) -> Any:
    """Return the schema of a value where there are several for its key."""
    while True:
        if "$ref" in node:
            node = known[node["$ref"].rpartition("/")[2]]
        elif "discriminator" in node:
            tag, mapping = (node["discriminator"][name] for name in ("propertyName", "mapping"))
            kind = value.get(tag) if isinstance(value, Mapping) else None
            node = {"$ref": mapping[kind]} if kind in mapping else {}
        elif "anyOf" in node:
            form = "items" if isinstance(value, list) else "$ref"
            node = next((item for item in node["anyOf"] if form in item), {})
        else:
            return node


def key_of_joint_degrees(document: Any, where: str = "") -> str:
    """Return the first key that gives degrees joint by joint, "" for none."""
    items: Any = ()
    if isinstance(document, Mapping):
        items = document.items()
    elif isinstance(document, list):
        items = enumerate(document)
    for key, value in items:
        # Where a joint slides, degrees make no sense.
        if isinstance(value, list) and key in _joint_degrees():
            return f"{where}{key}"
        inner = key_of_joint_degrees(value, f"{where}{key}.")
        if inner:
            return inner
    return ""


@cache
def _joint_degrees() -> set[str]:
    """Return the keys in degrees of all tables that have a number for each joint."""
    fields = (item for table in all_tables() for item in table.model_fields.items())
    return {f"{name}_deg" for name, info in fields if getattr(checks(info), "per_joint", False)}

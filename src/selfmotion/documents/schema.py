"""The JSON Schema of problem and job files, for editors."""

import math
import re
from collections.abc import Mapping
from typing import Any

from selfmotion.basics import ANGLES, LENGTHS, is_share
from selfmotion.documents.key_notes import notes_of
from selfmotion.documents.models import document_model
from selfmotion.documents.seam_job import HIGHEST, JOB, OF_PROBLEM, OF_TABLE, SEAM
from selfmotion.optimise import QuasiNewton

_MOTION = "ToolMotion"
# Paths that are made of others, and the key of these.
_INNER = ("path", "pieces")
_TEXT, _NUMBER, _FLAG = {"type": "string"}, {"type": "number"}, {"type": "boolean"}
_NAMES = {"type": "array", "items": _TEXT}
# What a seam says besides its problem, and a job besides its seams.
_OF_SEAM: Mapping[str, Any] = {
    "name": _TEXT,
    "either_way": _FLAG,
    "wait": _NUMBER,
    **dict.fromkeys(("after", "after_any", "may_meet"), _NAMES),
    "events": {"type": "array", "items": {"type": "array", "minItems": 2, "maxItems": 2}},
}
_OF_JOB: Mapping[str, Any] = {
    "order": {"enum": ["free", "given"]},
    **{name: {"type": "integer"} for name in ("branches", "rng")},
    **dict.fromkeys(("seconds_per_cost", "deadline"), _NUMBER),
}


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of problem files and job files.

    Keys may be given with ``_deg`` and ``_mm`` wherever that is read. A file has either a path or
    seams.
    """
    schema = document_model().model_json_schema()
    known, keys = schema["$defs"], schema["properties"]
    known[_MOTION] = keys["path"]
    _made_of_others(known)
    keys |= {"path": _of(_MOTION), "seams": _seams(schema), "job": _job(schema)}
    for name in ("clearance", "damping"):
        keys[name] = {"anyOf": [_FLAG, keys[name]]}
    schema["required"] = [name for name in schema["required"] if name != "path"]
    _note(schema)
    schema |= {
        "oneOf": [{"required": ["path"]}, {"required": ["seams"]}],
        "dependentRequired": {"job": ["seams"]},
    }
    found: dict[str, Any] = _with_units(schema)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **found}


def _of(definition: str) -> dict[str, Any]:
    return {"$ref": f"#/$defs/{definition}"}


def _made_of_others(known: Mapping[str, Any]) -> None:
    """Say of paths that are made of others that these are paths."""
    motion = known[_MOTION]
    for reference in motion["discriminator"]["mapping"].values():
        keys = known[reference.rpartition("/")[2]]["properties"]
        for name in _INNER:
            if name in keys:
                several = name == "pieces"
                keys[name] = {"type": "array", "items": _of(_MOTION)} if several else _of(_MOTION)


def _seams(schema: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a list of seams, or one table of all of them, may say."""
    known, keys = schema["$defs"], schema["properties"]
    leaves = {"type": "array", "items": known["Workpiece"]["properties"]["obstacles"]["items"]}
    of_all = {
        **{name: value for name, value in _OF_SEAM.items() if name in SEAM},
        **{name: keys[name] for name in OF_PROBLEM},
        "leaves": leaves,
    }
    file = known["file"]["properties"]
    table = {
        **{name: value for name, value in of_all.items() if name not in ("name", "path")},
        **{name: file[name] for name in OF_TABLE if name in file},
        "run_up": _FLAG,
        "most_feed": _NUMBER,
    }
    table["feed"] = {"anyOf": [file["feed"], {"const": HIGHEST}]}
    one = {**of_all, "path": _of(_MOTION)}
    entry = _table("Seam", one, ["name", "path"])
    return {
        "anyOf": [{"type": "array", "items": entry, "minItems": 1}, _table("Seam", table, ["file"])]
    }


def _job(schema: Mapping[str, Any]) -> dict[str, Any]:
    start = schema["properties"]["start"]
    return _table("Job", {name: _OF_JOB.get(name, start) for name in JOB}, [])


def _table(title: str, keys: Mapping[str, Any], required: list[str]) -> dict[str, Any]:
    return {
        "title": title,
        "type": "object",
        "properties": {key: dict(value) for key, value in keys.items()},
        "required": required,
        "additionalProperties": False,
    }


def _note(node: Any) -> None:
    """Say of each key of all tables in a schema what it means, where editors show it."""
    if isinstance(node, list):
        for item in node:
            _note(item)
    if not isinstance(node, dict):
        return
    for item in node.values():
        _note(item)
    if "title" in node and isinstance(node.get("properties"), dict):
        notes = notes_of(node["title"])
        for key, value in node["properties"].items():
            if key in notes:
                value["description"] = notes[key]


def _with_units(node: Any) -> Any:
    """Return a schema in which angles may be in degrees, and lengths in mm."""
    if isinstance(node, list):
        return [_with_units(item) for item in node]
    if not isinstance(node, dict):
        return node
    found = {name: _with_units(value) for name, value in node.items()}
    # JSON has no infinity.
    if isinstance(found.get("default"), float) and math.isinf(found["default"]):
        del found["default"]
    keys = found.get("properties")
    # A schema's own word, unless it is a key that is called so.
    if not isinstance(keys, dict) or "type" not in found:
        return found
    if found.get("title") == QuasiNewton.__name__:
        return found
    for suffix, names, scale, units in (
        ("_deg", ANGLES, 180.0 / math.pi, ("rad", "°")),
        ("_mm", LENGTHS, 1e3, ("m", "mm")),
    ):
        for name in sorted(names & set(keys)):
            # A table, whose own keys have units; or a number that has none here.
            if _is_table(keys[name]) or is_share(name, keys.get("kind", {}).get("const")):
                continue
            keys[name + suffix] = _scaled(keys[name], scale, units)
            if name in found.get("required", []):
                found["required"].remove(name)
    return found


def _is_table(node: Mapping[str, Any]) -> bool:
    return "$ref" in node or any(item.get("type") == "object" for item in node.get("anyOf", ()))


def _scaled(node: Mapping[str, Any], scale: float, units: tuple[str, str]) -> dict[str, Any]:
    """Return the schema of a value in another unit, with its default and description in that."""
    found = dict(node)
    if "description" in found:
        old, new = units
        found["description"] = re.sub(
            r"\[[^\[\]]*\]",
            lambda unit: re.sub(rf"(?<!\w){old}(?!\w)", new, unit[0]),
            found["description"],
        )
    default = found.get("default")
    if isinstance(default, int | float) and not isinstance(default, bool):
        found["default"] = float(f"{default * scale:.12g}")
    elif default is not None:
        del found["default"]
    return found

"""JSON Schema of problem and job files: keys, types, units and descriptions, for editors."""

import math
import re
from collections.abc import Mapping
from typing import Any

from selfmotion.basics import ANGLES, LENGTHS, is_share
from selfmotion.planning.optimise import QuasiNewton
from selfmotion.shell.documents.key_notes import key_notes
from selfmotion.shell.documents.models import document_model
from selfmotion.shell.documents.seam_job import HIGHEST, JOB, OF_PROBLEM, OF_TABLE, SEAM

# Name of the definition of tool motions.
_TOOL_MOTION = "ToolMotion"
# Keys of paths that hold other paths.
_NESTED_PATH_KEYS = ("path", "pieces")
# JSON Schema of a string.
_STRING = {"type": "string"}
# JSON Schema of a number.
_NUMBER = {"type": "number"}
# JSON Schema of a boolean.
_BOOLEAN = {"type": "boolean"}
# JSON Schema of a list of strings.
_STRINGS = {"type": "array", "items": _STRING}
# Schema of the keys of a seam that no class has.
_SEAM_KEYS: Mapping[str, Any] = {
    "name": _STRING,
    "either_way": _BOOLEAN,
    "wait": _NUMBER,
    **dict.fromkeys(("after", "after_any", "may_meet"), _STRINGS),
    "events": {"type": "array", "items": {"type": "array", "minItems": 2, "maxItems": 2}},
}
# Schema of the keys of a job that no class has.
_JOB_KEYS: Mapping[str, Any] = {
    "order": {"enum": ["free", "given"]},
    **{name: {"type": "integer"} for name in ("branches", "rng")},
    **dict.fromkeys(("seconds_per_cost", "move_seconds"), _NUMBER),
}


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of problem files and job files.

    Angles may be given with the suffix ``_deg``, lengths with ``_mm``. A file has either ``path``
    or ``seams``.
    """
    schema = document_model().model_json_schema()
    definitions, keys = schema["$defs"], schema["properties"]
    definitions[_TOOL_MOTION] = keys["path"]
    _set_nested_paths(definitions)
    keys |= {
        "path": _reference(_TOOL_MOTION),
        "seams": _seams_schema(schema),
        "job": _job_schema(schema),
    }
    clearance = keys["clearance"]
    several = {"type": "array", "items": clearance}
    keys["clearance"] = {"anyOf": [_BOOLEAN, clearance, several]}
    keys["damping"] = {"anyOf": [_BOOLEAN, keys["damping"]]}
    schema["required"] = [name for name in schema["required"] if name != "path"]
    _add_descriptions(schema)
    schema |= {
        "oneOf": [{"required": ["path"]}, {"required": ["seams"]}],
        "dependentRequired": {"job": ["seams"]},
    }
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **_with_units(schema)}


def _reference(definition: str) -> dict[str, Any]:
    return {"$ref": f"#/$defs/{definition}"}


def _set_nested_paths(definitions: Mapping[str, Any]) -> None:
    """Replace the schema of keys that hold paths by a reference to tool motions."""
    for kind in definitions[_TOOL_MOTION]["discriminator"]["mapping"].values():
        keys = definitions[kind.rpartition("/")[2]]["properties"]
        for name in _NESTED_PATH_KEYS:
            if name in keys:
                # Not shared between keys: descriptions are added in place.
                reference = _reference(_TOOL_MOTION)
                is_list = name == "pieces"
                keys[name] = {"type": "array", "items": reference} if is_list else reference


def _seams_schema(schema: Mapping[str, Any]) -> dict[str, Any]:
    """Return the schema of `seams`: a list of seams, or one table with a file of them."""
    definitions, keys = schema["$defs"], schema["properties"]
    leaves = {
        "type": "array",
        "items": definitions["Workpiece"]["properties"]["obstacles"]["items"],
    }
    shared = {
        **{name: value for name, value in _SEAM_KEYS.items() if name in SEAM},
        **{name: keys[name] for name in OF_PROBLEM},
        "leaves": leaves,
    }
    file = definitions["file"]["properties"]
    table = {
        **{name: value for name, value in shared.items() if name not in ("name", "path")},
        **{name: file[name] for name in OF_TABLE if name in file},
        "run_up": _BOOLEAN,
        "most_feed": _NUMBER,
    }
    table["feed"] = {"anyOf": [file["feed"], {"const": HIGHEST}]}
    one = {**shared, "path": _reference(_TOOL_MOTION)}
    seams = {
        "type": "array",
        "items": _object_schema("Seam", one, ["name", "path"]),
        "minItems": 1,
    }
    return {"anyOf": [seams, _object_schema("Seam", table, ["file"])]}


def _job_schema(schema: Mapping[str, Any]) -> dict[str, Any]:
    # Keys without a schema of their own are start configurations.
    start = schema["properties"]["start"]
    return _object_schema("Job", {name: _JOB_KEYS.get(name, start) for name in JOB}, [])


def _object_schema(title: str, keys: Mapping[str, Any], required: list[str]) -> dict[str, Any]:
    """Return the schema of a table that has these keys and no others."""
    return {
        "title": title,
        "type": "object",
        "properties": {key: dict(value) for key, value in keys.items()},
        "required": required,
        "additionalProperties": False,
    }


def _add_descriptions(node: Any) -> None:
    """Set the description of every key of all tables of a schema, in place."""
    if isinstance(node, list):
        for item in node:
            _add_descriptions(item)
    if not isinstance(node, dict):
        return
    for item in node.values():
        _add_descriptions(item)
    if "title" in node and isinstance(node.get("properties"), dict):
        notes = key_notes(node["title"])
        for key, value in node["properties"].items():
            if key in notes:
                value["description"] = notes[key]


def _with_units(node: Any) -> Any:
    """Return a schema in which angles may be in degrees, and lengths in mm."""
    if isinstance(node, list):
        return [_with_units(item) for item in node]
    if not isinstance(node, dict):
        return node
    with_units = {name: _with_units(value) for name, value in node.items()}
    # JSON has no infinity.
    if isinstance(with_units.get("default"), float) and math.isinf(with_units["default"]):
        del with_units["default"]
    keys = with_units.get("properties")
    # `properties` is a keyword of JSON Schema here, unless a key has that name.
    if not isinstance(keys, dict) or "type" not in with_units:
        return with_units
    # Its numbers have no units, though some keys are called as lengths are.
    if with_units.get("title") == QuasiNewton.__name__:
        return with_units
    for suffix, names, scale, units in (
        ("_deg", ANGLES, 180.0 / math.pi, ("rad", "°")),
        ("_mm", LENGTHS, 1e3, ("m", "mm")),
    ):
        for name in sorted(names & set(keys)):
            # Tables have units of their own keys; shares have no unit.
            if _is_table(keys[name]) or is_share(name, keys.get("kind", {}).get("const")):
                continue
            keys[name + suffix] = _scaled(keys[name], scale, units)
            if name in with_units.get("required", []):
                with_units["required"].remove(name)
    return with_units


def _is_table(node: Mapping[str, Any]) -> bool:
    """Whether a value is a table, or may be one."""
    return "$ref" in node or any(item.get("type") == "object" for item in node.get("anyOf", ()))


def _scaled(node: Mapping[str, Any], scale: float, units: tuple[str, str]) -> dict[str, Any]:
    """Return the schema of a value in another unit, with its default and description in that."""
    scaled = dict(node)
    if "description" in scaled:
        old, new = units
        scaled["description"] = re.sub(
            r"\[[^\[\]]*\]",
            lambda unit: re.sub(rf"(?<!\w){old}(?!\w)", new, unit[0]),
            scaled["description"],
        )
    default = scaled.get("default")
    if isinstance(default, int | float) and not isinstance(default, bool):
        scaled["default"] = float(f"{default * scale:.12g}")
    elif default is not None:
        del scaled["default"]
    return scaled

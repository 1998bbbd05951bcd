"""JSON Schema of problem and job files: keys, types, units and descriptions, for editors."""

import math
import re
from collections.abc import Mapping
from typing import Any

from pydantic.json_schema import models_json_schema

from selfmotion.basics import is_share
from selfmotion.shell.documents.job_tables import JobFile
from selfmotion.shell.documents.problem_table import ProblemTable, QuasiNewtonTable
from selfmotion.shell.documents.tables import UNITS


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of problem files and job files.

    Angles may be given with the suffix ``_deg``, lengths with ``_mm``. A file has either ``path``
    or ``seams``.
    """
    both: Any = [(ProblemTable, "validation"), (JobFile, "validation")]
    known = models_json_schema(both)[1]["$defs"]
    problem, job = known.pop(ProblemTable.__name__), known.pop(JobFile.__name__)
    schema = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **problem,
        "$defs": known,
        "properties": {**job["properties"], **problem["properties"]},
        "required": [name for name in problem["required"] if name in job["required"]],
        "oneOf": [{"required": ["path"]}, {"required": ["seams"]}],
        "dependentRequired": {"job": ["seams"]},
    }
    _set_descriptions(schema, known)
    found: dict[str, Any] = _with_units(schema)
    return found


def _set_descriptions(node: Any, known: Mapping[str, Any]) -> None:
    """Describe keys that say which table it is, and those that hold a table, in place."""
    for item in node.values() if isinstance(node, dict) else node:
        if isinstance(item, dict | list):
            _set_descriptions(item, known)
    for name, value in node.get("properties", {}).items() if isinstance(node, dict) else ():
        if name in ("kind", "shape") and "const" in value:
            value["description"] = "Which of these it is."
        elif "description" not in value and "$ref" in value:
            value["description"] = known[value["$ref"].rpartition("/")[2]]["description"]


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
    if with_units.get("title") == QuasiNewtonTable.__name__:
        return with_units
    for (suffix, names), scale, units in zip(
        UNITS.items(), (180.0 / math.pi, 1e3), (("rad", "°"), ("m", "mm")), strict=True
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
    return "$ref" in node or any("$ref" in item for item in node.get("anyOf", ()))


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

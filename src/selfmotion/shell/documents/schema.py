"""JSON Schema of problem and job files: keys, types, units and descriptions, for editors."""

from collections.abc import Mapping
from typing import Any

from pydantic.json_schema import models_json_schema

from selfmotion.shell.documents.job_tables import JobFile
from selfmotion.shell.documents.problem_table import ProblemTable


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of problem files and job files.

    Angles may be given with the suffix ``_deg``, lengths with ``_mm``. A file has either ``path``
    or ``seams``.
    """
    both: Any = [(ProblemTable, "validation"), (JobFile, "validation")]
    known = models_json_schema(both)[1]["$defs"]
    problem, job = known.pop(ProblemTable.__name__), known.pop(JobFile.__name__)
    schema: dict[str, Any] = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **problem,
        "$defs": known,
        "properties": {**job["properties"], **problem["properties"]},
        "required": [name for name in problem["required"] if name in job["required"]],
        "oneOf": [{"required": ["path"]}, {"required": ["seams"]}],
        "dependentRequired": {"job": ["seams"]},
    }
    _set_descriptions(schema, known)
    return schema


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

"""The page of all keys of problem and job files, from the same schema that editors complete by."""

from collections.abc import Iterator, Mapping
from typing import Any

from selfmotion.shell.documents import json_schema

_INTRO = """# Every key of a file

Problem files and job files are TOML, JSON or YAML. Units are SI; a key that is an angle may end in
`_deg`, and one that is a length or a speed in `_mm` (`radius_mm = 150`). Keys in **bold** are
required. `selfmotion schema` writes the same as a JSON Schema, by which editors complete and
explain keys. [Read and write files](howto/files.md) shows them at work."""
_POSE = """## A pose { #pose }

A table `{ position = [x, y, z], … }` with one orientation, or a 4 × 4 matrix."""
# Kinds by the key that holds them, and what the section is called.
_FAMILIES = (
    ("costs", "Costs"),
    ("constraints", "Constraints"),
    ("null_motion", "Null motions"),
)
_SUFFIXES = ("_deg", "_mm")


def keys_page() -> str:
    """Return the page."""
    schema = json_schema()
    known = schema["$defs"]
    top = {key: value for key, value in schema["properties"].items() if key not in ("grid",)}
    parts = [_INTRO, "## The file { #file }", _table({**schema, "properties": top})]
    for name, title in (("Robot", "robot"), ("RobotPart", "robot.parts.NAME")):
        parts += [f"## {title}", _table(known[name])]
    parts += ["## path", "One of these, by its `kind`. A path in a path is one of these, too."]
    parts += _kinds(known, known["ToolMotion"]["discriminator"]["mapping"])
    for key, title in _FAMILIES:
        node = schema["properties"][key]
        node = node.get("items", node)
        parts += [f"## {title}: {key}", "One of these, by its `kind`."]
        parts += _kinds(known, node["discriminator"]["mapping"])
    shapes = known["Workpiece"]["properties"]["obstacles"]["items"]["discriminator"]["mapping"]
    parts += ["## Bodies", "Of obstacles, of the workpiece, and of links, by their `shape`."]
    parts += _kinds(known, shapes)
    for name, title in (
        *(("Relaxation", "relaxations"), ("Workpiece", "workpiece"), ("Follow", "also")),
        *(("Search", "search"), ("Tolerance", "tolerance"), ("InParts", "parts")),
        *(("Damping", "damping"), ("QuasiNewton", "optimiser"), ("LineSearch", "line_search")),
    ):
        parts += [f"## {title}", known[name].get("description", ""), _table(known[name])]
    listed, table = schema["properties"]["seams"]["anyOf"]
    parts += ["## seams", "A list, `[[seams]]`, each with:", _table(listed["items"])]
    parts += ["Or one table, `[seams]`, with a file of all of them:", _table(table)]
    parts += ["## job", _table(schema["properties"]["job"])]
    for title in ("leads", "weave"):
        parts += [f"## {title}", _table(known["line"]["properties"][title])]
    pose = next(item for item in known["dwell"]["properties"]["at"]["anyOf"] if "title" in item)
    parts += [_POSE, _table(pose)]
    return "\n\n".join(part for part in parts if part)


def _kinds(known: Mapping[str, Any], mapping: Mapping[str, str]) -> Iterator[str]:
    for kind, reference in sorted(mapping.items()):
        table = known[reference.rpartition("/")[2]]
        yield f"### `{kind}`"
        yield table.get("description", "")
        yield _table(table)


def _table(node: Mapping[str, Any]) -> str:
    """Return a table of the keys of a table, but for those in other units."""
    keys, required = node["properties"], node.get("required", ())
    rows = []
    for key, value in keys.items():
        if key in ("kind", "shape") or (key.endswith(_SUFFIXES) and key.rpartition("_")[0] in keys):
            continue
        # In another unit it will do as well, so that none of them is required.
        units = [key + suffix for suffix in _SUFFIXES if key + suffix in keys]
        is_required = key in required or (units and "default" not in value)
        name = f"**`{key}`**" if is_required else f"`{key}`"
        told = value.get("description", "").replace("|", "\\|")
        others = ", ".join(f"`{unit}`" for unit in units)
        rows.append(f"| {name} | {_type(value)} | {_default(value)} | {told} | {others} |")
    if not rows:
        return "No keys of its own."
    head = "| key | value | default | what | also as |\n| --- | --- | --- | --- | --- |"
    return "\n".join([head, *rows])


def _default(node: Mapping[str, Any]) -> str:
    value = node.get("default")
    if value is None:
        return ""
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def _type(node: Mapping[str, Any]) -> str:
    """Return in words what a key holds."""
    if "$ref" in node:
        return _link(node["$ref"].rpartition("/")[2])
    if "const" in node:
        return f"`{node['const']}`"
    if "enum" in node:
        return ", ".join(f"`{value}`" for value in node["enum"])
    if "oneOf" in node:
        return "table by kind"
    if "anyOf" in node:
        several = [_type(item) for item in node["anyOf"]]
        return " or ".join(dict.fromkeys(text for text in several if text))
    match node.get("type"):
        case "array":
            inner = _type(node["items"]) if "items" in node else ""
            return f"list of {inner}" if inner else "list"
        case "object":
            return _link(node["title"]) if node.get("title") in _SECTIONS else "table"
        case None:
            return ""
        case name:
            return {"boolean": "true or false", "string": "text"}.get(name, str(name))


# Sections of tables by their titles.
_SECTIONS = {
    **{"Pose": "pose", "Robot": "robot", "RobotPart": "robotpartsname", "ToolMotion": "path"},
    **{"Relaxation": "relaxations", "Workpiece": "workpiece", "Follow": "also"},
    **{"Search": "search", "Tolerance": "tolerance", "InParts": "parts", "Damping": "damping"},
    **{"QuasiNewton": "optimiser", "LineSearch": "line_search", "Leads": "leads"},
    **{"Weave": "weave", "Seam": "seams", "Job": "job"},
}


def _link(title: str) -> str:
    section = _SECTIONS.get(title)
    if section is None:
        return "table"
    return f"[{section.replace('robotpartsname', 'part')}](#{section})"

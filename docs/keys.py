"""The page of all keys of problem and job files, from the same schema that editors complete by."""

from collections.abc import Iterator, Mapping
from typing import Any

from selfmotion.shell.documents import json_schema

_INTRO = """# Every key of a file

Problem files and job files are TOML, JSON or YAML. Units are SI; a key that is an angle may end in
`_deg`, and one that is a length or a speed in `_mm` (`radius_mm = 150`). Keys in **bold** are
required. `selfmotion schema` writes the same as a JSON Schema, by which editors complete and
explain keys. [Read and write files](howto/files.md) shows them at work."""
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
    for name, title in (("RobotTable", "robot"), ("RobotPartTable", "robot.parts.NAME")):
        parts += [f"## {title}", _table(known[name])]
    parts += ["## path", "One of these, by its `kind`. A path in a path is one of these, too."]
    parts += _kinds(known, known["ToolMotion"]["discriminator"]["mapping"])
    for key, title in _FAMILIES:
        node = schema["properties"][key]
        node = node.get("items", node)
        parts += [f"## {title}: {key}", "One of these, by its `kind`."]
        parts += _kinds(known, node["discriminator"]["mapping"])
    shapes = known["WorkpieceTable"]["properties"]["obstacles"]["items"]["discriminator"]["mapping"]
    parts += ["## Bodies", "Of obstacles, of the workpiece, and of links, by their `shape`."]
    parts += _kinds(known, shapes)
    for name, title in (
        *(("Relaxation", "relaxations"), ("Workpiece", "workpiece"), ("Follow", "also")),
        *(("Search", "search"), ("Tolerance", "tolerance"), ("InParts", "parts")),
        *(("Damping", "damping"), ("QuasiNewton", "optimiser"), ("LineSearch", "line_search")),
        ("Loop", "loop"),
    ):
        table = known[f"{name}Table"]
        parts += [f"## {title}", table["description"], _table(table)]
    parts += ["## seams", "A list, `[[seams]]`, each with:", _table(known["SeamTable"])]
    parts += ["Or one table, `[seams]`, with a file of all of them:", _table(known["SeamsFile"])]
    for title in ("job", "leads", "weave", "pose"):
        table = known[f"{title.capitalize()}Table"]
        parts += [f"## {title} {{ #{title} }}", table["description"], _table(table)]
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
    rows = list[tuple[bool, str]]()
    for key, value in keys.items():
        if key in ("kind", "shape") or (key.endswith(_SUFFIXES) and key.rpartition("_")[0] in keys):
            continue
        # In another unit it will do as well, so that none of them is required.
        units = [key + suffix for suffix in _SUFFIXES if key + suffix in keys]
        is_required = key in required or (units and "default" not in value)
        name = f"**`{key}`**" if is_required else f"`{key}`"
        told = value.get("description", "").replace("|", "\\|")
        others = ", ".join(f"`{unit}`" for unit in units)
        row = f"| {name} | {_type(value)} | {_default(value)} | {told} | {others} |"
        rows.append((not is_required, row))
    if not rows:
        return "No keys of its own."
    head = "| key | value | default | what | also as |\n| --- | --- | --- | --- | --- |"
    return "\n".join([head, *(row for _, row in sorted(rows, key=lambda item: item[0]))])


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
            return "table"
        case None:
            return ""
        case name:
            return {"boolean": "true or false", "string": "text"}.get(name, str(name))


# Sections of tables by the names of their models.
_SECTIONS = {
    **{"RobotTable": "robot", "RobotPartTable": "robotpartsname", "ToolMotion": "path"},
    **{"RelaxationTable": "relaxations", "FollowTable": "also", "InPartsTable": "parts"},
    **{"QuasiNewtonTable": "optimiser", "LineSearchTable": "line_search", "SeamTable": "seams"},
    **{
        f"{name.capitalize()}Table": name
        for name in (
            *("pose", "workpiece", "search", "tolerance", "damping", "loop", "leads", "weave"),
            *("job",),
        )
    },
}


def _link(name: str) -> str:
    section = _SECTIONS.get(name)
    if section is None:
        return "table"
    return f"[{section.replace('robotpartsname', 'part')}](#{section})"

"""The JSON Schema of problem and job files, for editors, with what each key means."""

import inspect
import math
import re
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

from selfmotion.basics import ANGLES, LENGTHS, Saved, is_share
from selfmotion.certificate import Tolerance
from selfmotion.model.collision import obstacle_shapes
from selfmotion.model.follow import Follow
from selfmotion.model.motion import NullMotion
from selfmotion.model.path import Circle, Feed, Path, Weave, with_leads
from selfmotion.model.robot import load_robot
from selfmotion.model.task import Damping, Relaxation
from selfmotion.planning.optimise import LineSearch, QuasiNewton
from selfmotion.planning.planner import PlanRequest, Search, plan, plan_in_parts
from selfmotion.problem.constraints import Clearance, Constraint
from selfmotion.problem.costs import Cost
from selfmotion.problem.problem import Problem
from selfmotion.shell.documents.models import document_model
from selfmotion.shell.documents.seam_job import HIGHEST, JOB, OF_PROBLEM, OF_TABLE, SEAM
from selfmotion.shop.cam import read_path
from selfmotion.work.job import Seam, plan_job

# What a table's keys are given to, where that is no class of its own name.
_GIVEN_TO: Mapping[str, tuple[Callable[..., Any], ...]] = {
    "Problem": (Problem, plan, PlanRequest),
    "Robot": (load_robot,),
    "RobotPart": (load_robot,),
    "InParts": (plan_in_parts,),
    "file": (Feed, read_path),
    "circle": (Feed, Circle.around),
    "line": (Feed,),
    "spiral": (Feed,),
    "Seam": (Problem, Feed, read_path, Seam),
    "Job": (plan_job,),
    "Clearance": (Clearance,),
    "Leads": (with_leads,),
    "Weave": (Weave,),
    **{cls.__name__: (cls,) for cls in (Damping, Follow, LineSearch, QuasiNewton)},
    **{cls.__name__: (cls,) for cls in (Relaxation, Search, Tolerance)},
}
# What files say otherwise than the classes, in tables of a name; "" for all others.
_ORIENTATION = "of the axes; one of rotation, quaternion, rpy, rotation_vector and normal"
_QUATERNIONS = "w, x, y, z of each pose, as `quaternions_wxyz`; or 3 × 3 matrices."
_IN_FILES: Mapping[str, Mapping[str, str]] = {
    "": {
        "kind": "Which of these it is.",
        "shape": "Which of these it is.",
        "frame": "Where it is placed: a pose in the frame of the reference.",
        "leads": "An approach and a retract along the tool's axis: length [m], duration [s].",
        "weave": "Swings beside the path: amplitude [m], pitch [m], axis, dwell.",
        "feed": "Speed of the tool along it [m/s]; or give a duration.",
        "duration": "How long it takes [s]; or give a feed.",
        "start": "The tool's first pose; by default that of the start configuration.",
        "position": "Of the origin [m].",
        "rotation": f"3 × 3 matrix {_ORIENTATION}.",
        "quaternions": "Orientations w, x, y, z, one for each point.",
        "quaternion": f"w, x, y, z {_ORIENTATION}.",
        "rpy": f"Roll, pitch and yaw [rad] {_ORIENTATION}.",
        "rotation_vector": f"Axis times angle [rad] {_ORIENTATION}.",
        "normal": "Direction of the z axis, instead of an orientation.",
    },
    "Problem": {
        "robot": "The arm, or the cell.",
        "path": "The tool motion.",
        "task": "Which rows of the tool's pose are prescribed; by default pose, of an "
        "arm in a plane planar.",
        "start": "The start configuration [rad or m], or which; by default free: many are tried.",
        "workpiece": "What paths and bodies are placed with.",
        "joint_limits": "A MoveIt file of joint limits that count besides the arm's own.",
        "optimiser": "The published method's quasi-Newton method, and its numbers.",
        "grid": "Values to try for keys, for `selfmotion batch`: a list for each.",
        "loop": "How `selfmotion follow` runs the loop with a controller.",
        "seams": "Seams of a job, for `selfmotion job`: a list, or one table with a file of them.",
        "job": "How a job is planned.",
        "also": "What else of the arm follows a path at the same time: their rows are prescribed.",
        "clearance": "How far bodies keep apart, and which; by default links must not overlap. "
        "False to leave that out.",
    },
    "Loop": {
        "horizon": "How far ahead is planned [s]; 2 by default.",
        "period": "Time between states [s]; 0.01 by default.",
        "cycle": "Time between set-points [s]; 0.001 by default.",
        "latency": "From measuring a state until the arm follows its segment [s]; 0 by default.",
        "silence": "Without a state for so long it ends [s]; 5 by default.",
        "seconds": "How long it runs [s]; by default until it is stopped.",
    },
    "Robot": {
        "name": "An arm that is known by name; see `selfmotion robots`.",
        "file": "A URDF or xacro file.",
        "parts": "Robots that make a cell, by name.",
        "bodies": "Bodies that links carry, each with the link as its frame.",
        "base": "Pose of its root link in the world; of parts, each has its own.",
        "arguments": "Of a xacro file; of parts, each has its own.",
    },
    "RobotPart": {
        "name": "An arm that is known by name, or a positioner.",
        "file": "A URDF or xacro file.",
        "on": "The link of another part that carries it.",
        "base": "Pose of its root link in the world, or in the link that carries it.",
        "arguments": "Of a xacro file.",
    },
    "Workpiece": {
        "frame": "Where it stands: a pose in the world, or in the frame of `on`.",
        "on": "The link that carries it; paths are in its frame then.",
        "mesh": "Its shape, a file in the same frame; it is kept clear of.",
        "scale": "What a unit of the mesh is [m].",
        "obstacles": "Bodies that move with it.",
    },
    "Follow": {
        "pose": "A pose that is held; or give a path.",
        "path": "What it follows; or give a pose.",
    },
    "file": {"file": "The file of poses; see [paths from files](howto/seam.md)."},
    "function": {
        "code": "`module:attribute` of a function of samples; read with --allow-code.",
        "name": "What reports call it.",
    },
    "circle": {"radius": "[m], where the centre follows from the start; or give the centre."},
    "line": {"by": "How far it goes from the start [m]; or give the end."},
    "waypoints": {"quaternions": _QUATERNIONS},
    "polyline": {"quaternions": _QUATERNIONS},
    "twist": {
        "breaks": "Times at which the polynomials change [s].",
        "coefficients": "Of the twist's six components between them, lowest order first.",
    },
    "Seam": {
        "file": "The file of all seams.",
        "leaves": "Bodies that are there from then on.",
        "events": "What happens how long after its start [s], whichever way it is made: "
        '`["arc on", 0.1]`.',
        "run_up": "Whether the tool runs up before the seam and stops behind it.",
        "most_feed": 'With feed = "highest": no more than this [m/s].',
    },
    "Job": {"rng": "Seed of everything that is drawn."},
}


def _classes() -> dict[str, type]:
    # Classes of the user's own may come to be known later.
    families: tuple[type[Saved], ...] = (Path, NullMotion, Cost, Constraint)
    classes = {kind: cls for family in families for kind, cls in family.kinds().items()}
    return {**classes, **dict(obstacle_shapes())}


def notes_of(table: str) -> dict[str, str]:
    """Return what the keys of a table mean, in Markdown, by key: of a class or of one of ours."""
    own = _classes().get(table)
    sources = (*((own,) if own else ()), *_GIVEN_TO.get(table, ()))
    notes: dict[str, str] = {}
    for source in sources:
        notes |= _parameters(source)
    return {**_IN_FILES[""], **notes, **_IN_FILES.get(table, {})}


@cache
def _parameters(source: Callable[..., Any]) -> dict[str, str]:
    """Return what a docstring says of parameters, and those of the classes that it is made of."""
    from docstring_parser import DocstringStyle, parse

    documented = source.__mro__[::-1] if isinstance(source, type) else (source,)
    parameters: dict[str, str] = {}
    for each in documented:
        for item in parse(inspect.getdoc(each) or "", style=DocstringStyle.NUMPYDOC).params:
            for name in item.arg_name.split(","):
                if item.description:
                    parameters[name.strip()] = " ".join(item.description.split())
    return parameters


_MOTION = "ToolMotion"
# Paths that are made of others, and the key of these.
_INNER = ("path", "pieces")
# JSON Schema of a text.
_TEXT = {"type": "string"}
# JSON Schema of a number.
_NUMBER = {"type": "number"}
# JSON Schema of a flag.
_FLAG = {"type": "boolean"}
# JSON Schema of a list of names.
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
    **dict.fromkeys(("seconds_per_cost", "move_seconds"), _NUMBER),
}


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of problem files and job files.

    Keys may be given with ``_deg`` and ``_mm`` wherever that is read. A file has either a path or
    seams.
    """
    schema = document_model().model_json_schema()
    definitions, keys = schema["$defs"], schema["properties"]
    definitions[_MOTION] = keys["path"]
    _made_of_others(definitions)
    keys |= {"path": _of(_MOTION), "seams": _seams(schema), "job": _job(schema)}
    one = keys["clearance"]
    keys["clearance"] = {"anyOf": [_FLAG, one, {"type": "array", "items": one}]}
    keys["damping"] = {"anyOf": [_FLAG, keys["damping"]]}
    schema["required"] = [name for name in schema["required"] if name != "path"]
    _note(schema)
    schema |= {
        "oneOf": [{"required": ["path"]}, {"required": ["seams"]}],
        "dependentRequired": {"job": ["seams"]},
    }
    scaled: dict[str, Any] = _with_units(schema)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **scaled}


def _of(definition: str) -> dict[str, Any]:
    return {"$ref": f"#/$defs/{definition}"}


def _made_of_others(definitions: Mapping[str, Any]) -> None:
    """Say of paths that are made of others that these are paths."""
    motion = definitions[_MOTION]
    for reference in motion["discriminator"]["mapping"].values():
        keys = definitions[reference.rpartition("/")[2]]["properties"]
        for name in _INNER:
            if name in keys:
                several = name == "pieces"
                keys[name] = {"type": "array", "items": _of(_MOTION)} if several else _of(_MOTION)


def _seams(schema: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a list of seams, or one table of all of them, may say."""
    definitions, keys = schema["$defs"], schema["properties"]
    leaves = {
        "type": "array",
        "items": definitions["Workpiece"]["properties"]["obstacles"]["items"],
    }
    of_all = {
        **{name: value for name, value in _OF_SEAM.items() if name in SEAM},
        **{name: keys[name] for name in OF_PROBLEM},
        "leaves": leaves,
    }
    file = definitions["file"]["properties"]
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
    with_units = {name: _with_units(value) for name, value in node.items()}
    # JSON has no infinity.
    if isinstance(with_units.get("default"), float) and math.isinf(with_units["default"]):
        del with_units["default"]
    keys = with_units.get("properties")
    # A schema's own word, unless it is a key that is called so.
    if not isinstance(keys, dict) or "type" not in with_units:
        return with_units
    if with_units.get("title") == QuasiNewton.__name__:
        return with_units
    for suffix, names, scale, units in (
        ("_deg", ANGLES, 180.0 / math.pi, ("rad", "°")),
        ("_mm", LENGTHS, 1e3, ("m", "mm")),
    ):
        for name in sorted(names & set(keys)):
            # A table, whose own keys have units; or a number that has none here.
            if _is_table(keys[name]) or is_share(name, keys.get("kind", {}).get("const")):
                continue
            keys[name + suffix] = _scaled(keys[name], scale, units)
            if name in with_units.get("required", []):
                with_units["required"].remove(name)
    return with_units


def _is_table(node: Mapping[str, Any]) -> bool:
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

"""Schema of problem files: pydantic models made from the signatures of the classes.

So a class is described once, in Python: its keys, defaults and first line of documentation are
those of its parameters, and a class of one's own is known like ours.
"""

from __future__ import annotations

import dataclasses
import inspect
import sys
from collections.abc import Iterable, Mapping
from functools import lru_cache, reduce
from operator import or_
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, create_model

from selfmotion.basics import Array, Saved
from selfmotion.certificate import Tolerance
from selfmotion.model.collision import Mesh, Obstacle, obstacle_shapes
from selfmotion.model.motion import NullMotion
from selfmotion.model.path import ORIENTATIONS, Path, TimeLaw
from selfmotion.model.task import SE3, Damping, Relaxation, Task
from selfmotion.planning.optimise import QuasiNewton
from selfmotion.planning.planner import GOALS, Search
from selfmotion.problem.constraints import Clearance, Constraint
from selfmotion.problem.costs import Cost
from selfmotion.shell.documents.field_types import (
    Axis,
    Coordinates,
    Flag,
    Leads,
    Names,
    Number,
    Numbers,
    Pose,
    Start,
    Table,
    Text,
    Weave,
    Whole,
)
from selfmotion.shell.documents.problem_parts import FEED_BOUNDS, FUNCTION

# Kinds that no file names: what is missing of a plan, a cost that damping adds, functions (which
# are named by module:attribute).
_NOT_IN_FILES = {"LostCost", "OffPath", "BeyondLimits", "FunctionCost"}
_STRICT = ConfigDict(extra="forbid", protected_namespaces=())
_PLAIN = {bool: Flag, int: Whole, float: Number, str: Text, SE3: Pose}

_Fields = dict[str, tuple[Any, Any]]
# Where a file says more, or says it otherwise, than the class's own signature.
_LAWS: Any = Literal[tuple(law.value for law in TimeLaw)]
_SHAPE: _Fields = {"frame": (Pose, None), "leads": (Leads, None)}
_BOUNDS: _Fields = dict.fromkeys(FEED_BOUNDS, (Number, None))
_WOVEN: _Fields = {"weave": (Weave, None)}
_PACED: _Fields = {
    **{"duration": (Number, None), "feed": (Number, None)},
    **_BOUNDS,
    **_SHAPE,
    **_WOVEN,
}
_OWN: Mapping[str, _Fields] = {
    "circle": {"start": (Pose, None), "center": (Numbers, None), "radius": (Number, None),
               "normal": (Numbers, [0.0, 0.0, 1.0]), **_PACED},
    "spiral": {"start": (Pose, None), "center": (Numbers, ...), "normal": (Numbers, ...),
               **_PACED},
    "line": {"start": (Pose, None), "end": (Pose, None), "by": (Numbers, None), **_PACED},
    # Files say `quaternions`, which are w, x, y, z there.
    "waypoints": {**_SHAPE, "quaternions": (Any, None)},
    "polyline": {**_SHAPE, "quaternions": (Any, None)},
    "twist": {"start": (Pose, ...), "breaks": (Numbers, ...), "coefficients": (Numbers, ...)},
    "retimed": {"path": (Table, ...)},
    "section": {"path": (Table, ...)},
    "feed": {"path": (Table, ...), "stretches": (list[Numbers], None), **_SHAPE},
    "joined": {"pieces": (list[Table], ...), **_SHAPE},
    "dwell": {"at": (Pose, ...)},
    "placed": {"path": (Table, ...), "frame": (Pose, ...)},
    "reversed": {"path": (Table, ...)},
    "weave": {"path": (Table, ...), **_SHAPE},
    "Relaxation": {"rows": (Names, ...), "during": (Numbers, None)},
    "Search": {"rng": (Whole, 0)},
    # A file does not show a default: down suits a torch, and is upside down for a table.
    "Tilt": {"axis": (Axis, "z"), "towards": (Numbers, ...)},
}  # fmt: skip
_WHOLLY_OWN = {"twist"}


# The arm: one known by name, or a URDF or xacro file; or a cell of several of these.
_ROBOT: _Fields = {
    **dict.fromkeys(("name", "file", "calibration", "reference"), (Text, None)),
    **dict.fromkeys(("base", "tool_offset"), (Pose, None)),
    "tool": (Names, None),
    "packages": (Names, None),
    "arguments": (Table, None),
    "lock": (Coordinates, None),
}
_PART: _Fields = {
    **dict.fromkeys(("name", "file", "on", "calibration"), (Text, None)),
    "base": (Pose, None),
    "arguments": (Table, None),
}
# What else follows a path, or is held at a pose.
_FOLLOW: _Fields = {
    **dict.fromkeys(("tool", "reference"), (Text, None)),
    "pose": (Pose, None),
}
# How a motion in parts leaves and meets the path; its other settings are the problem's.
_IN_PARTS: _Fields = {"retreat": (Number, 0.0), "ramp": (Number, 0.5), "axis": (Numbers, None)}
# What paths and bodies are placed with.
_WORKPIECE: _Fields = {
    "frame": (Pose, None),
    **dict.fromkeys(("on", "mesh"), (Text, None)),
    "scale": (Number, None),
}
# A tool motion from a file of poses.
_PATH_FILE: _Fields = {
    "kind": (Literal["file"], ...),
    "file": (Text, ...),
    **_SHAPE,
    **dict.fromkeys(("feed", "duration", "jump", "ramp"), (Number, None)),
    **dict.fromkeys(("tolerance", "corner_angle"), (Number, None)),
    "corners": (Text, None),
    "seam": (Text, None),
    "columns": (Names, None),
    "flip_normals": (Flag, False),
    "standoff": (Number, None),
    "along": (Text, None),
    **dict.fromkeys(("lead", "tilt", "lift"), (Number, None)),
    "rotary": (Text, None),
    "rotary_axes": (Names, None),
    "rotary_center": (Numbers, None),
    "unit": (Text, None),
    **_BOUNDS,
    **_WOVEN,
}
# How the loop with a controller runs, for `selfmotion follow`.
_LOOP: _Fields = dict.fromkeys(
    ("horizon", "period", "cycle", "latency", "silence", "seconds"), (Number, None)
)
# A cost that is a function of one's own.
_FUNCTION: _Fields = {
    "kind": (Literal["function"], ...),
    "code": (Text, ...),
    "name": (Text, None),
}


def document_model() -> type[BaseModel]:
    """Return the model of a problem file, with every class that is known by now."""
    families = (Path, NullMotion, Cost, Constraint)
    kinds = (cls for family in families for cls in family.kinds().values())
    return _document_model((*kinds, *(cls for _, cls in obstacle_shapes())))


def path_model() -> type[BaseModel]:
    """Return the model of a table whose ``path`` is a tool motion."""
    return _path_model(tuple(Path.kinds().values()))


@lru_cache(maxsize=1)
def _path_model(kinds: tuple[type, ...]) -> type[BaseModel]:
    return _model("Inner", {"path": (_tool_motion(), ...)})


def clearance_model() -> type[BaseModel]:
    """Return the model of a table whose ``clearance`` is one of several."""
    return _model("Inner", {"clearance": (model_of(Clearance, None, _clearance_fields()), ...)})


def _tool_motion() -> Any:
    """Return the type of a tool motion."""
    return _one_of({**_kinds(Path), "file": _model("file", _PATH_FILE)}.values(), "kind")


@lru_cache(maxsize=1)
def _document_model(kinds: tuple[type, ...]) -> type[BaseModel]:
    # Made anew where a class has come to be known: it takes a tenth of a second.
    clearance = model_of(Clearance, None, _clearance_fields())
    constraints = {**_kinds(Constraint), "Clearance": _clearance_model()}
    costs = {**_kinds(Cost), FUNCTION: _model(FUNCTION, _FUNCTION)}
    parts: Any = dict[str, _model("RobotPart", _PART)]  # type: ignore[misc]
    of_robot: _Fields = {"parts": (parts, None), "bodies": (_shapes(rides=True), None)}
    of_workpiece: _Fields = {**_WORKPIECE, "obstacles": (_shapes(rides=True), None)}
    tasks: Any = Literal[tuple(task.value for task in Task)]
    tool_motion = _tool_motion()
    follow = _model("Follow", {**_FOLLOW, "task": (tasks, "pose"), "path": (tool_motion, None)})
    fields: dict[str, Any] = {
        "robot": (_model("Robot", {**_ROBOT, **of_robot}), ...),
        "task": (tasks, "pose"),
        "start": (Start, "free"),
        "path": (tool_motion, ...),
        "also": (list[follow], None),  # type: ignore[valid-type]
        "null_motion": (_one_of(_kinds(NullMotion).values(), "kind"), None),
        "costs": (list[_one_of(costs.values(), "kind")], None),  # type: ignore[misc]
        "constraints": (list[_one_of(constraints.values(), "kind")], None),  # type: ignore[misc]
        "relaxations": (list[model_of(Relaxation)], None),  # type: ignore[misc]
        "clearance": (clearance, None),
        "workpiece": (_model("Workpiece", of_workpiece), None),
        "damping": (model_of(Damping), None),
        "rest": (bool, True),
        "joint_limits": (Text, None),
        "goal": (Literal[GOALS], None),
        "keep": (dict[str, float], None),
        "parts": (_model("InParts", _IN_PARTS), None),
        "search": (model_of(Search), None),
        "optimiser": (model_of(QuasiNewton), None),
        "tolerance": (model_of(Tolerance), None),
        "max_evaluations": (Whole, None),
        "outputs": (Names, None),
        "loop": (_model("Loop", _LOOP), None),
        "grid": (Table, None),
    }
    return _model("Problem", fields, "A planning problem.")


def model_of(
    cls: type, tag: tuple[str, str] | None = None, own_fields: _Fields | None = None
) -> type[BaseModel]:
    """Return the model of what a class is made from: its parameters, but for its context."""
    label = tag[1] if tag else cls.__name__
    own_fields = _OWN.get(label, {}) if own_fields is None else own_fields
    fields: _Fields = {} if tag is None else {tag[0]: (Literal[tag[1]], ...)}
    alone = label in _WHOLLY_OWN or issubclass(cls, Obstacle)
    parameters = {} if alone else _parameters(cls)
    for name, parameter in parameters.items():
        if name not in getattr(cls, "context", ()) and name not in own_fields:
            default = ... if parameter.default is inspect.Parameter.empty else _default(parameter)
            fields[name] = (_type_of(parameter.annotation), default)
    about = (inspect.getdoc(cls) or "").partition("\n")[0]
    return _model(label, {**fields, **own_fields}, about)


def _parameters(cls: type) -> dict[str, inspect.Parameter]:
    """Return what a class is made from, with types instead of their texts."""
    names: dict[str, Any] = {}
    for base in reversed(cls.__mro__):
        # A script that was run has no module any more.
        module = sys.modules.get(base.__module__)
        names |= {} if module is None else vars(module)
    parameters = inspect.signature(cls).parameters
    return {
        name: item.replace(annotation=_evaluated(item.annotation, names))
        for name, item in parameters.items()
    }


def _evaluated(annotation: Any, names: dict[str, Any]) -> Any:
    if not isinstance(annotation, str):
        return annotation
    try:
        return eval(annotation, names)
    except NameError:
        # A name that only type checkers import; what has such a type may be anything.
        return annotation


def _model(label: str, fields: _Fields, about: str = "") -> type[BaseModel]:
    made: type[BaseModel] = create_model(label, __config__=_STRICT, __doc__=about, **fields)  # type: ignore[call-overload]
    return made


def _kinds(family: type[Saved]) -> dict[str, type[BaseModel]]:
    kinds = {kind: cls for kind, cls in family.kinds().items() if kind not in _NOT_IN_FILES}
    return {kind: model_of(cls, ("kind", kind)) for kind, cls in kinds.items()}


def _shapes(*, rides: bool = False) -> Any:
    """Return the type of a list of obstacles: those of the world have to say where they are."""
    return _shapes_of(tuple(obstacle_shapes()), rides)


@lru_cache(maxsize=2)
def _shapes_of(known: tuple[tuple[str, type[Obstacle]], ...], rides: bool) -> Any:
    shapes = [model_of(cls, ("shape", shape), _placed(cls, rides)) for shape, cls in known]
    return list[_one_of(shapes, "shape")]  # type: ignore[misc]


def _clearance_fields() -> _Fields:
    return {
        "obstacles": (_shapes(), None),
        "disabled": (list[Names], None),
        "srdf": (Text, None),
    }


def _clearance_model() -> type[BaseModel]:
    return model_of(Clearance, ("kind", "Clearance"), _clearance_fields())


def _placed(cls: type[Obstacle], rides: bool) -> _Fields:
    """Return an obstacle's fields with its pose as position and orientation."""
    orientations: _Fields = {key: (Numbers, None) for key in ORIENTATIONS}
    fields: _Fields = {}
    parameters = _parameters(cls)
    for item in dataclasses.fields(cls):
        if item.name == "pose":
            # Meshes have a place of their own, and what rides on something has its frame.
            known = rides or cls is Mesh
            fields |= {"position": (Numbers, None if known else ...), **orientations}
        else:
            default = ... if item.default is dataclasses.MISSING else item.default
            kind = Text if item.name == "file" else _type_of(parameters[item.name].annotation)
            fields[item.name] = (kind, default)
    return fields


def _one_of(models: Iterable[type[BaseModel]], tag: str) -> Any:
    # A single model cannot be told apart from others, nor need it be.
    several = list(models)
    union = reduce(or_, several)
    return union if len(several) == 1 else Annotated[union, Field(discriminator=tag)]


def _default(parameter: inspect.Parameter) -> Any:
    value = parameter.default
    if isinstance(value, TimeLaw):
        return value.value
    return value if isinstance(value, bool | int | float | str) else None


def _type_of(annotation: Any) -> Any:
    if isinstance(annotation, dataclasses.InitVar):
        annotation = annotation.type
    if annotation in _PLAIN:
        return _PLAIN[annotation]
    parts = set(get_args(annotation))
    if annotation is Array or set(get_args(npt.ArrayLike)) <= parts:
        return Numbers
    if TimeLaw in parts:
        return _LAWS
    if isinstance(annotation, type) and dataclasses.is_dataclass(annotation):
        return model_of(annotation)
    # Of a list or a tuple, the parts are those of its items.
    rest = parts - {type(None)} if get_origin(annotation) in (Union, UnionType) else ()
    return _type_of(*rest) if len(rest) == 1 else Any

"""Objects from tables of a problem file: classes, motions, obstacles, starts, workpieces."""

import importlib
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from selfmotion.basics import (
    Array,
    FileFormatError,
    ProblemError,
    Saved,
    in_si,
    public_name,
    restore,
)
from selfmotion.model.collision import Mesh, Obstacle, obstacle_from_dict
from selfmotion.model.motion import NullMotion
from selfmotion.model.path import (
    ORIENTATIONS,
    Circle,
    Feed,
    Joined,
    Line,
    Path,
    Placed,
    Spiral,
    Weave,
    pose_of,
    with_leads,
)
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3, Task
from selfmotion.problem.constraints import Clearance, Constraint
from selfmotion.problem.costs import Cost
from selfmotion.shop.cam import read_path

if TYPE_CHECKING:
    from selfmotion.model.task import SE3

# The kind of a cost that is a function.
FUNCTION = "function"

_FAMILIES: Mapping[str, type[Saved]] = {
    "path": Path,
    "null_motion": NullMotion,
    "costs": Cost,
    "constraints": Constraint,
    "clearance": Clearance,
}


def name_kinds(
    table: dict[str, Any], folder: FilePath, allowed: bool
) -> dict[str, Callable[..., Any]]:
    """Import what kinds and shapes name as ``module:attribute``, and put the kinds there instead.

    Modules are looked for in `folder`, too.

    Returns
    -------
    dict
        The functions among them, by the name that the file gives; only costs may be functions.

    Raises
    ------
    FileFormatError
        Code is not allowed, or cannot be imported, or is nothing of that family.
    """
    functions: dict[str, Callable[..., Any]] = {}
    for section, family in _FAMILIES.items():
        section_table = table.get(section)
        for k, item in enumerate(
            section_table if isinstance(section_table, list) else [section_table]
        ):
            where = f"{section}[{k}]" if isinstance(section_table, list) else section
            if not isinstance(item, dict):
                continue
            value = _code(item.get("kind"), f"{where}.kind", folder, allowed)
            if isinstance(value, type) and issubclass(value, family):
                item["kind"] = value.kind
            elif section == "costs" and callable(value) and not isinstance(value, type):
                functions[item["kind"]] = value
                item |= {"code": item["kind"], "kind": FUNCTION}
            elif value is not None:
                raise FileFormatError(
                    f"{where}.kind: '{item['kind']}' is {value!r}, expected a class derived from "
                    f"{public_name(family)}" + (" or a function" * (section == "costs"))
                )
            _name_shapes(item, "obstacles", where, folder, allowed)
    for section, key in (("workpiece", "obstacles"), ("robot", "bodies")):
        if isinstance(table.get(section), dict):
            _name_shapes(table[section], key, section, folder, allowed)
    return functions


def _name_shapes(
    table: dict[str, Any], key: str, where: str, folder: FilePath, allowed: bool
) -> None:
    listed = table.get(key)
    for k, item in enumerate(listed if isinstance(listed, list) else ()):
        if isinstance(item, dict):
            place = f"{where}.{key}[{k}].shape"
            value = _code(item.get("shape"), place, folder, allowed)
            if isinstance(value, type) and issubclass(value, Obstacle):
                item["shape"] = value.shape
            elif value is not None:
                raise FileFormatError(
                    f"{place}: '{item['shape']}' is {value!r}, expected a class derived from "
                    f"selfmotion.obstacles.Obstacle"
                )


def _code(name: Any, where: str, folder: FilePath, allowed: bool) -> Any:
    """Return what ``module:attribute`` names; None where the name is none of that form."""
    if not isinstance(name, str) or ":" not in name:
        return None
    if not allowed:
        raise FileFormatError(
            f"{where}: '{name}' is code, which is run only where you ask for it: --allow-code, or "
            f"allow_code=True"
        )
    module, _, attribute = name.partition(":")
    place = str(folder.resolve())
    if place not in sys.path:
        sys.path.insert(0, place)
    try:
        return getattr(importlib.import_module(module), attribute)
    # A module of the user's may raise anything.
    except Exception as error:
        raise FileFormatError(
            f"{where}: '{name}' cannot be imported: {error}; expected module:attribute, the module "
            f"in {folder} or installed"
        ) from error


# Tool motions that may begin where the arm does, and have a feed.
_SHAPES = ("circle", "line", "spiral")
# Keys of tables of tool motions that bound a feed.
FEED_BOUNDS = ("turn_rate", "acceleration", "turn_acceleration", "smoothing", "within")


def path_of(
    table: Mapping[str, Any],
    robot: RobotModel,
    start: Array | None,
    file_beside: Callable[[str], FilePath],
) -> Path:
    """Return the tool motion of a problem file; its files are found by `file_beside`."""
    values = dict(table)
    kind = values.get("kind")
    frame = None if kind == Placed.kind else values.pop("frame", None)
    weave, leads = values.pop("weave", None), values.pop("leads", None)
    shape = kind in _SHAPES
    if shape and "start" not in values:
        if start is None:
            raise ProblemError(
                "start: is missing, and there is no start configuration whose pose to take; "
                "give the pose here, or the problem's start = 'dexterous' or numbers"
            )
        if frame is not None:
            raise ProblemError("frame: needs start, the tool's first pose in that frame")
        values["start"] = robot.pose(start)
    feed = values.pop("feed", None) if shape else None
    bounds = {name: values.pop(name) for name in FEED_BOUNDS if shape and name in values}
    if bounds and feed is None:
        raise ProblemError(f"{next(iter(bounds))}: has no effect without a feed")
    if shape:
        _require_one({**values, "feed": feed} if feed else values, "duration", "feed")
        # At a feed, the shape's own pace does not matter.
        values.setdefault("duration", 1.0)
    match kind:
        case "file":
            del values["kind"]
            if "columns" in values:
                # One text may have them all.
                values["columns"] = ",".join(values["columns"])
            path: Path = read_path(file_beside(values.pop("file")), **values)
            path = path if frame is not None else in_reference(path, robot)
        case "circle":
            path = _circle(values)
        case "line":
            path = _line(values)
        case "spiral":
            path = Spiral(**{key: value for key, value in values.items() if key != "kind"})
        case _:
            inner = partial(path_of, robot=robot, start=start, file_beside=file_beside)
            path = _restored(_with_inner(values, inner))
    path = path if feed is None else Feed(path, feed, **bounds)
    path = path if weave is None else with_weave_table(path, weave)
    path = path if leads is None else with_lead_table(path, leads)
    return path if frame is None else Placed(path, frame)


def in_reference(path: Path, robot: RobotModel) -> Path:
    """Return a path of a file with a note of the frame that its places are taken to be in."""
    frame = f"'{robot.urdf.root}', the arm's root" if robot.reference is None else robot.reference
    return path.noted((*path.notes, f"no frame is given: places of the file are in that of {frame}"
                                    f" (else: frame, --frame)"))  # fmt: skip


def with_lead_table(path: Path, values: Mapping[str, Any]) -> Path:
    """Return a path with a lead-in and a lead-out, as a file says it.

    An end at which a program has a rapid of its own along the tool's axis gets none.
    """
    _check_keys(values, "leads", ("length", "duration"), ("axis",))
    pieces = with_leads(path, **values).pieces
    first, last = rapid_ends(path)
    kept = pieces[int(first) : len(pieces) - int(last)]
    told = (RAPID_ENDS_NOTE,) if first or last else ()
    return Joined(kept).noted((*path.notes, *told))


# The note on leads that a program does not need.
RAPID_ENDS_NOTE = "leads are left out where the program has a rapid along the tool's axis"


def rapid_ends(path: Path) -> tuple[bool, bool]:
    """Return whether a path begins, and whether it ends, with a rapid of a program."""
    pieces = path.pieces if isinstance(path, Joined) else (path,)
    first, last = pieces[0], pieces[-1]
    return (
        isinstance(first, Feed) and not first.required,
        isinstance(last, Feed) and not last.required,
    )


def with_weave_table(path: Path, values: Mapping[str, Any]) -> Path:
    """Return a path along which the tool swings, as a file says it."""
    _check_keys(values, "weave", ("amplitude", "pitch"), ("axis", "dwell"))
    return Weave(path, **values)


def _check_keys(
    values: Mapping[str, Any], name: str, needed: Sequence[str], others: Sequence[str]
) -> None:
    for key in values:
        if key not in (*needed, *others):
            expected = ", ".join((*needed, *others))
            raise ProblemError(f"{name}.{key}: unknown key, expected {expected}")
    for key in needed:
        if key not in values:
            raise ProblemError(f"{name}.{key}: is missing")


def _with_inner(
    values: dict[str, Any], read: Callable[[Mapping[str, Any]], Path]
) -> dict[str, Any]:
    """Return the table of a path with the paths that it is made of in place of their tables."""
    result = dict(values)
    if "path" in result:
        result["path"] = read(result["path"])
    if "pieces" in result:
        result["pieces"] = [read(item) for item in result["pieces"]]
    return result


def placed_if_mesh(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the table of an obstacle; meshes are where their own coordinates say, by default."""
    table = dict(values)
    if table.get("shape") == Mesh.shape:
        table.setdefault("position", [0.0, 0.0, 0.0])
    return table


def obstacle(values: Mapping[str, Any], file_beside: Callable[[str], FilePath]) -> Any:
    """Return an obstacle from a table with its pose in any of the ways of `pose_of`."""
    from selfmotion.model.path import pose_of

    table = placed_if_mesh(values)
    keys = [key for key in ("position", *ORIENTATIONS) if key in table]
    try:
        pose = pose_of({key: table.pop(key) for key in keys})
    except ValueError as error:
        raise FileFormatError(f"obstacle '{values.get('name')}': {error}") from error
    if "file" in table:
        # A plan or a problem with this body may be kept in another folder than where it is made.
        table["file"] = str(file_beside(table["file"]).resolve())
    position, rotation = pose.translation.tolist(), pose.rotation.tolist()
    return obstacle_from_dict({**table, "position": position, "rotation": rotation})


def start_of(setting: Any, robot: RobotModel, task: Task) -> Array | None:
    """Return the start configuration (n,) that a file asks for, None for a free one."""
    if setting == "free":
        return None
    if setting == "dexterous":
        return robot.dexterous_configuration(task)
    return robot.home if setting == "home" else robot.configuration(setting)


def _restored(values: Mapping[str, Any]) -> Path:
    """Return a path of tables of numbers, such as a plan's file has; ProblemError for others."""
    try:
        with np.errstate(invalid="raise", over="raise"):
            made_of = {"path", "pieces"} & set(values)
            path: Path = _made(values) if made_of else restore(Path, values)
            path.samples([0.0, 0.5 * path.duration, path.duration])
    except (ArithmeticError, IndexError, TypeError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise ProblemError(f"{values['kind']}: is no path with these numbers: {reason}") from error
    return path


def _made(values: Mapping[str, Any]) -> Path:
    """Return a path that is made of others."""
    options = {key: value for key, value in values.items() if key != "kind"}
    path: Path = Path.kinds()[values["kind"]](**options)
    return path


def _circle(values: dict[str, Any]) -> Path:
    del values["kind"]
    values.setdefault("normal", [0.0, 0.0, 1.0])
    _require_one(values, "center", "radius")
    start = values.pop("start")
    if "center" in values:
        return Circle(start, **values)
    return Circle.around(start, values.pop("radius"), values.pop("duration"), **values)


def _line(values: dict[str, Any]) -> Path:
    del values["kind"]
    _require_one(values, "end", "by")
    start: SE3 = values["start"]
    if "by" in values:
        by = np.asarray(values.pop("by"), dtype=np.float64)
        if by.shape != (3,):
            raise ProblemError(f"by: is {by.tolist()}, expected three numbers [m]")
        values["end"] = start.copy()
        values["end"].translation = start.translation + by
    return Line(**values)


def _require_one(values: Mapping[str, Any], *names: str) -> None:
    present: Sequence[str] = [name for name in names if name in values]
    if len(present) != 1:
        listed = " and ".join(present) or "neither"
        raise ProblemError(f"has {listed}, expected either {' or '.join(names)}")


# Name of its mesh.
NAME = "workpiece"


def placed_table(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return a checked table of a problem with its workpiece where it stands.

    Paths and bodies of the workpiece are in its frame: they become what a file without one says,
    paths with a ``frame``, and bodies among the obstacles of the problem's clearance.

    Raises
    ------
    ProblemError
        A path has no place in it, or its bodies are looked at by nothing.
    """
    placed = dict(table)
    if NAME not in placed:
        return placed
    piece = placed.pop(NAME)
    frame, carrier = piece.get("frame", SE3.Identity()), piece.get("on")
    if carrier is not None and placed["robot"].get("reference") != carrier:
        raise ProblemError(
            f"workpiece: is on '{carrier}', so that paths are in its frame: expected "
            f"robot.reference = '{carrier}'"
        )
    placed["path"] = placed_path(placed["path"], frame)
    if "also" in placed:
        placed["also"] = [_placed_follow(item, frame, carrier) for item in placed["also"]]
    bodies = [placed_body(item, frame, carrier) for item in piece.get("obstacles", [])]
    if "mesh" in piece:
        scale = {"scale": piece["scale"]} if "scale" in piece else {}
        mesh = {"shape": "mesh", "name": NAME, "file": piece["mesh"]}
        bodies.append(placed_body({**mesh, **scale}, frame, carrier))
    elif "scale" in piece:
        raise ProblemError("workpiece: scale has no effect without a mesh")
    return _with_bodies(placed, bodies) if bodies else placed


def placed_path(values: Mapping[str, Any], frame: SE3) -> dict[str, Any]:
    """Return the table of a path that is in a frame, as one in the world."""
    if values["kind"] in ("circle", "line") and "start" not in values:
        raise ProblemError("workpiece: path.start is missing: the tool's first pose in its frame")
    return {**values, "frame": frame * values.get("frame", SE3.Identity())}


def placed_body(values: Mapping[str, Any], frame: SE3, carrier: str | None) -> dict[str, Any]:
    """Return the table of an obstacle that is in a frame, as one in the world or on a link."""
    placed = placed_if_mesh(values)
    keys = [key for key in ("position", *ORIENTATIONS) if key in placed]
    try:
        pose = frame * pose_of({key: placed.pop(key) for key in keys})
    except ValueError as error:
        raise FileFormatError(f"workpiece: obstacle '{values.get('name')}': {error}") from error
    if "frame" in placed:
        raise ProblemError(
            f"workpiece: obstacle '{values.get('name')}' rides on '{placed['frame']}'; what "
            f"belongs to the workpiece moves with it"
        )
    if carrier is not None:
        placed["frame"] = carrier
    rotation = pose.rotation.tolist()
    return {**placed, "position": pose.translation.tolist(), "rotation": rotation}


def _placed_follow(values: Mapping[str, Any], frame: SE3, carrier: str | None) -> dict[str, Any]:
    # What follows in the frame of another link is not where the workpiece is.
    if values.get("reference", carrier) != carrier:
        return dict(values)
    rides = {} if carrier is None else {"reference": carrier}
    if "path" in values:
        return {**values, **rides, "path": placed_path(values["path"], frame)}
    return {**values, **rides, "pose": frame * values["pose"]}


def _with_bodies(table: dict[str, Any], bodies: list[dict[str, Any]]) -> dict[str, Any]:
    """Return a table whose clearance looks at more bodies."""
    # Files of before have it among the constraints.
    constraints = list(table.get("constraints", []))
    for k, item in enumerate(constraints):
        if item["kind"] == "Clearance":
            constraints[k] = {**item, "obstacles": [*item.get("obstacles", []), *bodies]}
            return {**table, "constraints": constraints}
    clearance = table.get("clearance", {})
    if clearance is None:
        raise ProblemError("workpiece: has bodies, but clearance is false; give its distance")
    first, *rest = clearance if isinstance(clearance, list) else [clearance]
    several = [*first.get("obstacles", []), *bodies]
    extended = {"distance": 0.0, **first, "obstacles": several}
    return {**table, "clearance": [extended, *rest] if rest else extended}


def belonging(document: Mapping[str, Any]) -> tuple[str, ...] | None:
    """Return the names of bodies that belong to the workpiece of a document; None without one."""
    piece = document.get(NAME)
    if not isinstance(piece, Mapping):
        return None
    names = [str(item.get("name")) for item in piece.get("obstacles", [])]
    return (*names, *([NAME] if "mesh" in piece else []))


def moved_workpiece(document: Mapping[str, Any], by: SE3) -> dict[str, Any]:
    """Return a document whose workpiece is moved, with all that is in its frame.

    By a rigid motion in the frame in which the workpiece stands. One without a workpiece gets one,
    in which its paths are.
    """
    place = by * standing(document)[0]
    piece = dict(document.get(NAME, {}))
    frame = {"position": place.translation.tolist(), "rotation": place.rotation.tolist()}
    return {**document, NAME: {**piece, "frame": frame}}


def standing(document: Mapping[str, Any]) -> tuple[SE3, str | None]:
    """Return where the workpiece of a document stands that was read before, and on what."""
    piece = document.get(NAME, {})
    frame = in_si(piece).get("frame")
    return SE3.Identity() if frame is None else pose_of(frame), piece.get("on")

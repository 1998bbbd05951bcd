"""What the tables of a problem file describe: tool motions, obstacles, starts."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from selfmotion.basics import (
    Array,
    FileFormatError,
    ProblemError,
    restore,
)
from selfmotion.cam import read_path
from selfmotion.collision import Mesh, obstacle_from_dict
from selfmotion.path import (
    ORIENTATIONS,
    Circle,
    Feed,
    Line,
    Path,
    Placed,
    Spiral,
    Weave,
    with_leads,
)
from selfmotion.robot import RobotModel
from selfmotion.task import Task

if TYPE_CHECKING:
    from selfmotion.task import SE3

# Tool motions that may begin where the arm does, and have a feed.
_SHAPES = ("circle", "line", "spiral")
# What bounds a feed in tables of tool motions.
FEED_BOUNDS = ("turn_rate", "acceleration", "turn_acceleration", "smoothing", "within")


def path_of(
    given: Mapping[str, Any],
    robot: RobotModel,
    start: Array | None,
    beside: Callable[[str], FilePath],
) -> Path:
    """Return the tool motion of a problem file; files that it names are looked for `beside` it."""
    values = dict(given)
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
        _exactly_one({**values, "feed": feed} if feed else values, "duration", "feed")
        # At a feed, the shape's own pace does not matter.
        values.setdefault("duration", 1.0)
    match kind:
        case "file":
            del values["kind"]
            path: Path = read_path(beside(values.pop("file")), **values)
        case "circle":
            path = _circle(values)
        case "line":
            path = _line(values)
        case "spiral":
            path = Spiral(**{key: value for key, value in values.items() if key != "kind"})
        case _:
            inner = partial(path_of, robot=robot, start=start, beside=beside)
            path = _restored(_with_inner(values, inner))
    path = path if feed is None else Feed(path, feed, **bounds)
    notes = path.notes
    path = path if weave is None else woven(path, weave)
    path = path if leads is None else led(path, leads)
    return (path if frame is None else Placed(path, frame)).noted(notes)


def led(path: Path, values: Mapping[str, Any]) -> Path:
    """Return a path with a lead-in and a lead-out, as a file says it."""
    _check_keys(values, "leads", ("length", "duration"), ("axis",))
    return with_leads(path, **values)


def woven(path: Path, values: Mapping[str, Any]) -> Path:
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
    found = dict(values)
    if "path" in found:
        found["path"] = read(found["path"])
    if "pieces" in found:
        found["pieces"] = [read(item) for item in found["pieces"]]
    return found


def placed_if_mesh(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the table of an obstacle; meshes are where their own coordinates say, by default."""
    given = dict(values)
    if given.get("shape") == Mesh.shape:
        given.setdefault("position", [0.0, 0.0, 0.0])
    return given


def obstacle(values: Mapping[str, Any], beside: Callable[[str], FilePath]) -> Any:
    """Return an obstacle from a table with its pose in any of the ways of `pose_of`."""
    from selfmotion.path import pose_of

    given = placed_if_mesh(values)
    keys = [key for key in ("position", *ORIENTATIONS) if key in given]
    try:
        pose = pose_of({key: given.pop(key) for key in keys})
    except ValueError as error:
        raise FileFormatError(f"obstacle '{values.get('name')}': {error}") from error
    if "file" in given:
        # A plan or a problem with this body may be kept in another folder than where it is made.
        given["file"] = str(beside(given["file"]).resolve())
    position, rotation = pose.translation.tolist(), pose.rotation.tolist()
    return obstacle_from_dict({**given, "position": position, "rotation": rotation})


def start_of(given: Any, robot: RobotModel, task: Task) -> Array | None:
    """Return the start configuration (n,) that a file asks for, None for a free one."""
    if given == "free":
        return None
    if given == "dexterous":
        return robot.dexterous_configuration(task)
    return robot.home if given == "home" else robot.configuration(given)


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
    given = {key: value for key, value in values.items() if key != "kind"}
    path: Path = Path.kinds()[values["kind"]](**given)
    return path


def _circle(values: dict[str, Any]) -> Path:
    del values["kind"]
    values.setdefault("normal", [0.0, 0.0, 1.0])
    _exactly_one(values, "center", "radius")
    start = values.pop("start")
    if "center" in values:
        return Circle(start, **values)
    return Circle.around(start, values.pop("radius"), values.pop("duration"), **values)


def _line(values: dict[str, Any]) -> Path:
    del values["kind"]
    _exactly_one(values, "end", "by")
    start: SE3 = values["start"]
    if "by" in values:
        by = np.asarray(values.pop("by"), dtype=np.float64)
        if by.shape != (3,):
            raise ProblemError(f"by: is {by.tolist()}, expected three numbers [m]")
        values["end"] = start.copy()
        values["end"].translation = start.translation + by
    return Line(**values)


def _exactly_one(values: Mapping[str, Any], *names: str) -> None:
    given: Sequence[str] = [name for name in names if name in values]
    if len(given) != 1:
        found = " and ".join(given) or "neither"
        raise ProblemError(f"has {found}, expected either {' or '.join(names)}")

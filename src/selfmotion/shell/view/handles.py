"""What of a document can be dragged: the part, the arm's base, waypoints, obstacles, the tool."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from selfmotion.basics import ProblemError
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3
from selfmotion.problem.problem import Problem
from selfmotion.shell.replay import GHOST, ROBOT, Json, joint_name, safe
from selfmotion.shell.view.document import Keys, at, is_job
from selfmotion.shell.view.poses import read_pose, rounded_position, write_pose

# Of more waypoints none is dragged: they would hide the path.
_MAX_WAYPOINTS = 40
# A pose as near as this to the one before is the same [m].
_SAME = 1e-7
# Tool motions that begin where the arm does, unless they say where.
_SHAPES = ("circle", "line", "spiral")
# The node of the page below which the plan is drawn.
PLAN = "/selfmotion/plan0"
_PATH_NODES = (f"{PLAN}/tip0",)


@dataclass(frozen=True, eq=False)
class Handle:
    """Something that can be dragged.

    Attributes
    ----------
    name : str
        As the page and its user call it.
    kind : {"part", "path", "base", "waypoint", "obstacle", "tool"}
    keys : tuple
        The way to its pose in the document; of a waypoint to its position.
    joint : int
        The moving joint that carries it, -1 for none.
    prefix : SE3
        Where the pose of the document is counted from, in that joint's frame.
    pose : SE3
        The pose of the document.
    nodes : tuple of str
        Nodes of the page that go along while it is dragged.
    moves, turns : bool
        Whether it can be moved, and turned.
    """

    name: str
    kind: str
    keys: Keys
    joint: int
    prefix: SE3
    pose: SE3
    nodes: tuple[str, ...] = ()
    moves: bool = True
    turns: bool = True

    def json(self, robot: RobotModel) -> Json:
        """Return what the page has to know."""
        node = "" if self.joint < 0 else f"{ROBOT}/{joint_name(robot, self.joint)}"
        return {
            "name": self.name,
            "kind": self.kind,
            "node": node,
            "matrix": (self.prefix * self.pose).homogeneous.T.ravel().tolist(),
            "nodes": list(self.nodes),
            "moves": self.moves,
            "turns": self.turns,
        }


def handles_of(document: Mapping[str, Any], problem: Problem) -> dict[str, Handle]:
    """Return what can be dragged by name; of no document nothing."""
    if not document:
        return {}
    found = [
        *(_of_seams if is_job(document) else _of_problem)(document, problem),
        *_of_bases(document),
        *_of_obstacles(document, problem),
        *_of_tool(document, problem.robot),
    ]
    # A body may be called as anything else is, the part or the base.
    taken = {handle.name for handle in found if handle.kind != "obstacle"}
    named: dict[str, Handle] = {}
    for handle in found:
        name = handle.name
        while handle.kind == "obstacle" and (name in taken or name in named):
            name = f"obstacle {name}"
        named[name] = replace(handle, name=name)
    return named


def dragged(document: Mapping[str, Any], handle: Handle, shown: SE3) -> dict[Keys, Any]:
    """Return the values of a document after a handle was dragged to a pose, as the page has it.

    A start that is given does not fit a path that is elsewhere: it becomes free.
    """
    pose = handle.prefix.inverse() * shown
    if np.abs(pose.homogeneous - handle.pose.homogeneous).max() < _SAME:
        return {}
    match handle.kind:
        case "waypoint":
            values: dict[Keys, Any] = {
                handle.keys: rounded_position(pose.translation, str(handle.keys[-2]))
            }
        case "path":
            values = _moved_shape(document, handle, pose)
        case _:
            values = {handle.keys: write_pose(at(document, handle.keys), pose)}
    if is_job(document):
        # A job says itself where it starts, and seams begin anywhere.
        return values
    # A shape without a start begins wherever the tool is.
    follows_arm = "start" not in document["path"] and document["path"].get("kind") in _SHAPES
    freed = handle.kind in ("part", "path") or (handle.kind == "waypoint" and handle.keys[-1] == 0)
    freed = freed or (handle.kind in ("base", "tool") and not follows_arm)
    if freed and document.get("start", "free") != "free":
        values["start",] = "free"
    return values


def _path_prefix(document: Mapping[str, Any], problem: Problem) -> tuple[int, SE3]:
    """Return the joint that carries the path, and where world axes of the file are in its frame."""
    chain = problem.follows.items[0].chain
    return chain.carrier, SE3(chain.base_placement)


def _of_problem(document: Mapping[str, Any], problem: Problem) -> Iterator[Handle]:
    """Return the handles of the part, else of the path, and of its waypoints."""
    joint, prefix = _path_prefix(document, problem)
    path = document["path"]
    yield from _of_part(document, joint, prefix)
    is_free = "workpiece" not in document
    prefix = prefix * _frame_of_part(document)
    if is_free and ("frame" in path or path.get("kind") not in _SHAPES):
        frame = read_pose(path.get("frame"))
        yield Handle("part", "part", ("path", "frame"), joint, prefix, frame, _PATH_NODES)
    elif is_free:
        start = problem.path.samples([0.0])
        pose = SE3(start.rotation[0], start.translation[0])
        yield Handle("path", "path", ("path", "start"), joint, prefix, pose, _PATH_NODES)
    yield from _of_waypoints(path, ("path",), "", joint, prefix)


def _of_seams(document: Mapping[str, Any], problem: Problem) -> Iterator[Handle]:
    """Return the handles of the part, else of all seams or of each, and of their waypoints."""
    joint, prefix = _path_prefix(document, problem)
    yield from _of_part(document, joint, prefix)
    is_free = "workpiece" not in document
    prefix = prefix * _frame_of_part(document)
    seams = document.get("seams")
    if isinstance(seams, Mapping):
        if is_free:
            frame = read_pose(seams.get("frame"))
            yield Handle("part", "part", ("seams", "frame"), joint, prefix, frame, _PATH_NODES)
        return
    if not isinstance(seams, list):
        return
    for k, seam in enumerate(seams):
        path, name, keys = seam["path"], str(seam["name"]), ("seams", k, "path")
        if is_free and len(seams) <= _MAX_WAYPOINTS:
            is_shape = path.get("kind") in _SHAPES and "frame" not in path
            key = "start" if is_shape else "frame"
            if not is_shape or "start" in path:
                kind, pose = ("path" if is_shape else "part"), read_pose(path.get(key))
                yield Handle(name, kind, (*keys, key), joint, prefix, pose)
        yield from _of_waypoints(path, keys, f"{name}, ", joint, prefix)


def _frame_of_part(document: Mapping[str, Any]) -> SE3:
    return read_pose(document.get("workpiece", {}).get("frame"))


def _of_part(document: Mapping[str, Any], joint: int, prefix: SE3) -> Iterator[Handle]:
    piece = document.get("workpiece")
    if piece is not None:
        own = [f"{PLAN}/obstacles/{safe(item['name'])}" for item in _bodies(piece)]
        nodes = (*_PATH_NODES, *own, f"{PLAN}/obstacles/workpiece")
        frame = _frame_of_part(document)
        yield Handle("part", "part", ("workpiece", "frame"), joint, prefix, frame, nodes)


def _of_waypoints(
    path: Mapping[str, Any], keys: Keys, of: str, joint: int, prefix: SE3
) -> Iterator[Handle]:
    if path.get("kind") != "waypoints":
        return
    if "frame" in path:
        prefix = prefix * read_pose(path["frame"])
    key = "positions_mm" if "positions_mm" in path else "positions"
    points = np.array(path.get(key, []), dtype=np.float64) * (1e-3 if key != "positions" else 1.0)
    if points.ndim != 2 or len(points) > _MAX_WAYPOINTS:
        return
    for k, point in enumerate(points):
        pose, own = SE3(np.eye(3), point), (*keys, key, k)
        yield Handle(f"{of}waypoint {k + 1}", "waypoint", own, joint, prefix, pose, turns=False)


def _moved_shape(document: Mapping[str, Any], handle: Handle, pose: SE3) -> dict[Keys, Any]:
    """Return a shape that begins at a pose: its other points go along, its tool turns."""
    keys = handle.keys[:-1]
    path = at(document, keys)
    values: dict[Keys, Any] = {handle.keys: write_pose(path.get("start"), pose)}
    # Of a drag that goes on the document has moved, whatever was planned by then.
    before = handle.pose if "start" not in path else read_pose(path["start"])
    by = pose.translation - before.translation
    for key in ("center", "center_mm"):
        if key in path:
            scale = 1e-3 if key.endswith("_mm") else 1.0
            values[(*keys, key)] = rounded_position(
                scale * np.array(path[key], dtype=np.float64) + by, key
            )
    if "end" in path:
        end = read_pose(path["end"])
        turn = before.rotation.T @ pose.rotation
        values[(*keys, "end")] = write_pose(
            path["end"], SE3(end.rotation @ turn, end.translation + by)
        )
    return values


def _of_bases(document: Mapping[str, Any]) -> Iterator[Handle]:
    robot = document["robot"]
    parts = robot.get("parts")
    if parts is None:
        pose = read_pose(robot.get("base"))
        yield Handle("base", "base", ("robot", "base"), -1, SE3.Identity(), pose, (ROBOT, GHOST))
        return
    for name, part in parts.items():
        if "on" not in part:
            keys: Keys = ("robot", "parts", name, "base")
            pose = read_pose(part.get("base"))
            yield Handle(f"base of {name}", "base", keys, -1, SE3.Identity(), pose)


def _bodies(table: Any) -> list[Any]:
    return list(table.get("obstacles", [])) if isinstance(table, Mapping) else []


def _of_obstacles(document: Mapping[str, Any], problem: Problem) -> Iterator[Handle]:
    robot = problem.robot
    given = document.get("clearance")
    places: list[Keys] = [("clearance",)]
    if isinstance(given, list):
        places = [("clearance", k) for k in range(len(given))]
    places += [
        ("constraints", k)
        for k, item in enumerate(document.get("constraints", []))
        if item.get("kind") == "Clearance"
    ]
    for keys in places:
        for k, item in enumerate(_bodies(at(document, keys))):
            joint, prefix = _carried(robot, item.get("frame"))
            yield _obstacle((*keys, "obstacles", k), item, joint, prefix)
    piece = document.get("workpiece", {})
    joint, prefix = _carried(robot, piece.get("on"))
    prefix = prefix * read_pose(piece.get("frame"))
    for k, item in enumerate(_bodies(piece)):
        yield _obstacle(("workpiece", "obstacles", k), item, joint, prefix)


def _obstacle(keys: Keys, item: Mapping[str, Any], joint: int, prefix: SE3) -> Handle:
    name = str(item["name"])
    nodes = (f"{PLAN}/obstacles/{safe(name)}",)
    return Handle(name, "obstacle", keys, joint, prefix, read_pose(item), nodes)


def _carried(robot: RobotModel, link: str | None) -> tuple[int, SE3]:
    if link is None:
        return -1, SE3.Identity()
    joint, place = robot.carrier_of(link)
    return joint - 1, SE3(place)


def _of_tool(document: Mapping[str, Any], robot: RobotModel) -> Iterator[Handle]:
    """Return the handle that turns the tool where it is mounted."""
    if not isinstance(document["robot"].get("tool", ""), str):
        return
    offset = read_pose(document["robot"].get("tool_offset"))
    try:
        joint, place = _carried(robot, robot.tool)
    except ProblemError:
        return
    keys: Keys = ("robot", "tool_offset")
    prefix = place * offset.inverse()
    yield Handle("tool", "tool", keys, joint, prefix, offset, moves=False)

"""A workpiece in a file: a frame, and the paths and bodies that are placed with it."""

from collections.abc import Mapping
from typing import Any

from selfmotion.basics import FileFormatError, ProblemError, in_si
from selfmotion.documents.problem_parts import placed_if_mesh
from selfmotion.path import ORIENTATIONS, pose_of
from selfmotion.task import SE3

# What its mesh is called.
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
    found = dict(table)
    if NAME not in found:
        return found
    piece = found.pop(NAME)
    frame, carrier = piece.get("frame", SE3.Identity()), piece.get("on")
    if carrier is not None and found["robot"].get("reference") != carrier:
        raise ProblemError(
            f"workpiece: is on '{carrier}', so that paths are in its frame: expected "
            f"robot.reference = '{carrier}'"
        )
    found["path"] = placed_path(found["path"], frame)
    if "also" in found:
        found["also"] = [_placed_follow(item, frame, carrier) for item in found["also"]]
    bodies = [placed_body(item, frame, carrier) for item in piece.get("obstacles", [])]
    if "mesh" in piece:
        scale = {"scale": piece["scale"]} if "scale" in piece else {}
        mesh = {"shape": "mesh", "name": NAME, "file": piece["mesh"]}
        bodies.append(placed_body({**mesh, **scale}, frame, carrier))
    elif "scale" in piece:
        raise ProblemError("workpiece: scale has no effect without a mesh")
    return _with_bodies(found, bodies) if bodies else found


def placed_path(values: Mapping[str, Any], frame: SE3) -> dict[str, Any]:
    """Return the table of a path that is in a frame, as one in the world."""
    if values["kind"] in ("circle", "line") and "start" not in values:
        raise ProblemError("workpiece: path.start is missing: the tool's first pose in its frame")
    return {**values, "frame": frame * values.get("frame", SE3.Identity())}


def placed_body(values: Mapping[str, Any], frame: SE3, carrier: str | None) -> dict[str, Any]:
    """Return the table of an obstacle that is in a frame, as one in the world or on a link."""
    found = placed_if_mesh(values)
    keys = [key for key in ("position", *ORIENTATIONS) if key in found]
    try:
        pose = frame * pose_of({key: found.pop(key) for key in keys})
    except ValueError as error:
        raise FileFormatError(f"workpiece: obstacle '{values.get('name')}': {error}") from error
    if "frame" in found:
        raise ProblemError(
            f"workpiece: obstacle '{values.get('name')}' rides on '{found['frame']}'; what belongs "
            f"to the workpiece moves with it"
        )
    if carrier is not None:
        found["frame"] = carrier
    rotation = pose.rotation.tolist()
    return {**found, "position": pose.translation.tolist(), "rotation": rotation}


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
    constraints = list(table.get("constraints", []))
    for k, item in enumerate(constraints):
        if item["kind"] == "Clearance":
            constraints[k] = {**item, "obstacles": [*item.get("obstacles", []), *bodies]}
            return {**table, "constraints": constraints}
    clearance = table.get("clearance", {})
    if clearance is None:
        raise ProblemError(
            "workpiece: has bodies, but clearance is false, and no constraint is a Clearance"
        )
    several = [*clearance.get("obstacles", []), *bodies]
    return {**table, "clearance": {"distance": 0.0, **clearance, "obstacles": several}}


def standing(document: Mapping[str, Any]) -> tuple[SE3, str | None]:
    """Return where the workpiece of a document stands that was read before, and on what."""
    piece = document.get(NAME, {})
    frame = in_si(piece).get("frame")
    return SE3.Identity() if frame is None else pose_of(frame), piece.get("on")

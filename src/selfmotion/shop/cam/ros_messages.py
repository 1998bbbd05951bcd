"""Poses in messages of ROS, as YAML or JSON: nav_msgs/Path and geometry_msgs/PoseArray."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from selfmotion.basics import FileFormatError
from selfmotion.shop.cam.pose_rows import PoseRows

# Names of a list of messages.
_LISTS = ("paths", "rasters", "pose_arrays")


def poses_of_messages(file: FilePath, document: Any) -> dict[str, PoseRows]:
    """Return the poses of a message, or of each of several ones (rasters) as a seam.

    Raises
    ------
    FileFormatError
        The document has no message with poses, or they are in several frames.
    """
    # Rasters of rasters are one list of strokes, and so are jobs of them.
    messages = list(_messages(document if isinstance(document, list) else [document]))
    if not messages:
        raise FileFormatError(
            f"{file}: holds no message with poses, expected a nav_msgs/Path or "
            f"geometry_msgs/PoseArray, or a list of these"
        )
    notes = _frame_notes(file, messages)
    if len(messages) == 1:
        return {"": replace(_of_message(file, messages[0], ""), notes=notes)}
    return {
        f"seam {number}": replace(_of_message(file, message, f"[{number - 1}]."), notes=notes)
        for number, message in enumerate(messages, 1)
    }


def _frame_notes(file: FilePath, messages: Sequence[Any]) -> tuple[str, ...]:
    """Return a note of the frame that messages name, which is not looked up.

    Raises
    ------
    FileFormatError
        Poses are in different frames: where these are to each other is not known.
    """
    frames: dict[str, None] = {}
    for message in messages:
        poses = message.get("poses") if isinstance(message, Mapping) else None
        for item in (message, *(poses if isinstance(poses, list) else ())):
            header = item.get("header") if isinstance(item, Mapping) else None
            name = header.get("frame_id") if isinstance(header, Mapping) else None
            # An empty one is that of the message.
            if isinstance(name, str) and name.strip("/ "):
                frames.setdefault(name.strip("/ "))
    if len(frames) > 1:
        first, second, *_ = frames
        raise FileFormatError(
            f"{file}: has poses in frame '{first}' and in '{second}', expected one: transform them "
            f"into the same, whose place is told by a frame (--frame)"
        )
    if not frames:
        return ("ROS: poses in metres, in no frame that is named",)
    return tuple(
        f"ROS: poses in metres in frame '{name}', which is taken for the root of the arm, or for "
        f"what frame (--frame) says"
        for name in frames
    )


def _messages(items: Sequence[Any]) -> Iterator[Any]:
    for item in items:
        keys = _LISTS if isinstance(item, Mapping) else ()
        listed = next((item[key] for key in keys if isinstance(item.get(key), list)), None)
        if listed is not None:
            yield from _messages(listed)
        elif isinstance(item, list) and item and not _is_pose(item[0]):
            yield from _messages(item)
        else:
            yield {"poses": item} if isinstance(item, list) else item


def _is_pose(item: Any) -> bool:
    return isinstance(item, Mapping) and ("position" in item or "pose" in item)


def _of_message(file: FilePath, message: Any, where: str) -> PoseRows:
    poses = message.get("poses") if isinstance(message, Mapping) else None
    if not isinstance(poses, list) or not poses:
        raise FileFormatError(
            f"{file}: {where and f'{where[:-1]} '}has no list of poses, expected a nav_msgs/Path "
            f"or geometry_msgs/PoseArray, or poses in a list or by names (waypoints), each with "
            f"position and orientation or x, y, z"
        )
    labels = [f"{where}poses[{k}]" for k in range(len(poses))]
    rows = [_ros_pose(file, label, pose) for label, pose in zip(labels, poses, strict=True)]
    stamps = [_stamp(file, label, pose) for label, pose in zip(labels, poses, strict=True)]
    # Publishers that know no times leave all stamps at the same one.
    t = None if len(set(stamps)) == 1 else np.array(stamps, dtype=np.float64) - (stamps[0] or 0.0)
    table = np.array(rows)
    return PoseRows(labels, table[:, :3], "quaternion", table[:, 3:], t)


def _ros_pose(file: FilePath, label: str, given: Any) -> list[float]:
    pose = given.get("pose", given) if isinstance(given, Mapping) else given
    found = []
    for part, keys in (("position", "xyz"), ("orientation", "wxyz")):
        for key in keys:
            try:
                found.append(float(pose[part][key]))
            except (KeyError, OverflowError, TypeError, ValueError):
                raise FileFormatError(
                    f"{file}: {label}: {part}.{key} is missing or no number"
                ) from None
    return found


def _stamp(file: FilePath, label: str, given: Mapping[str, Any]) -> float | None:
    header = given.get("header")
    if header is None:
        return None
    try:
        return 1e-9 * nanoseconds(header["stamp"])
    except (KeyError, OverflowError, TypeError, ValueError):
        raise FileFormatError(
            f"{file}: {label}: header.stamp is incomplete, expected sec and nanosec (ROS 1: secs "
            f"and nsecs)"
        ) from None


def nanoseconds(stamp: Mapping[str, Any]) -> int:
    """Return a time of ROS 2, or of ROS 1, whose names differ [ns]; KeyError for what is none."""
    seconds, rest = ("secs", "nsecs") if "secs" in stamp else ("sec", "nanosec")
    return int(stamp[seconds]) * 1_000_000_000 + int(stamp[rest])

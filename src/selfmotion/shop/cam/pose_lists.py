"""Poses in lists, by names or in messages of ROS, as YAML and JSON files of robots have them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from selfmotion.basics import FileFormatError, is_number, read_values, shown
from selfmotion.shop.cam.column_names import column_name
from selfmotion.shop.cam.peers import compas_poses
from selfmotion.shop.cam.pose_arrays import MATRIX_NOTE
from selfmotion.shop.cam.pose_columns import rows_of_table
from selfmotion.shop.cam.pose_rows import PoseRows
from selfmotion.shop.cam.ros_messages import poses_of_messages

# Names of lists of poses.
_LISTS = ("poses", "waypoints", "points", "frames", "targets", "path")
# Table with the parameters of a ROS 2 node.
_PARAMETERS = "ros__parameters"
# Largest depth of tables around the poses.
_DEEPEST = 5
# Names of quaternions, whose order in a list is not known.
_QUATERNIONS = ("orientation", "quaternion", "quat")
# Names of angles.
_ANGLES = ("rpy", "euler")
# Names of lists of numbers → the names of these in order.
_ORDERS = {
    **dict.fromkeys(("position", "pos", "translation", "xyz"), ("x", "y", "z")),
    **dict.fromkeys(_ANGLES, ("roll", "pitch", "yaw")),
}
_TABLES = ("position", "pos", "translation", *_QUATERNIONS, *_ANGLES)
# Largest number of keys that a note names.
_MAX_LISTED = 6
# Keys that move nothing.
_NAMES = frozenset(
    ("name", "label", "id", "index", "header", "stamp", "time_stamp", "frame_id", "child_frame_id")
) | frozenset(("comment", "comments", "description", "note", "author", "date", "version"))
# Keys that may say where or how large poses are, which is not read.
_MOVING = re.compile(r"units?|scale|offset|origin|transform|base|tool|tcp|frame|relative")


def read_poses(file: FilePath) -> Mapping[str, PoseRows]:
    """Return the poses of a message of ROS, or of a list or table of poses; see `read_path`.

    Raises
    ------
    FileFormatError
        The file cannot be read, holds no poses, or a pose lacks something; it is named.
    """
    document = read_values(file)
    peers = compas_poses(file, document)
    if peers is not None:
        return peers
    beside = dict[str, Any]()
    found = _poses_in(document, beside)
    if found is None:
        return poses_of_messages(file, document)
    notes = _passed_over(file, "beside the poses", beside)
    labels, items = [label for label, _ in found], [item for _, item in found]
    if all(_is_matrix(item) for item in items):
        matrices = np.array([[[_number(file, label, value) for value in row] for row in item]
                             for label, item in found])  # fmt: skip
        rows = PoseRows(labels, matrices[:, :3, 3], "rotation", matrices[:, :3, :3], None)
        return {"": replace(rows, notes=(MATRIX_NOTE, *notes))}
    for label, item in found:
        if not isinstance(item, Mapping):
            raise FileFormatError(f"{file}: {label}: is a matrix among poses of another form")
        inner = item.get("pose")
        unread = [_unread(item), _unread(inner) if isinstance(inner, Mapping) else {}]
        notes += _passed_over(
            file, label, {key: item for each in unread for key, item in each.items()}
        )
        notes += _angles_beside(label, item)
    flat = [dict(_numbers_of(file, label, item)) for label, item in found]
    for label, row in zip(labels, flat, strict=True):
        if set(row) != set(flat[0]):
            odd = sorted(set(row) ^ set(flat[0]))[0]
            raise FileFormatError(
                f"{file}: {label}: '{odd}' is in some poses only, expected the same of all"
            )
    header = list(flat[0])
    table = np.array([[row[name] for name in header] for row in flat])
    rows = rows_of_table(file, header, table, labels, {})
    # A note on keys that every pose has names the first pose.
    first = {note.partition(": ")[2]: note for note in reversed(notes)}
    return {"": replace(rows, notes=(*rows.notes, *reversed(first.values())))}


def _angles_beside(label: str, item: Mapping[str, Any]) -> tuple[str, ...]:
    """Return a note of angles that stand beside a quaternion, which is what is read."""
    inner = item.get("pose")
    given = {*item, *(inner if isinstance(inner, Mapping) else ())}
    angles, turns = given.intersection(_ANGLES), given.intersection(_QUATERNIONS)
    if not (angles and turns):
        return ()
    return (f"{label}: '{min(angles)}' is passed over beside '{min(turns)}'",)


def _unread(item: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a pose that are neither numbers nor lists that are read."""
    return {
        key: value
        for key, value in item.items()
        if key != "pose"
        and not isinstance(value, list)
        and not is_number(value)
        and not (isinstance(value, Mapping) and key in _TABLES)
    }


def _passed_over(file: FilePath, where: str, values: Mapping[str, Any]) -> tuple[str, ...]:
    """Return a note of keys that are not read.

    Raises
    ------
    FileFormatError
        One of them says where or how large poses are.
    """
    for key, value in values.items():
        if key not in _NAMES and _MOVING.search(str(key).lower()):
            raise FileFormatError(
                f"{file}: {where}: '{key}' is {shown(value)}, which may move the poses and is not "
                f"read: write them in metres and in one frame (columns x_mm, …; --frame), and drop "
                f"it"
            )
    others = [f"'{key}'" for key in values if key not in _NAMES]
    return (f"{where}: passed over: {', '.join(others[:_MAX_LISTED])}",) if others else ()


def _poses_in(document: Any, beside: dict[str, Any]) -> list[tuple[str, Any]] | None:
    """Return poses by what they are called, None where they are messages or there are none.

    What stands beside their list is put into `beside`.
    """
    inner, key = document, ""
    for _ in range(_DEEPEST):
        if not isinstance(inner, Mapping) or "header" in inner or _are_poses(inner.values()):
            break
        keys = [name for name in (_PARAMETERS, *_LISTS) if isinstance(inner.get(name), dict | list)]
        keys = keys or (list(inner) if len(inner) == 1 else [])
        if not keys:
            break
        beside |= {str(name): value for name, value in inner.items() if name != keys[0]}
        key, inner = str(keys[0]), inner[keys[0]]
    if isinstance(inner, Mapping) and _are_poses(inner.values()):
        return [(f"'{name}'", item) for name, item in inner.items()]
    is_message = key in ("", "poses") and isinstance(inner, list) and all(map(_is_of_ros, inner))
    if isinstance(inner, list) and _are_poses(inner) and not is_message:
        return [(f"{key}[{k}]", item) for k, item in enumerate(inner)]
    return None


def _are_poses(items: Any) -> bool:
    several = list(items)
    return bool(several) and all(_is_pose(item) for item in several)


def _is_pose(item: Any) -> bool:
    if not isinstance(item, Mapping):
        return _is_matrix(item)
    inner = item.get("pose", item)
    has_place = isinstance(inner, Mapping) and bool({*_ORDERS, "x", "x_mm"} & set(inner))
    return has_place and "poses" not in item


def _is_of_ros(item: Any) -> bool:
    """Whether an item is a Pose or PoseStamped, which messages have lists of."""
    inner = item.get("pose", item) if isinstance(item, Mapping) else None
    return isinstance(inner, Mapping) and isinstance(inner.get("position"), Mapping)


def _is_matrix(item: Any) -> bool:
    rows = item if isinstance(item, list) and len(item) == 4 else []
    return bool(rows) and all(
        isinstance(row, list) and len(row) == 4 and all(map(is_number, row)) for row in rows
    )


def _numbers_of(file: FilePath, label: str, item: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a pose by what columns of a table are called.

    Texts are passed over, and tables of anything else, such as joints, with a note; of two
    orientations the quaternion is taken.
    """
    turned = any(key in item for key in _QUATERNIONS)
    for key, value in item.items():
        if key == "pose" and isinstance(value, Mapping):
            yield from _numbers_of(file, label, value)
        elif turned and key in _ANGLES:
            continue
        elif isinstance(value, Mapping):
            stem = "" if key in _ANGLES else f"{key}."
            for name, number in value.items() if key in _TABLES else ():
                yield column_name(f"{stem}{name}"), _number(file, f"{label}: {key}.{name}", number)
        elif isinstance(value, list):
            yield from _listed(file, f"{label}: {key}", str(key), value)
        elif is_number(value):
            yield column_name(str(key)), _number(file, f"{label}: {key}", value)


def _listed(
    file: FilePath, where: str, key: str, value: Sequence[Any]
) -> Iterator[tuple[str, float]]:
    names = _ORDERS.get(key)
    if names is None or len(value) != len(names):
        raise FileFormatError(
            f"{file}: {where} is a list of {len(value)}, whose order is not known; expected "
            f"numbers by name, such as x, y, z and qw, qx, qy, qz, or lists of 3: position, rpy"
        )
    for name, number in zip(names, value, strict=True):
        yield name, _number(file, f"{where}.{name}", number)


def _number(file: FilePath, where: str, value: Any) -> float:
    try:
        if is_number(value):
            return float(value)
    except OverflowError:
        pass
    raise FileFormatError(f"{file}: {where} is {shown(value)}, expected a number")

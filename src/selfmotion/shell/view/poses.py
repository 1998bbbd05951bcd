"""Poses of a document, read and written again in its own units and kind of orientation."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from selfmotion.basics import Array, in_si
from selfmotion.model.path import ORIENTATIONS, pose_of
from selfmotion.model.task import SE3

# Decimal places of dragged poses: a hundredth of a millimetre and a microradian, as nobody's hand
# is steadier; as many significant digits of degrees.
_DIGITS, _TURN_DIGITS, _DEGREE_DIGITS = 5, 6, 4
# Rotations below this are rounding [rad].
_SAME = 1e-9
_MM = 1e3


def read_pose(value: Any) -> SE3:
    """Return the pose of a table, or of a 4 × 4 matrix, of a document; the identity for None."""
    if value is None:
        return SE3.Identity()
    if isinstance(value, Mapping):
        table = in_si({key: value[key] for key in value if _is_of_pose(key)})
        return pose_of(table)
    return pose_of(value)


def write_pose(value: Any, pose: SE3) -> dict[str, Any]:
    """Return the table of a new pose, in place of a document's `value` (None: for the first time).

    Keys that are not of a pose are kept, and so is an orientation that has not changed.
    """
    table = dict(value) if isinstance(value, Mapping) else {}
    before = read_pose(value)
    key = "position_mm" if "position_mm" in table else "position"
    table[key] = rounded_position(pose.translation, key)
    is_same = np.linalg.norm(pin.log3(before.rotation.T @ pose.rotation)) < _SAME
    if not (is_same and isinstance(value, Mapping)):
        in_degrees = any(name.endswith("_deg") for name in table if _is_of_pose(name))
        table = {k: item for k, item in table.items() if k == key or not _is_of_pose(k)}
        angles = pin.rpy.matrixToRpy(pose.rotation)
        if np.any(np.abs(angles) > 0.0):
            name = "rpy_deg" if in_degrees or value is None else "rpy"
            table[name] = _rounded_angles(angles, name)
    return table


def rounded_position(point: Array, key: str) -> list[float]:
    """Return a position [m] as a key writes it, in metres or millimetres."""
    scale, digits = (_MM, _DIGITS - 3) if key.endswith("_mm") else (1.0, _DIGITS)
    return [round(float(scale * x), digits) + 0.0 for x in point]


def _rounded_angles(angles: Array, key: str) -> list[float]:
    """Return angles [rad] as a key writes them, in radians or degrees."""
    if key.endswith("_deg"):
        return [round(float(np.degrees(x)), _DEGREE_DIGITS) + 0.0 for x in angles]
    return [round(float(x), _TURN_DIGITS) + 0.0 for x in angles]


def _is_of_pose(key: str) -> bool:
    """Whether a key of a table is its position or its orientation."""
    return key.removesuffix("_mm").removesuffix("_deg") in ("position", *ORIENTATIONS)

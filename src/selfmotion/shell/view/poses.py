"""Poses as a document writes them, moved: in the units and the way of speaking that it has."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from selfmotion.basics import Array, in_si
from selfmotion.model.path import ORIENTATIONS, pose_of
from selfmotion.model.task import SE3

# What is dragged is written to a hundredth of a millimetre and to a microradian: nobody's hand is
# steadier. Angles in degrees have as many digits.
_DIGITS, _TURN_DIGITS, _DEGREE_DIGITS = 5, 6, 4
# Turns below this are none [rad].
_SAME = 1e-9
_MM = 1e3


def read_pose(value: Any) -> SE3:
    """Return the pose that a document writes: a table, or a 4 × 4 matrix; of None the identity."""
    if value is None:
        return SE3.Identity()
    if isinstance(value, Mapping):
        table = in_si({key: value[key] for key in value if _names(key)})
        return pose_of(table)
    return pose_of(value)


def write_pose(value: Any, pose: SE3) -> dict[str, Any]:
    """Return what a document writes in place of a pose (of None: for the first time).

    Keys that say nothing of a pose are kept, and its orientation is where it is the same.
    """
    given = dict(value) if isinstance(value, Mapping) else {}
    before = read_pose(value)
    key = "position_mm" if "position_mm" in given else "position"
    given[key] = rounded(pose.translation, key)
    same = np.linalg.norm(pin.log3(before.rotation.T @ pose.rotation)) < _SAME
    if not (same and isinstance(value, Mapping)):
        degrees = any(name.endswith("_deg") for name in given if _names(name))
        given = {name: item for name, item in given.items() if name == key or not _names(name)}
        angles = pin.rpy.matrixToRpy(pose.rotation)
        if np.any(np.abs(angles) > 0.0):
            name = "rpy_deg" if degrees or value is None else "rpy"
            given[name] = turned(angles, name)
    return given


def rounded(point: Array, key: str) -> list[float]:
    """Return a position [m] as a key writes it, in metres or millimetres."""
    scale, digits = (_MM, _DIGITS - 3) if key.endswith("_mm") else (1.0, _DIGITS)
    return [round(float(scale * x), digits) + 0.0 for x in point]


def turned(angles: Array, key: str) -> list[float]:
    """Return angles [rad] as a key writes them, in radians or degrees."""
    if key.endswith("_deg"):
        return [round(float(np.degrees(x)), _DEGREE_DIGITS) + 0.0 for x in angles]
    return [round(float(x), _TURN_DIGITS) + 0.0 for x in angles]


def _names(key: str) -> bool:
    """Whether a key of a table says something of its pose."""
    return key.removesuffix("_mm").removesuffix("_deg") in ("position", *ORIENTATIONS)

"""Poses as files write them: a 4 × 4 matrix, or a position with an orientation of some kind."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from selfmotion.basics import Array, plain_numbers
from selfmotion.model.path.base import path_pose
from selfmotion.model.task import SE3, Quaternion, exp3, rpy

# A quaternion shorter than this has no direction.
_ZERO = 1e-9
# Largest position or angle; excludes NaN and infinity.
_MAX_ABS_VALUE = 1e15


def from_quaternion(values: Array) -> Array:
    """Return the rotation (3, 3) of a quaternion [w, x, y, z] of any length but zero."""
    length = float(np.linalg.norm(values))
    if not _ZERO <= length < _MAX_ABS_VALUE:
        found = "zero" if length < _ZERO else f"of length {length:g}"
        raise ValueError(f"the quaternion is {found}, expected [w, x, y, z] of length 1")
    w, x, y, z = (values / length).tolist()
    return np.asarray(Quaternion(w, x, y, z).toRotationMatrix())


# Note on a path whose file has no orientations but the tool's z axis.
TURN_NOTE = (
    "nx,ny,nz say where the tool's z axis points, not how the tool is turned about it: that turn "
    "is made up (the x axis near the world's x), and kept by task 'pose'; task 'pointing' leaves "
    "it free"
)


def from_normal(normal: Array) -> Array:
    """Return a rotation (3, 3) whose z axis is along `normal`; its x axis lies near the world's x.

    The choice of the x axis has no effect on tasks that leave the rotation about the tool free.
    """
    length = float(np.linalg.norm(normal))
    if not _ZERO <= length < _MAX_ABS_VALUE:
        found = "zero" if length < _ZERO else f"of length {length:g}"
        raise ValueError(f"the normal is {found}, expected the direction of the tool's z axis")
    z = normal / length
    x = np.eye(3)[0 if abs(z[0]) < 0.9 else 1]
    x = x - z * (z @ x)
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def _from_matrix(values: Array) -> Array:
    matrix = np.eye(4)
    matrix[:3, :3] = values
    return np.asarray(path_pose(matrix, "the pose").rotation)


# Key → shape of its numbers, and function to a rotation.
ORIENTATIONS: Mapping[str, tuple[tuple[int, ...], Callable[[Array], Array]]] = {
    "rotation": ((3, 3), _from_matrix),
    "quaternion": ((4,), from_quaternion),
    "rpy": ((3,), lambda values: np.asarray(rpy.rpyToMatrix(values))),
    "rotation_vector": ((3,), lambda values: np.asarray(exp3(values))),
    "normal": ((3,), from_normal),
}


def pose_of(value: Any) -> SE3:
    """Return the pose that a file gives.

    Either a 4 × 4 matrix, or a table with ``position`` [m] and at most one of ``quaternion``
    [w, x, y, z], ``rpy`` (roll, pitch, yaw about fixed axes) [rad], ``rotation_vector`` [rad],
    ``rotation`` (3 × 3), ``normal`` (the tool's z axis).

    Raises
    ------
    ValueError, PathError
        The value is not a pose; the message has the value and the expected form.
    """
    if isinstance(value, list):
        return path_pose(numbers(value, (4, 4), "the matrix"), "the pose")
    if not isinstance(value, Mapping):
        raise ValueError(f"is {value!r}, expected a table with position, or a 4 × 4 matrix")
    unknown = sorted(set(value) - {"position", *ORIENTATIONS})
    if unknown:
        raise ValueError(
            f"unknown key '{unknown[0]}', expected position and one of {', '.join(ORIENTATIONS)}"
        )
    given = [key for key in ORIENTATIONS if key in value]
    if len(given) > 1:
        raise ValueError(f"has both {given[0]} and {given[1]}; give one orientation")
    pose = SE3.Identity()
    pose.translation = numbers(value.get("position", [0.0, 0.0, 0.0]), (3,), "position")
    for key in given:
        shape, rotation = ORIENTATIONS[key]
        pose.rotation = rotation(numbers(value[key], shape, key))
    return pose


def numbers(value: Any, shape: tuple[int, ...], what: str) -> Array:
    """Return finite numbers of that shape; ValueError otherwise."""
    size = " × ".join(map(str, shape))
    array = plain_numbers(value)
    if array is None:
        raise ValueError(f"{what} is {value!r}, expected {size} numbers")
    if array.shape != shape or not np.all(np.abs(array) < _MAX_ABS_VALUE):
        raise ValueError(f"{what} is {value!r}, expected {size} finite numbers")
    return array

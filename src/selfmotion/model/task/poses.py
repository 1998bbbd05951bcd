"""Poses that are given."""

from typing import Any

import numpy as np
import pinocchio as pin
from pinocchio import (
    SE3 as SE3,
    Jexp3 as Jexp3,
    Quaternion as Quaternion,
    exp3 as exp3,
    log3 as log3,
    rpy as rpy,
    skew as skew,
)

from selfmotion.basics import Array, ProblemError, as_numbers, read_only

# Largest deviation of a given rotation matrix from orthonormal.
_ROTATION_TOLERANCE = 1e-6


class FixedPose(pin.SE3):  # type: ignore[misc]  # Pinocchio has no types
    """An immutable pose: paths and obstacles are values."""

    @property
    def translation(self) -> Array:
        """The position, read-only, (3,) [m]."""
        return read_only(pin.SE3.translation.fget(self))

    @property
    def rotation(self) -> Array:
        """The orientation, read-only, (3, 3)."""
        return read_only(pin.SE3.rotation.fget(self))

    def setIdentity(self) -> None:
        """Refuse."""
        raise AttributeError("a pose of a path or an obstacle cannot be changed")

    setRandom = setIdentity

    def __reduce__(self) -> tuple[Any, ...]:
        return FixedPose, (np.array(self.rotation), np.array(self.translation))


def as_pose(pose: Any, what: str = "pose", error: type[Exception] = ProblemError) -> pin.SE3:
    """Return `pose` (an SE3 or a (4, 4) homogeneous matrix) as an SE3 of its own that stays.

    Raises
    ------
    error
        It is no pose, not finite, or its rotation is not orthonormal or a mirror; `what` is its
        name in the message.
    """
    values = pose.homogeneous if isinstance(pose, pin.SE3) else pose
    matrix = as_numbers(values, what, "an SE3 or a (4, 4) matrix of finite numbers", (4, 4), error)
    rotation = matrix[:3, :3]
    skew = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
    if not skew < _ROTATION_TOLERANCE:
        raise error(f"{what}: its rotation is not orthonormal (by {skew:.2g})")
    if np.linalg.det(rotation) < 0.0:
        raise error(
            f"{what}: its rotation is a mirror (determinant -1), expected right-handed axes "
            f"(determinant 1)"
        )
    if not np.array_equal(matrix[3], [0.0, 0.0, 0.0, 1.0]):
        raise error(f"{what}: its last row is {matrix[3].tolist()}, expected [0, 0, 0, 1]")
    return FixedPose(np.array(rotation), np.array(matrix[:3, 3]))

"""Poses as they are given: an SE3, or a homogeneous matrix."""

from typing import Any

import numpy as np
import pinocchio as pin

from selfmotion.basics import ProblemError, as_numbers

# How far a rotation matrix that was written down may be from orthonormal.
_ROTATION_TOLERANCE = 1e-6


def as_pose(pose: Any, what: str = "pose", error: type[Exception] = ProblemError) -> pin.SE3:
    """Return `pose` (an SE3 or a (4, 4) homogeneous matrix) as an SE3 of its own.

    Raises
    ------
    error
        It is something else, not finite, or its rotation is not orthonormal; `what` is what the
        message calls it.
    """
    values = pose.homogeneous if isinstance(pose, pin.SE3) else pose
    matrix = as_numbers(values, what, "an SE3 or a (4, 4) matrix of finite numbers", (4, 4), error)
    rotation = matrix[:3, :3]
    skew = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
    if not skew < _ROTATION_TOLERANCE or np.linalg.det(rotation) < 0.0:
        raise error(f"{what}: its rotation is not orthonormal and right-handed (by {skew:.2g})")
    if not np.array_equal(matrix[3], [0.0, 0.0, 0.0, 1.0]):
        raise error(f"{what}: its last row is {matrix[3].tolist()}, expected [0, 0, 0, 1]")
    return pin.SE3(np.array(rotation), np.array(matrix[:3, 3]))

"""Configurations as they are given: n numbers, or K rows of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, RobotError, plain_numbers, shown

if TYPE_CHECKING:
    from selfmotion.robot.model import RobotModel


def as_configuration(robot: RobotModel, q: npt.ArrayLike) -> Array:
    """Return `q` as finite numbers (n,); see `RobotModel.configuration`."""
    return _checked(robot, q, several=False)


def as_configurations(robot: RobotModel, q: npt.ArrayLike) -> Array:
    """Return `q` as finite numbers, (n,) or (K, n).

    Raises
    ------
    RobotError
        It has another shape, or a number is not finite; row and joint are named.
    """
    return _checked(robot, q, several=True)


def _checked(robot: RobotModel, q: npt.ArrayLike, several: bool) -> Array:
    array, names = plain_numbers(q), ", ".join(robot.joint_names)
    if array is None:
        raise RobotError(
            f"configuration is {shown(q)}, expected {robot.dof} numbers, one for each of {names}"
        )
    if array.shape[-1:] != (robot.dof,) or array.ndim > 1 + several:
        rows = f" or (K, {robot.dof})" if several else ""
        raise RobotError(
            f"configuration has shape {array.shape}, expected ({robot.dof},){rows} for joints "
            f"{names}"
        )
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        where = f"configuration {bad[0][0]}: " if array.ndim == 2 else ""
        joint = robot.joint_names[bad[0][-1]]
        raise RobotError(f"{where}joint '{joint}' is {array[tuple(bad[0])]}, not finite")
    return np.array(array)

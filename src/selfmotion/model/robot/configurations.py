"""Configurations of an arm, as they are given, and weights of its joints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    Array,
    RobotError,
    as_number,
    nearest,
    plain_numbers,
    shown,
)

if TYPE_CHECKING:
    from selfmotion.model.robot.model import RobotModel


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


# Largest weight of a metre [rad/m]: a slower prismatic joint hardly moves already, and weights of
# hundreds make optima badly conditioned.
_MAX_METRE_WEIGHT = 10.0


def joint_weights(robot: RobotModel) -> Array:
    """Return the weight of each joint's unit, (n,); see `RobotModel.joint_weights`."""
    return np.where(robot.is_revolute, 1.0, 1.0 / mean_lever(robot))


def speed_weights(robot: RobotModel) -> Array:
    """Return the weight of each joint's unit, (n,); see `RobotModel.speed_weights`."""
    turns, limits = robot.is_revolute, robot.velocity_limit
    known = np.isfinite(limits) & (limits > 0.0)
    if not (turns & known).any():
        return joint_weights(robot)
    fastest = float(limits[turns & known].mean())
    by_speed = np.minimum(fastest / np.where(known, limits, 1.0), _MAX_METRE_WEIGHT)
    return np.where(turns, 1.0, np.where(known, by_speed, joint_weights(robot)))


def mean_lever(robot: RobotModel) -> float:
    """Return the mean motion of the tool [m] per radian of a revolute joint."""
    arrays = robot.chain.arrays
    beyond = np.cumsum(arrays.link_lengths[:0:-1])[::-1]
    lever_arms = beyond[arrays.tree.is_revolute]
    return float(lever_arms.mean()) if lever_arms.size and lever_arms.max() > 0.0 else 1.0


def part_weights(robot: RobotModel, weights: Mapping[str, float]) -> Array:
    """Return these with some parts' times a number, (n,); see `RobotModel.part_weights`."""
    if not isinstance(weights, Mapping):
        raise RobotError(f"weights are {shown(weights)}, expected a dict of parts or joints")
    found = robot.joint_weights.copy()
    for name, weight in weights.items():
        mine = np.array([j == name or j.startswith(f"{name}/") for j in robot.joint_names])
        if not mine.any():
            raise RobotError(
                f"{robot.name}: no part or joint '{name}' to weigh"
                f"{nearest(name, robot.joint_names)}; joints: {', '.join(robot.joint_names)}"
            )
        found[mine] *= as_number(weight, f"weight of '{name}'", least=0.0, error=RobotError)
    return found

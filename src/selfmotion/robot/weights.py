"""What a unit of each joint counts where joints of both kinds are added up."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from selfmotion.basics import Array, RobotError, as_number, nearest, shown

if TYPE_CHECKING:
    from selfmotion.robot.model import RobotModel


# A metre counts so many radians at most: a lift that is slower still is left alone by as much
# already, and a weight of hundreds makes optima badly conditioned.
_MOST = 10.0


def joint_weights(robot: "RobotModel") -> Array:
    """Return what a unit of each joint counts, (n,); see `RobotModel.joint_weights`."""
    return np.where(robot.is_revolute, 1.0, 1.0 / mean_lever(robot))


def speed_weights(robot: "RobotModel") -> Array:
    """Return what a unit of each joint counts, (n,); see `RobotModel.speed_weights`."""
    turns, limits = robot.is_revolute, robot.velocity_limit
    known = np.isfinite(limits) & (limits > 0.0)
    if not (turns & known).any():
        return joint_weights(robot)
    fastest = float(limits[turns & known].mean())
    by_speed = np.minimum(fastest / np.where(known, limits, 1.0), _MOST)
    return np.where(turns, 1.0, np.where(known, by_speed, joint_weights(robot)))


def mean_lever(robot: "RobotModel") -> float:
    """Return how far [m] the tool goes where a revolute joint turns by a radian: their mean."""
    arrays = robot.chain.arrays
    beyond = np.cumsum(arrays.link_lengths[:0:-1])[::-1]
    levers = beyond[arrays.tree.is_revolute]
    return float(levers.mean()) if levers.size and levers.max() > 0.0 else 1.0


def part_weights(robot: "RobotModel", weights: Mapping[str, float]) -> Array:
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

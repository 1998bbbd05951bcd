"""What the global search is given, checked."""

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    Array,
    ProblemError,
)
from selfmotion.follow import Follows
from selfmotion.robot import RobotModel


def as_times(t: npt.ArrayLike) -> Array:
    """Return increasing times (W,), checked."""
    times = np.asarray(t, dtype=np.float64)
    if times.ndim != 1 or len(times) < 2 or not np.all(np.diff(times) > 0):
        raise ProblemError(f"t has shape {times.shape}, expected at least two increasing times [s]")
    return times


def as_joint_values(
    robot: RobotModel, values: npt.ArrayLike, name: str, shape: tuple[int, ...]
) -> Array:
    """Return numbers for each joint in a shape, given as such, for each joint, or one for all."""
    array = np.asarray(values, dtype=np.float64)
    if array.shape not in ((), (robot.dof,), shape) or np.any(np.isnan(array)):
        raise ProblemError(
            f"{name} has shape {array.shape}, expected a number for each of {robot.dof} joints"
        )
    return np.ascontiguousarray(np.broadcast_to(array, shape))


def check_asked(follows: Follows, limits: list[Array], count: int) -> None:
    """Refuse what the search over curves cannot do; `limits` are lower, upper, largest step."""
    robot, redundancy = follows.robot, follows.redundancy
    if redundancy != 1:
        raise ProblemError(
            f"{robot.name} has redundancy {redundancy} for task '{follows.task.value}'; the search "
            f"over self-motion curves needs 1, use multiple starts instead"
        )
    if np.any(limits[0] > limits[1]):
        k = int(np.flatnonzero(limits[0] > limits[1])[0])
        raise ProblemError(f"joint '{robot.joint_names[k]}' has its lower limit above the upper")
    if not np.all(limits[2] > 0.0):
        raise ProblemError("largest_step has numbers that are not positive")
    if count < 1:
        raise ProblemError(f"count is {count}, expected at least 1")

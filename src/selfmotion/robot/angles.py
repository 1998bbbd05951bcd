"""Whether joint coordinates are in radians."""

import numpy as np

from selfmotion.basics import Array, ProblemError
from selfmotion.robot.model import RobotModel

# Joints with limits turn less than this [rad].
_MOST_TURNS = 4.0 * np.pi


def check_radians(robot: RobotModel, values: Array, what: str, called: str) -> None:
    """Raise ProblemError for `called` coordinates (n,) of revolute joints that are in degrees."""
    for name, value in zip(robot.joint_names, values, strict=True):
        if np.isfinite(value) and abs(value) > _MOST_TURNS and not robot.is_prismatic(name):
            raise ProblemError(
                f"{what}: joint '{name}': {value:.6g} rad is {value / (2.0 * np.pi):.1f} turns; "
                f"{called} are in radians (numpy.radians), ±inf for none"
            )

"""Paths that can only be meant in other units: millimetres, milliseconds."""

import numpy as np

from selfmotion.basics import ProblemError
from selfmotion.path import Path
from selfmotion.robot import RobotModel

# A path that is nowhere nearer than so many times the arm's reach is in other units.
_FAR = 20.0
# Joints without a limit of speed are taken to have this one [rad/s or m/s]; a path that is so many
# times faster than the arm is in other units. What is less is planned, to be slowed down.
_FAST, _HOPELESS = 100.0, 100.0
# Reach that counts for the speed of an arm on an endless slide [m].
_LONG = 1e3


def check_units(robot: RobotModel, path: Path) -> None:
    """Raise ProblemError for a path that can only be meant in millimetres."""
    times = np.linspace(0.0, path.duration, 9)
    distances = np.linalg.norm(path.samples(times).translation, axis=1)
    reach = robot.reach
    if np.isfinite(reach) and distances.min() > _FAR * reach:
        raise ProblemError(
            f"{robot.name}: the path is {distances.min():.4g} m away from the arm's root "
            f"and more, the arm reaches {reach:.4g} m; positions are in metres"
        )


def check_pace(robot: RobotModel, path: Path) -> None:
    """Raise ProblemError for a path that no arm could follow at a hundred times its speed."""
    fastest = np.minimum(robot.velocity_limit, _FAST)
    slides = np.array([robot.is_prismatic(name) for name in robot.joint_names])
    bound = float(np.sum(np.where(slides, fastest, fastest * min(robot.reach, _LONG))))
    times = np.linspace(0.0, path.duration, 9)
    speeds = np.linalg.norm(path.samples(times).twist[:, :3], axis=1)
    k = int(np.argmax(speeds))
    # Written so that NaN is refused too.
    if not speeds[k] <= _HOPELESS * bound:
        raise ProblemError(
            f"{robot.name}: the path is too fast: {speeds[k]:.3g} m/s at t = {times[k]:.3g} s, "
            f"while its joints move the tool at {bound:.3g} m/s at most; durations are in seconds"
        )

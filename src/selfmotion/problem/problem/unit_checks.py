"""Checks of a path against the reach and speed of an arm, which find wrong units."""

import numpy as np

from selfmotion.basics import Array, ProblemError
from selfmotion.model.path import Path
from selfmotion.model.robot import RobotModel

# A path farther away than this many reaches of the arm is in other units.
_MAX_REACHES = 20.0
# Samples of a path for its distance.
_DISTANCE_SAMPLES = 9
# Speed of joints without a limit [rad/s or m/s].
_UNLIMITED_SPEED = 100.0
# A path this many times faster than the arm is in other units; below, it is planned, and may be
# slowed.
_MAX_SPEED_RATIO = 100.0
# Reach of an arm on an endless slide, for its speed [m].
_ENDLESS_REACH = 1e3
# No tool accelerates more [m/s²]: the fastest arms reach a tenth of it.
_MAX_ACCELERATION = 2000.0
# Standard gravity, rounded [m/s²].
_GRAVITY = 9.81
# Samples of a path between its marks, at most about …
_MIDDLES = 400
# … and evenly spaced ones.
_EVEN_SAMPLES = 9
# Step of the central difference of a velocity, as a share of the distance to the nearest mark …
_DIFFERENCE_STEP = 0.1
# … and at least, as a share of the duration.
_MIN_DIFFERENCE_STEP = 1e-9


def check_distance(robot: RobotModel, path: Path, reach: float) -> None:
    """Raise ProblemError for a path so far from the arm that it can only be in millimetres."""
    times = np.linspace(0.0, path.duration, _DISTANCE_SAMPLES)
    distances = np.linalg.norm(path.samples(times).translation, axis=1)
    if np.isfinite(reach) and distances.min() > _MAX_REACHES * reach:
        raise ProblemError(
            f"{robot.name}: the path is {distances.min():.4g} m away from the arm's root "
            f"and more, the arm reaches {reach:.4g} m; positions are in metres"
        )


def check_speed(robot: RobotModel, path: Path, reach: float) -> None:
    """Raise ProblemError for a path that no arm could follow at a hundred times its speed."""
    bound = _largest_tool_speed(robot, reach)
    times = _sample_times(path)
    speeds = np.linalg.norm(path.samples(times).twist[:, :3], axis=1)
    k = int(np.argmax(speeds))
    # Written so that NaN is refused too.
    if not speeds[k] <= _MAX_SPEED_RATIO * bound:
        raise ProblemError(
            f"{robot.name}: the path is too fast: {speeds[k]:.3g} m/s at t = {times[k]:.3g} s, "
            f"while its joints move the tool at {bound:.3g} m/s at most; durations are in seconds"
        )
    accelerations = _accelerations(path, times)
    k = int(np.argmax(accelerations))
    if accelerations[k] > _MAX_ACCELERATION:
        raise ProblemError(
            f"{robot.name}: the path is too fast: it accelerates at {accelerations[k]:.3g} m/s² "
            f"at t = {times[k]:.3g} s, which is {accelerations[k] / _GRAVITY:.0f} times gravity; "
            f"durations are in seconds, lengths in metres"
        )


def _largest_tool_speed(robot: RobotModel, reach: float) -> float:
    """Return a bound on the speed of a tool within reach [m/s]: the sum over the joints."""
    fastest = np.minimum(robot.velocity_limit, _UNLIMITED_SPEED)
    slides = np.array([robot.is_prismatic(name) for name in robot.joint_names])
    return float(np.sum(np.where(slides, fastest, fastest * min(reach, _ENDLESS_REACH))))


def _sample_times(path: Path) -> Array:
    """Return sample times: middles between some marks of a path, and evenly spread ones."""
    marks = np.asarray(path.marks)
    middles = 0.5 * (marks[:-1] + marks[1:])
    some = middles[:: 1 + len(middles) // _MIDDLES]
    evenly = (np.arange(_EVEN_SAMPLES) + 0.5) / _EVEN_SAMPLES * path.duration
    return np.union1d(some, evenly)


def _accelerations(path: Path, times: Array) -> Array:
    """Return magnitudes of the tool's acceleration (K,) [m/s²], by central differences.

    No difference reaches across a mark, where the velocity may jump: 0 where there is no room.
    """
    room = _distances_to_marks(path, times)
    step = np.maximum(_DIFFERENCE_STEP * room, _MIN_DIFFERENCE_STEP * path.duration)
    early, late = (path.samples(times + side * step).twist[:, :3] for side in (-1.0, 1.0))
    return np.where(step < room, np.linalg.norm(late - early, axis=1) / (2.0 * step), 0.0)


def _distances_to_marks(path: Path, times: Array) -> Array:
    """Return the distance of times (K,) from the nearest mark of a path, (K,) [s]."""
    marks = np.asarray(path.marks)
    following = np.clip(np.searchsorted(marks, times), 1, len(marks) - 1)
    around = marks[np.stack([following - 1, following], axis=1)]
    return np.asarray(np.abs(times[:, None] - around).min(axis=1))

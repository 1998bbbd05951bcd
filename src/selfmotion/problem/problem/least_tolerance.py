"""By how much an arm has to lean its tool to keep to a path in its position alone."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from selfmotion.basics import Array, RobotError
from selfmotion.model.follow import Follows
from selfmotion.model.path import spread_along
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import ROW_NAMES, Task

# Sampled poses of the path.
_PLACES = 41
# Largest number of steps at each.
_STEPS = 100
# Initial configurations without a given start.
_STARTS = 8
# Position error that counts as 0 [m].
_NEAR = 1e-6
# Largest step [rad or m].
_MAX_STEP = 0.1
# Relative singular value of directions that count.
_RANK = 1e-3
# Share of a step towards a smaller tilt.
_DAMPED = 0.5
# Step at which the iteration ends [rad or m].
_LAST = 1e-7
# Tilt from which on orientation is not prescribed any more [rad].
_USELESS = 1.5
# Factor of the recommended tolerance: tolerances need room.
_ROOM = 1.01


def that_would_do(follows: Follows, start: Any) -> str:
    """Return in words which tolerance would do from a start, "" where none is known."""
    given = None
    if start is not None and not isinstance(start, str):
        try:
            given = follows.robot.configuration(start)
        except RobotError:
            # An error of the start has a message of its own, after other checks.
            return ""
    least = least_tolerance(follows, given)
    if least is None or not 0.0 < least < _USELESS:
        return ""
    rows = ",".join(ROW_NAMES[k] for k in follows.items[0].task.rows if k >= 3)
    # Two digits, rounded up: less would be out of reach.
    digits = 1 - int(np.floor(np.log10(least)))
    enough = float(np.ceil(_ROOM * least * 10.0**digits) / 10.0**digits)
    where = "where it was tried" if given is None else "this start"
    return f": {rows}={enough:g} (rad) would do from {where}"


def least_tolerance(follows: Follows, start: Array | None) -> float | None:
    """Return a tolerance of a pose's or pointing task's turns by which an arm keeps to a path.

    The largest lean of the tool, where it is on the path and leans as little as it can nearby, at
    places one after the other; None where the task is another one, or the arm does not get along.

    Parameters
    ----------
    follows : Follows
    start : (n,), optional
        Initial configuration; by default the best of a few.
    """
    if follows.items[0].task not in (Task.POSE, Task.POINTING) or len(follows.items) > 1:
        return None
    starts = _starts(follows.robot) if start is None else iter([start])
    found = [lean for each in starts if (lean := _largest_lean(follows, each)) is not None]
    return min(found, default=None)


def _starts(robot: RobotModel) -> Iterator[Array]:
    yield robot.dexterous_configuration(Task.POSITION)
    lower, upper = robot.finite_limits()
    yield from np.random.default_rng(0).uniform(lower, upper, (_STARTS, robot.dof))


def _largest_lean(follows: Follows, start: Array) -> float | None:
    robot, item = follows.robot, follows.items[0]
    path = item.path.samples(spread_along(item.path, _PLACES))
    points = item.task is Task.POINTING
    q, largest = np.array(start, dtype=np.float64), 0.0
    for place, rotation in zip(path.translation, path.rotation, strict=True):
        for _ in range(_STEPS):
            pose, jacobian = robot.pose(q), robot.jacobian(q)
            left, lean = place - pose.translation, _turn(pose.rotation, rotation, points)
            inverse = np.linalg.pinv(jacobian[:3], rcond=_RANK)
            onto = inverse @ left
            free = np.eye(robot.dof) - inverse @ jacobian[:3]
            # Rotation about the tool's own axis is no tilt.
            across = np.eye(3) - np.outer(pose.rotation[:, 2], pose.rotation[:, 2]) * points
            turns = across @ jacobian[3:] @ free
            step = onto + _DAMPED * np.linalg.pinv(turns, rcond=_RANK) @ (
                lean - across @ jacobian[3:] @ onto
            )
            step *= min(1.0, _MAX_STEP / max(float(np.abs(step).max()), 1e-300))
            q = np.clip(q + step, robot.lower, robot.upper)
            if np.abs(step).max() < _LAST:
                break
        if np.linalg.norm(place - robot.pose(q).translation) > _NEAR:
            return None
        largest = max(
            largest, float(np.linalg.norm(_turn(robot.pose(q).rotation, rotation, points)))
        )
    return largest


def _turn(now: Array, wanted: Array, points: bool) -> Array:
    """Return the rotation vector in world axes from an orientation to another, or to its z axis."""
    if points:
        axis = np.cross(now[:, 2], wanted[:, 2])
        sine = float(np.linalg.norm(axis))
        angle = np.arctan2(sine, float(now[:, 2] @ wanted[:, 2]))
        return np.asarray(axis * (angle / sine)) if sine > 0.0 else np.zeros(3)
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(wanted @ now.T).as_rotvec())

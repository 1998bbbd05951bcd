"""Checks that a given start and a given end put the tool on its path."""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array, ProblemError, StartError
from selfmotion.certificate import errors_at
from selfmotion.model.follow import Follows
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import Relaxation

# Largest error of a given start [m, rad]: far above rounding, far below any tolerance.
_START_ERROR = 1e-7
# Largest correction of a start towards the path [rad or m].
START_TOLERANCE = 1e-5
# Largest error of a given end configuration [m, rad]: the certificate's tolerance for it.
_END_ERROR = 1e-6


def check_start(follows: Follows, start: Array, relaxations: Sequence[Relaxation]) -> None:
    """Raise StartError where a start (n,) is off one of the paths beyond its tolerances."""
    error = _path_error(follows, start, relaxations, at_end=False)
    if error is not None:
        position, rotation, text = error
        beyond_limits = _limit_violation(follows.robot, start)
        raise StartError(
            f"{follows.robot.name}: the start configuration {beyond_limits}{text}; "
            f"leave it out, or take robot.inverse_kinematics(path.pose(0.0), task, seed=start)",
            position_miss=position,
            rotation_miss=rotation,
        )


def check_end(follows: Follows, end: Array, relaxations: Sequence[Relaxation]) -> None:
    """Raise ProblemError where an end (n,) is off one of the paths beyond its tolerances."""
    error = _path_error(follows, end, relaxations, at_end=True)
    if error is not None:
        raise ProblemError(
            f"{follows.robot.name}: the end configuration {error[-1]}; take "
            f"robot.inverse_kinematics(path.pose(path.duration), task, seed=q)"
        )


def _path_error(
    follows: Follows, q: Array, relaxations: Sequence[Relaxation], *, at_end: bool
) -> tuple[float, float, str] | None:
    """Return the first deviation from a path [m, rad] that is too large, and its words; or None.

    That of the configuration q (n,) with which a motion starts, or ends. The relaxations are those
    of the first path.
    """
    for k, item in enumerate(follows.items):
        t = np.array([item.path.duration if at_end else 0.0])
        allowed = () if k else relaxations
        position, rotation = item.miss(item.path.pose(float(t[0])), q)
        if allowed:
            position, rotation = errors_at(item, t, q[None], allowed)[0].tolist()
        if max(position, rotation) > (_END_ERROR if at_end else _START_ERROR):
            end, beyond = "end" if at_end else "start", ", beyond its tolerances" if allowed else ""
            return (
                position,
                rotation,
                f"puts '{item.chain.tip_name}' {position:.3g} m and {rotation:.3g} rad off the "
                f"{end} of the path{beyond}",
            )
    return None


def _limit_violation(robot: RobotModel, start: Array) -> str:
    """Return the first joint of a start (n,) beyond its limits, in words; "" for none."""
    for k, name in enumerate(robot.joint_names):
        low, high = robot.lower[k], robot.upper[k]
        if not low <= start[k] <= high:
            unit, hint = ("m", "") if robot.is_prismatic(name) else ("rad", "; in degrees?")
            return (
                f"has joint '{name}' at {start[k]:g} {unit}, beyond its limits of {low:.4g} to "
                f"{high:.4g} {unit}{hint}, and "
            )
    return ""

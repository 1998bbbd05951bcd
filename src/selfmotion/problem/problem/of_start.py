"""What a certificate says of a given start."""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array
from selfmotion.certificate import Certificate, Requirement, Separation
from selfmotion.model.motion import Trajectory
from selfmotion.model.robot import RobotModel
from selfmotion.problem.problem.end_checks import START_TOLERANCE


def too_near_at(
    start: Array, certificate: Certificate, requirements: Sequence[Requirement]
) -> tuple[str, ...]:
    """Return that bodies are too near at the given start (n,) already, in words."""
    wrong = {found.requirement for found in certificate.findings if not found.satisfied}
    apart = [item for item in requirements if isinstance(item, Separation)]
    if not any(item.name in wrong for item in apart):
        return ()
    return tuple(filter(None, (item.of_given_start(start) for item in apart)))


def misses_of_start(robot: RobotModel, start: Array, trajectory: Trajectory) -> tuple[str, ...]:
    """Return in words that a motion does not start at the given start (n,)."""
    away = np.abs(trajectory.of_joints(robot.joint_names).q[0] - start)
    worst = int(np.argmax(away))
    # Written so that NaN is elsewhere.
    if bool(away[worst] <= START_TOLERANCE):
        return ()
    joint = robot.joint_names[worst]
    return (
        f"it does not begin at the given start: joint '{joint}' is {away[worst]:.3g} "
        f"{robot.unit_of(joint)} away ({START_TOLERANCE:g} allowed); leave the start out, "
        f"or plan from there",
    )

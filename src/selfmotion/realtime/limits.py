"""Limits of the joints, as the loop keeps them."""

from collections.abc import Sequence
from functools import reduce
from operator import and_

import numpy as np

from selfmotion.basics import Array, ProblemError, StartError
from selfmotion.constraints import (
    Constraint,
    JointAccelerationLimits,
    JointPositionLimits,
    JointVelocityLimits,
)
from selfmotion.realtime.settings import ACCELERATION, ENDS, SPEED
from selfmotion.realtime.viable import braking_distance
from selfmotion.robot import RobotModel

_USUAL = (JointPositionLimits, JointVelocityLimits, JointAccelerationLimits)


def joint_limits(robot: RobotModel, constraints: Sequence[Constraint]) -> Array:
    """Return lower, upper, speed and acceleration limits of an arm, (4, n).

    Those of the arm and its maker, and of the constraints.

    Raises
    ------
    ProblemError
        A constraint is not of the kinds that are kept while moving; a joint has no limit of
        acceleration.
    """
    for item in constraints:
        if not item.kept_moving:
            raise ProblemError(
                f"constraint {type(item).__name__} is not kept while moving, expected limits of "
                f"joint position, velocity and acceleration, or a Clearance"
            )
    kinds = {type(item) for item in constraints}
    # Where none are given, those of the arm and its maker.
    asked = [*constraints, *(kind() for kind in _USUAL if kind not in kinds)]
    envelope = reduce(and_, (item.envelope(robot) for item in asked))
    limits = np.array([envelope.lower, envelope.upper, envelope.speed, envelope.acceleration])
    endless = np.flatnonzero(~np.isfinite(limits[2:]).all(axis=0))
    if endless.size:
        raise ProblemError(
            f"{robot.name}: joint '{robot.joint_names[int(endless[0])]}' has no limit of speed or "
            f"acceleration, which a stop in time needs; give JointVelocityLimits(…) and "
            f"JointAccelerationLimits(…)"
        )
    return limits


def planned_limits(limits: Array) -> Array:
    """Return what plans aim at, within the limits (4, n) of commands."""
    lower, upper = limits[:2]
    margin = np.minimum(ENDS, 0.1 * (upper - lower))
    return np.stack([lower + margin, upper - margin, SPEED * limits[2], ACCELERATION * limits[3]])


def stoppable(robot: RobotModel, limits: Array, q: Array, qd: Array, cycle: float) -> Array:
    """Return the control point c (n,) of a motion that begins at q with q̇, see `viable`.

    Raises
    ------
    StartError
        A joint cannot stop within the limits (4, n) from there.
    """
    c = q + cycle * qd
    lower, upper, speed, hardest = limits[:4]
    room = np.where(qd > 0.0, upper - c, c - lower)
    need = np.array(
        [braking_distance(abs(w), most, cycle) for w, most in zip(qd, hardest, strict=True)]
    )
    bad = np.flatnonzero((c < lower) | (c > upper) | (np.abs(qd) > speed) | (need > room))
    if bad.size:
        k = int(bad[0])
        name = robot.joint_names[k]
        unit = robot.unit_of(name)
        is_outside = not lower[k] <= q[k] <= upper[k]
        asks = is_outside and unit == "rad" and abs(q[k]) > 2.0 * np.pi
        raise StartError(
            f"joint '{name}' is at {q[k]:.6g} {unit}, {qd[k]:.6g} {unit}/s, from where it cannot "
            f"stop within {lower[k]:.6g}..{upper[k]:.6g} {unit} at up to {speed[k]:.6g} {unit}/s; "
            f"bring the arm within its limits first"
            f"{'; are its angles in degrees? expected rad' if asks else ''}",
            position_miss=0.0,
            rotation_miss=0.0,
        )
    return np.asarray(c)

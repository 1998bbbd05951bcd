"""Constraints on a motion: limits, end conditions, closed paths, clearance."""

from selfmotion.problem.constraints.band import Band as Band
from selfmotion.problem.constraints.base import Constraint as Constraint, Envelope as Envelope
from selfmotion.problem.constraints.clearance import (
    BoundClearance as BoundClearance,
    Clearance as Clearance,
)
from selfmotion.problem.constraints.conditions import (
    ActiveConstraint as ActiveConstraint,
    BoundConstraint as BoundConstraint,
    Multipliers as Multipliers,
    NodeTangents as NodeTangents,
    active_of as active_of,
    easing_of as easing_of,
    linearised as linearised,
    penalised as penalised,
    penalty as penalty,
    violated as violated,
    worst_time as worst_time,
)
from selfmotion.problem.constraints.ends import (
    BoundEnd as BoundEnd,
    ClosedPath as ClosedPath,
    EndAcceleration as EndAcceleration,
    EndConfiguration as EndConfiguration,
    EndVelocity as EndVelocity,
    StartAcceleration as StartAcceleration,
    StartVelocity as StartVelocity,
)
from selfmotion.problem.constraints.limits import (
    BoundLimits as BoundLimits,
    JointAccelerationLimits as JointAccelerationLimits,
    JointJerkLimits as JointJerkLimits,
    JointPositionLimits as JointPositionLimits,
    JointTorqueLimits as JointTorqueLimits,
    JointVelocityLimits as JointVelocityLimits,
)
from selfmotion.problem.constraints.tool import Tilt as Tilt, ToolLimits as ToolLimits

__all__ = [
    "ActiveConstraint",
    "Band",
    "BoundConstraint",
    "Clearance",
    "ClosedPath",
    "Constraint",
    "EndAcceleration",
    "EndConfiguration",
    "EndVelocity",
    "Envelope",
    "JointAccelerationLimits",
    "JointJerkLimits",
    "JointPositionLimits",
    "JointTorqueLimits",
    "JointVelocityLimits",
    "NodeTangents",
    "StartAcceleration",
    "StartVelocity",
    "Tilt",
    "ToolLimits",
]

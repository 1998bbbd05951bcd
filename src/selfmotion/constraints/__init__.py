"""What a motion must keep: limits, end conditions, closed paths, clearance."""

from selfmotion.constraints.band import Band
from selfmotion.constraints.base import Constraint
from selfmotion.constraints.binding import Binding
from selfmotion.constraints.clearance import Clearance
from selfmotion.constraints.conditions import (
    BoundConstraint,
    Linearised,
    NodeTangents,
    easing_of,
    linearised,
)
from selfmotion.constraints.ends import (
    ClosedPath,
    EndAcceleration,
    EndConfiguration,
    EndVelocity,
    StartAcceleration,
    StartVelocity,
)
from selfmotion.constraints.envelope import Envelope
from selfmotion.constraints.limits import (
    JointAccelerationLimits,
    JointJerkLimits,
    JointPositionLimits,
    JointVelocityLimits,
)
from selfmotion.constraints.tool import ToolLimits
from selfmotion.constraints.torque import JointTorqueLimits

__all__ = [
    "Band",
    "Binding",
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
    "Linearised",
    "NodeTangents",
    "StartAcceleration",
    "StartVelocity",
    "ToolLimits",
    "easing_of",
    "linearised",
]

"""What a motion must keep: limits, end conditions, closed paths, clearance."""

from selfmotion.constraints.active import (
    ActiveConstraint as ActiveConstraint,
    Multipliers as Multipliers,
    active_of as active_of,
)
from selfmotion.constraints.band import Band as Band
from selfmotion.constraints.base import Constraint as Constraint
from selfmotion.constraints.bound_end import BoundEnd as BoundEnd
from selfmotion.constraints.clearance import (
    BoundClearance as BoundClearance,
    Clearance as Clearance,
)
from selfmotion.constraints.conditions import (
    BoundConstraint as BoundConstraint,
    Linearised as Linearised,
    NodeTangents as NodeTangents,
    easing_of as easing_of,
    linearised as linearised,
)
from selfmotion.constraints.ends import (
    ClosedPath as ClosedPath,
    EndAcceleration as EndAcceleration,
    EndConfiguration as EndConfiguration,
    EndVelocity as EndVelocity,
    StartAcceleration as StartAcceleration,
    StartVelocity as StartVelocity,
)
from selfmotion.constraints.envelope import Envelope as Envelope
from selfmotion.constraints.kept import (
    penalised as penalised,
    penalty as penalty,
    violated as violated,
)
from selfmotion.constraints.limits import (
    BoundLimits as BoundLimits,
    JointAccelerationLimits as JointAccelerationLimits,
    JointJerkLimits as JointJerkLimits,
    JointPositionLimits as JointPositionLimits,
    JointVelocityLimits as JointVelocityLimits,
)
from selfmotion.constraints.tilt import Tilt as Tilt
from selfmotion.constraints.tool import ToolLimits as ToolLimits
from selfmotion.constraints.torque import JointTorqueLimits as JointTorqueLimits

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

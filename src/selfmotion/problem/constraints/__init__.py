"""Constraints on a motion: limits, end conditions, closed paths, clearance."""

from selfmotion.problem.constraints.active import (
    ActiveConstraint as ActiveConstraint,
    Multipliers as Multipliers,
    active_of as active_of,
)
from selfmotion.problem.constraints.band import Band as Band
from selfmotion.problem.constraints.base import (
    Constraint as Constraint,
    Ends as Ends,
    Envelope as Envelope,
)
from selfmotion.problem.constraints.bound import Conditions as Conditions
from selfmotion.problem.constraints.bound_ends import (
    BoundEnd as BoundEnd,
    EndCondition as EndCondition,
)
from selfmotion.problem.constraints.bound_limits import BoundLimits as BoundLimits
from selfmotion.problem.constraints.clearance import (
    MOVED_CLEARANCE as MOVED_CLEARANCE,
    NO_OVERLAP as NO_OVERLAP,
    BoundClearance as BoundClearance,
    Clearance as Clearance,
    as_clearances as as_clearances,
    clearances_among as clearances_among,
    separate_clearances as separate_clearances,
    with_own_distances as with_own_distances,
    without_clearances as without_clearances,
)
from selfmotion.problem.constraints.conditions import (
    BoundConstraint as BoundConstraint,
    BoundQuantity as BoundQuantity,
    DependsOn as DependsOn,
    Linear as Linear,
    NodeTangents as NodeTangents,
    linearised as linearised,
    motion_of_order as motion_of_order,
    penalised as penalised,
    penalty as penalty,
    violated as violated,
    worst_time as worst_time,
)
from selfmotion.problem.constraints.ends import (
    ClosedPath as ClosedPath,
    EndAcceleration as EndAcceleration,
    EndConfiguration as EndConfiguration,
    EndVelocity as EndVelocity,
    StartAcceleration as StartAcceleration,
    StartVelocity as StartVelocity,
)
from selfmotion.problem.constraints.limits import (
    JointAccelerationLimits as JointAccelerationLimits,
    JointJerkLimits as JointJerkLimits,
    JointPositionLimits as JointPositionLimits,
    JointVelocityLimits as JointVelocityLimits,
)
from selfmotion.problem.constraints.position_dependent import (
    PositionDependentVelocityLimits as PositionDependentVelocityLimits,
)
from selfmotion.problem.constraints.tilt import Tilt as Tilt
from selfmotion.problem.constraints.tool import ToolLimits as ToolLimits
from selfmotion.problem.constraints.torque_limits import JointTorqueLimits as JointTorqueLimits

__all__ = [
    "ActiveConstraint",
    "Band",
    "BoundConstraint",
    "Clearance",
    "ClosedPath",
    "Conditions",
    "Constraint",
    "EndAcceleration",
    "EndCondition",
    "EndConfiguration",
    "EndVelocity",
    "Ends",
    "Envelope",
    "JointAccelerationLimits",
    "JointJerkLimits",
    "JointPositionLimits",
    "JointTorqueLimits",
    "JointVelocityLimits",
    "NodeTangents",
    "PositionDependentVelocityLimits",
    "StartAcceleration",
    "StartVelocity",
    "Tilt",
    "ToolLimits",
]

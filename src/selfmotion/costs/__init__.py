"""What a motion costs: integrands G(q̇, q, t) of F = ∫ G dt, each with exact derivatives."""

from selfmotion.costs.base import Cost, Partials, weight_matrix
from selfmotion.costs.dynamics import GravityTorque, KineticEnergy
from selfmotion.costs.function import FunctionCost
from selfmotion.costs.joints import (
    JointAcceleration,
    JointJerk,
    JointLimitDistance,
    JointVelocity,
    PathLength,
    Posture,
)
from selfmotion.costs.manipulability import (
    DirectionalManipulability,
    InverseManipulability,
    Manipulability,
    SmallestSingularValue,
)
from selfmotion.costs.samples import Samples

__all__ = [
    "Cost",
    "DirectionalManipulability",
    "FunctionCost",
    "GravityTorque",
    "InverseManipulability",
    "JointAcceleration",
    "JointJerk",
    "JointLimitDistance",
    "JointVelocity",
    "KineticEnergy",
    "Manipulability",
    "Partials",
    "PathLength",
    "Posture",
    "Samples",
    "SmallestSingularValue",
    "weight_matrix",
]

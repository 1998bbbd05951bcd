"""What a motion costs: integrands G(q̇, q, t) of F = ∫ G dt, each with exact derivatives."""

from selfmotion.costs.base import ERROR, Cost, Partials, weight_matrix
from selfmotion.costs.dynamics import GravityTorque, KineticEnergy
from selfmotion.costs.function import FunctionCost, LostCost, cost_from_dict
from selfmotion.costs.joints import (
    JointAcceleration,
    JointJerk,
    JointLimitDistance,
    JointVelocity,
    PathLength,
    Posture,
)
from selfmotion.costs.limit_use import LimitUse
from selfmotion.costs.manipulability import (
    DirectionalManipulability,
    InverseManipulability,
    Manipulability,
    SmallestSingularValue,
)
from selfmotion.costs.off_path import OffPath
from selfmotion.costs.samples import Samples, TipSamples
from selfmotion.costs.towards import Towards

__all__ = [
    "ERROR",
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
    "LimitUse",
    "LostCost",
    "Manipulability",
    "OffPath",
    "Partials",
    "PathLength",
    "Posture",
    "Samples",
    "SmallestSingularValue",
    "TipSamples",
    "Towards",
    "cost_from_dict",
    "weight_matrix",
]

"""Costs: integrands G(q̇, q, t) of F = ∫ G dt, each with exact derivatives."""

from selfmotion.problem.costs.base import (
    ERROR as ERROR,
    Cost as Cost,
    Partials as Partials,
    Scaled as Scaled,
    is_quadratic_form as is_quadratic_form,
    weight_matrix as weight_matrix,
)
from selfmotion.problem.costs.dynamics import (
    GravityTorque as GravityTorque,
    KineticEnergy as KineticEnergy,
)
from selfmotion.problem.costs.function import FunctionCost as FunctionCost
from selfmotion.problem.costs.joints import (
    JointAcceleration as JointAcceleration,
    JointJerk as JointJerk,
    JointLimitDistance as JointLimitDistance,
    JointVelocity as JointVelocity,
    PathLength as PathLength,
    Posture as Posture,
    metres_of as metres_of,
)
from selfmotion.problem.costs.lost import LostCost as LostCost, cost_from_dict as cost_from_dict
from selfmotion.problem.costs.manipulability import (
    DirectionalManipulability as DirectionalManipulability,
    InverseManipulability as InverseManipulability,
    Manipulability as Manipulability,
    SmallestSingularValue as SmallestSingularValue,
)
from selfmotion.problem.costs.penalties import (
    BeyondLimits as BeyondLimits,
    LimitUse as LimitUse,
    OffPath as OffPath,
)
from selfmotion.problem.costs.reversals import JointReversals as JointReversals
from selfmotion.problem.costs.samples import (
    LazySamples as LazySamples,
    Samples as Samples,
    TipSamples as TipSamples,
)
from selfmotion.problem.costs.towards import Towards as Towards

__all__ = [
    "Cost",
    "DirectionalManipulability",
    "FunctionCost",
    "GravityTorque",
    "InverseManipulability",
    "JointAcceleration",
    "JointJerk",
    "JointLimitDistance",
    "JointReversals",
    "JointVelocity",
    "KineticEnergy",
    "LimitUse",
    "Manipulability",
    "Partials",
    "PathLength",
    "Posture",
    "Samples",
    "SmallestSingularValue",
    "Towards",
]

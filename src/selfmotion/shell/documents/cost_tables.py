"""Tables of costs and of null motions in problem files."""

import math
from typing import Annotated, Literal

from selfmotion.basics import restore
from selfmotion.model.motion import NullMotion
from selfmotion.problem.costs import Cost, FunctionCost, Scaled
from selfmotion.shell.documents.field_types import (
    Angle,
    AnyTable,
    Joints,
    LengthOrAngle,
    Number,
    Numbers,
    Rates,
    Text,
    Whole,
    key,
    needed,
)
from selfmotion.shell.documents.one_of import OneOf
from selfmotion.shell.documents.tables import Context, Table

# The kind of a cost that is a function.
FUNCTION = "function"


class CostTable(Table):
    """What is to be low: a cost."""

    kind: str

    def build(self, context: Context) -> Cost:
        """Return the cost, of the arm where it needs one."""
        cost: Cost = restore(Cost, self.given, robot=context.robot)
        return cost


class OwnCost(CostTable, extra="allow"):
    """A cost of a class of the user's own."""


class NamedCost(CostTable):
    """A cost with a name."""

    name: Text = key("Its name in reports; by default what it is, in words.")


class WeightedCost(NamedCost):
    """A cost with a weight of each joint."""

    weight: Numbers = key(
        "W: a multiple of the identity, a diagonal, or a symmetric positive semidefinite matrix.",
        1.0,
    )


class MultipliedCost(NamedCost):
    """A cost with a factor."""

    mu: Number = key("μ ≥ 0.", 1.0)


class DirectionalManipulabilityCost(MultipliedCost):
    """Ease of motion along one direction: G = μ uᵀ(JJᵀ)⁻¹u."""

    kind: Literal["DirectionalManipulability"]
    direction: Numbers = needed("u, in the task's rows; its length does not matter.")


class FunctionTable(CostTable):
    """A function of the user's own."""

    kind: Literal["function"]
    code: Text = needed("`module:attribute` of a function of samples; read with --allow-code.")
    name: Text = key("What reports call it.")

    def build(self, context: Context) -> Cost:
        """Return the function as a cost."""
        function = context.functions[self.code]
        return FunctionCost(function, name=self.name or getattr(function, "__name__", FUNCTION))


class GravityTorqueCost(NamedCost):
    """Torque that holds the arm against gravity: G = ½ gᵀWg [N²m²]."""

    kind: Literal["GravityTorque"]
    weight: Numbers = key("W; for example 1 / robot torque limit² as a diagonal.", 1.0)


class InverseManipulabilityCost(MultipliedCost):
    """Distance from singular poses, as used by the paper: G = μ / det(JJᵀ), eq. 12."""

    kind: Literal["InverseManipulability"]


class JointAccelerationCost(WeightedCost):
    """Joint acceleration: G = ½ q̈ᵀWq̈ [rad²/s⁴], q̈ by five-point differences of q̇."""

    kind: Literal["JointAcceleration"]


class JointJerkCost(WeightedCost):
    """Joint jerk: G = ½ q⃛ᵀWq⃛ [rad²/s⁶], q⃛ by five-point differences of q̇."""

    kind: Literal["JointJerk"]


class JointLimitDistanceCost(MultipliedCost):
    """Distance from the joint limits: G = μ Σ_i ((q_i - c_i) / h_i)^p."""

    kind: Literal["JointLimitDistance"]
    lower: Joints = key("Lower limits [rad or m]; by default those of the arm's URDF.")
    upper: Joints = key("Upper limits [rad or m]; by default those of the arm's URDF.")
    power: Whole = key("p, even.", 6)


class JointReversalsCost(NamedCost):
    """Changes of direction of the joints: G = w / π Σ_i (√(u_i² + δ²) - δ) [1/s]."""

    kind: Literal["JointReversals"]
    weight: Number = key("w, the cost of a reversal.", 1.0)
    speed: LengthOrAngle = key("v [rad/s or m/s]: a joint that is slower nearly rests.", 0.02)
    smoothing: Number = key("δ [1/s]: changes slower than that cost next to nothing.", 0.05)


class JointVelocityCost(WeightedCost):
    """Joint speed: G = ½ q̇ᵀWq̇ [rad²/s²], the first term of the paper's eq. 11 and 12.

    Without a weight it is that of `JointVelocity.usual`, in which a metre of a joint that slides
    counts as so many radians.
    """

    kind: Literal["JointVelocity"]


class KineticEnergyCost(MultipliedCost):
    """Kinetic energy of the arm: G = μ ½ q̇ᵀM(q)q̇ [J]."""

    kind: Literal["KineticEnergy"]


class LimitUseCost(NamedCost):
    """Use of limits by the fastest joint: G = (Σ|q̇ᵢ/vᵢ|ᵖ + Σ|q̈ᵢ/aᵢ|^(p/2))^(1/p)."""

    kind: Literal["LimitUse"]
    velocity: Rates = needed("v [rad/s or m/s].")
    acceleration: Rates = key("a [rad/s² or m/s²]; by default none.", math.inf)
    power: Number = key("p, at least 4.", 8.0)


class ManipulabilityCost(MultipliedCost):
    """Yoshikawa's manipulability, to be large: G = -μ w with w = √det(JJᵀ), eq. 9 to 11."""

    kind: Literal["Manipulability"]


class PathLengthCost(NamedCost):
    """Length of the joint path, joint by joint: G = Σ_i w_i (√(q̇_i² + δ²) - δ) [rad/s]."""

    kind: Literal["PathLength"]
    smoothing: Angle = key("δ [rad/s]; the integral is too small by at most nδT.", 0.01)
    joint_weights: Numbers = key(
        "w ≥ 0, such as `RobotModel.joint_weights`; 1 for every joint by default, which adds up "
        "radians only: an arm with prismatic joints has to be given some."
    )


class PostureCost(WeightedCost):
    """Distance from a posture: G = ½ (q - q*)ᵀW(q - q*) [rad²]."""

    kind: Literal["Posture"]
    posture: Joints = key("q* [rad or m].")


class ScaledCost(CostTable):
    """Another cost, G times a factor."""

    kind: Literal["Scaled"]
    cost: "AnyCost" = needed("The other cost.")
    factor: Number = needed("Factor of the cost.")

    def build(self, context: Context) -> Cost:
        """Return the other cost with the factor."""
        return Scaled(self.cost.build(context), self.factor)


class SmallestSingularValueCost(MultipliedCost):
    """Distance from the nearest singular pose: G = μ (Σ σ_i^-2p)^(1/2p), about μ / σ_min."""

    kind: Literal["SmallestSingularValue"]
    power: Whole = key("p ≥ 1; larger is nearer to 1/σ_min.", 4)


class TowardsCost(NamedCost):
    """Distance of a coordinate from a value: G = ½ w (c(q) - c*)², the short way round."""

    kind: Literal["Towards"]
    coordinate: AnyTable = needed("`JointCoordinate`, `FrameCoordinate` or `SwivelAngle`.")
    target: LengthOrAngle = needed("c* [rad or m].")
    weight: Number = key("w ≥ 0.", 1.0)


COSTS = OneOf(
    "kind",
    lambda: (
        *(DirectionalManipulabilityCost, FunctionTable, GravityTorqueCost),
        *(InverseManipulabilityCost, JointAccelerationCost, JointJerkCost, JointLimitDistanceCost),
        *(JointReversalsCost, JointVelocityCost, KineticEnergyCost, LimitUseCost),
        *(ManipulabilityCost, PathLengthCost, PostureCost, ScaledCost),
        *(SmallestSingularValueCost, TowardsCost),
    ),
    OwnCost,
    Cost.kinds,
)
AnyCost = Annotated[CostTable, COSTS]


class NullMotionTable(Table):
    """Which functions of time the self-motion may be."""

    kind: str

    def build(self, _context: Context) -> NullMotion:
        """Return the null motion."""
        found: NullMotion = restore(NullMotion, self.given)
        return found


class OwnNullMotion(NullMotionTable, extra="allow"):
    """A null motion of a class of the user's own."""


class BSplineTable(NullMotionTable):
    """ε(t) as a B-spline with equal intervals: for long paths, where a polynomial is too stiff."""

    kind: Literal["BSplineNullMotion"]
    intervals: Whole = key("Number of polynomial pieces, ≥ 1.", 8)
    degree: Whole = key("p ≥ 0; C^(p-1) between pieces.", 3)
    space: Text = key("As in `PolynomialNullMotion`.", "null")


class FreeTable(NullMotionTable):
    """Any ε(t): the motion is optimised at nodes, as many as its cost needs."""

    kind: Literal["FreeNullMotion"]


class NodesTable(NullMotionTable):
    """ε(t) by its values at nodes, with a cubic spline between: that of a finished plan."""

    kind: Literal["NodeNullMotion"]
    times: Numbers = key("Of the nodes, as shares of the duration, from 0 to 1.")
    space: Text = key('"null": E is (r, K) in a null-space basis; "joint": E is (n, K).', "joint")


class PolynomialTable(NullMotionTable):
    """ε(t) as a polynomial in time."""

    kind: Literal["PolynomialNullMotion"]
    degree: Whole = key("p ≥ 0.", 3)
    space: Text = key('"null": E has a row per null-space direction; "joint": per joint.', "null")
    basis: Text = key(
        '"legendre": orthonormal polynomials, ∫ φ_i φ_j dt = δ_ij; or "monomial": t^k [s^k].',
        "legendre",
    )


NULL_MOTIONS = OneOf(
    "kind",
    lambda: (BSplineTable, FreeTable, NodesTable, PolynomialTable),
    OwnNullMotion,
    NullMotion.kinds,
)
AnyNullMotion = Annotated[NullMotionTable, NULL_MOTIONS]

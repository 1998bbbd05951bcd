"""Plans the self-motion of redundant arms along a prescribed tool motion.

The tool motion holds by construction; what is optimised is the self-motion, the joint motion in
the null space of the task.
"""

from selfmotion.baselines import (
    DampedLeastSquares,
    ExtendedJacobian,
    GradientProjection,
    LagrangianOptimum,
    Method,
    Motion,
    PseudoInverse,
)
from selfmotion.certificate import Certificate, Extreme, Requirements, Tolerance, certify
from selfmotion.collision import Box, Capsule, CollisionModel, Cylinder, Mesh, Sphere
from selfmotion.constraints import (
    Clearance,
    ClosedPath,
    Constraint,
    EndConfiguration,
    EndVelocity,
    JointAccelerationLimits,
    JointPositionLimits,
    JointVelocityLimits,
)
from selfmotion.costs import (
    Cost,
    DirectionalManipulability,
    FunctionCost,
    GravityTorque,
    InverseManipulability,
    JointAcceleration,
    JointJerk,
    JointLimitDistance,
    JointVelocity,
    KineticEnergy,
    Manipulability,
    Partials,
    PathLength,
    Posture,
    SmallestSingularValue,
)
from selfmotion.damping import Damping
from selfmotion.errors import (
    BreakdownError,
    FileFormatError,
    InverseKinematicsError,
    NoSequenceError,
    PathError,
    PlanError,
    ProblemError,
    RedundancyError,
    RenderError,
    RobotError,
    SelfmotionError,
    StartError,
)
from selfmotion.line_search import LineSearch
from selfmotion.null_motion import BSplineNullMotion, NullMotion, PolynomialNullMotion
from selfmotion.path import Circle, Line, Path, Retimed, TwistPath, Waypoints
from selfmotion.plan import Gap, Plan, Report, load_plan
from selfmotion.planner import plan
from selfmotion.problem import Problem
from selfmotion.quasi_newton import Iteration, QuasiNewton, Status
from selfmotion.relaxation import Relaxation
from selfmotion.retiming import retime, slowdown
from selfmotion.robot import NAMED_ARMS, RobotModel, load_robot
from selfmotion.sample import sample_problem
from selfmotion.task import Task
from selfmotion.trajectory import Trajectory

__all__ = [
    "NAMED_ARMS",
    "BSplineNullMotion",
    "Box",
    "BreakdownError",
    "Capsule",
    "Certificate",
    "Circle",
    "Clearance",
    "ClosedPath",
    "CollisionModel",
    "Constraint",
    "Cost",
    "Cylinder",
    "DampedLeastSquares",
    "Damping",
    "DirectionalManipulability",
    "EndConfiguration",
    "EndVelocity",
    "ExtendedJacobian",
    "Extreme",
    "FileFormatError",
    "FunctionCost",
    "Gap",
    "GradientProjection",
    "GravityTorque",
    "InverseKinematicsError",
    "InverseManipulability",
    "Iteration",
    "JointAcceleration",
    "JointAccelerationLimits",
    "JointJerk",
    "JointLimitDistance",
    "JointPositionLimits",
    "JointVelocity",
    "JointVelocityLimits",
    "KineticEnergy",
    "LagrangianOptimum",
    "Line",
    "LineSearch",
    "Manipulability",
    "Mesh",
    "Method",
    "Motion",
    "NoSequenceError",
    "NullMotion",
    "Partials",
    "Path",
    "PathError",
    "PathLength",
    "Plan",
    "PlanError",
    "PolynomialNullMotion",
    "Posture",
    "Problem",
    "ProblemError",
    "PseudoInverse",
    "QuasiNewton",
    "RedundancyError",
    "Relaxation",
    "RenderError",
    "Report",
    "Requirements",
    "Retimed",
    "RobotError",
    "RobotModel",
    "SelfmotionError",
    "SmallestSingularValue",
    "Sphere",
    "StartError",
    "Status",
    "Task",
    "Tolerance",
    "Trajectory",
    "TwistPath",
    "Waypoints",
    "certify",
    "load_plan",
    "load_robot",
    "plan",
    "retime",
    "sample_problem",
    "slowdown",
]

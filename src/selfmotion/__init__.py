"""Plans the self-motion of redundant arms along a prescribed tool motion.

The tool motion holds by construction; what is optimised is the self-motion, the joint motion in
the null space of the task.
"""

from typing import TYPE_CHECKING, Any

from selfmotion.baselines import (
    DampedLeastSquares,
    ExtendedJacobian,
    GradientProjection,
    LagrangianOptimum,
    Method,
    Motion,
    PseudoInverse,
    plan_by,
)
from selfmotion.basics import (
    BreakdownError,
    CollisionError,
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
from selfmotion.batch import (
    Batch,
    plan_many,
)
from selfmotion.certificate import (
    Certificate,
    Extreme,
    Finding,
    FinishedMotion,
    Requirement,
    Tolerance,
    certify,
)
from selfmotion.collision import (
    Box,
    Capsule,
    CollisionModel,
    Cylinder,
    Mesh,
    Obstacle,
    Sphere,
)
from selfmotion.constraints import (
    Band,
    Binding,
    BoundConstraint,
    Clearance,
    ClosedPath,
    Constraint,
    EndAcceleration,
    EndConfiguration,
    EndVelocity,
    Envelope,
    JointAccelerationLimits,
    JointJerkLimits,
    JointPositionLimits,
    JointTorqueLimits,
    JointVelocityLimits,
    NodeTangents,
    StartAcceleration,
    StartVelocity,
    ToolLimits,
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
    LimitUse,
    Manipulability,
    Partials,
    PathLength,
    Posture,
    Samples,
    SmallestSingularValue,
    Towards,
)
from selfmotion.follow import Follow, Follows
from selfmotion.formats import (
    Job,
    read_job,
    read_joint_limits,
    read_motion,
    read_path,
    read_problem,
    write_motion,
    write_problem,
)
from selfmotion.motion import (
    BSplineNullMotion,
    NullMotion,
    PolynomialNullMotion,
    RefinedNullMotion,
    Trajectory,
)
from selfmotion.optimise import (
    Function,
    Iteration,
    LineSearch,
    Minimum,
    Optimizer,
    QuasiNewton,
    Status,
)
from selfmotion.path import (
    Circle,
    Dwell,
    Feed,
    Joined,
    Line,
    Path,
    PathSamples,
    Placed,
    Polyline,
    Ramped,
    Retimed,
    Section,
    TwistPath,
    Waypoints,
    with_leads,
)
from selfmotion.planning import (
    Fastest,
    Search,
    fastest,
    plan,
    plan_in_parts,
)
from selfmotion.problem import Problem, sample_problem
from selfmotion.result import Gap, Move, Parts, Plan, Report, load_plan, retime, slowdown
from selfmotion.robot import (
    NAMED_ARMS,
    Coordinate,
    FrameCoordinate,
    JointCoordinate,
    RobotModel,
    SwivelAngle,
    load_robot,
)
from selfmotion.task import (
    Damping,
    Relaxation,
    Task,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from selfmotion.realtime import Replanner, warm_up

__all__ = [
    "NAMED_ARMS",
    "BSplineNullMotion",
    "Band",
    "Batch",
    "Binding",
    "BoundConstraint",
    "Box",
    "BreakdownError",
    "Capsule",
    "Certificate",
    "Circle",
    "Clearance",
    "ClosedPath",
    "CollisionError",
    "CollisionModel",
    "Constraint",
    "Coordinate",
    "Cost",
    "Cylinder",
    "DampedLeastSquares",
    "Damping",
    "DirectionalManipulability",
    "Dwell",
    "EndAcceleration",
    "EndConfiguration",
    "EndVelocity",
    "Envelope",
    "ExtendedJacobian",
    "Extreme",
    "Fastest",
    "Feed",
    "FileFormatError",
    "Finding",
    "FinishedMotion",
    "Follow",
    "Follows",
    "FrameCoordinate",
    "Function",
    "FunctionCost",
    "Gap",
    "GradientProjection",
    "GravityTorque",
    "InverseKinematicsError",
    "InverseManipulability",
    "Iteration",
    "Job",
    "Joined",
    "JointAcceleration",
    "JointAccelerationLimits",
    "JointCoordinate",
    "JointJerk",
    "JointJerkLimits",
    "JointLimitDistance",
    "JointPositionLimits",
    "JointTorqueLimits",
    "JointVelocity",
    "JointVelocityLimits",
    "KineticEnergy",
    "LagrangianOptimum",
    "LimitUse",
    "Line",
    "LineSearch",
    "Manipulability",
    "Mesh",
    "Method",
    "Minimum",
    "Motion",
    "Move",
    "NoSequenceError",
    "NodeTangents",
    "NullMotion",
    "Obstacle",
    "Optimizer",
    "Partials",
    "Parts",
    "Path",
    "PathError",
    "PathLength",
    "PathSamples",
    "Placed",
    "Plan",
    "PlanError",
    "Polyline",
    "PolynomialNullMotion",
    "Posture",
    "Problem",
    "ProblemError",
    "PseudoInverse",
    "QuasiNewton",
    "Ramped",
    "RedundancyError",
    "RefinedNullMotion",
    "Relaxation",
    "RenderError",
    "Replanner",
    "Report",
    "Requirement",
    "Retimed",
    "RobotError",
    "RobotModel",
    "Samples",
    "Search",
    "Section",
    "SelfmotionError",
    "SmallestSingularValue",
    "Sphere",
    "StartAcceleration",
    "StartError",
    "StartVelocity",
    "Status",
    "SwivelAngle",
    "Task",
    "Tolerance",
    "ToolLimits",
    "Towards",
    "Trajectory",
    "TwistPath",
    "Waypoints",
    "certify",
    "fastest",
    "load_plan",
    "load_robot",
    "plan",
    "plan_by",
    "plan_in_parts",
    "plan_many",
    "read_job",
    "read_joint_limits",
    "read_motion",
    "read_path",
    "read_problem",
    "retime",
    "sample_problem",
    "slowdown",
    "warm_up",
    "with_leads",
    "write_motion",
    "write_problem",
]


def __getattr__(name: str) -> Any:
    """Return what is imported when it is first asked for: not every plan is made in a loop."""
    if name in ("Replanner", "warm_up"):
        from selfmotion import realtime

        return getattr(realtime, name)
    raise AttributeError(f"module 'selfmotion' has no attribute '{name}'")


class _Views:
    """Shows plans by the replay, which is imported when the first one is shown."""

    def notebook_html(self, plan: Plan) -> str:
        from selfmotion.replay import notebook_html

        return notebook_html(plan)

    def figure(self, plan: Plan) -> "Figure":
        from selfmotion.replay import figure

        return figure(plan)


Plan.views = _Views()

"""Plans the self-motion of redundant arms along a prescribed tool motion.

The tool motion holds by construction; what is optimised is the self-motion, the joint motion in
the null space of the task.
"""

from typing import TYPE_CHECKING, Any

from selfmotion.baselines import (
    DampedLeastSquares as DampedLeastSquares,
    ExtendedJacobian as ExtendedJacobian,
    GradientProjection as GradientProjection,
    LagrangianOptimum as LagrangianOptimum,
    Method as Method,
    Motion as Motion,
    PseudoInverse as PseudoInverse,
    plan_by as plan_by,
)
from selfmotion.basics import (
    BreakdownError as BreakdownError,
    CollisionError as CollisionError,
    FeedError as FeedError,
    FileFormatError as FileFormatError,
    InverseKinematicsError as InverseKinematicsError,
    NoSequenceError as NoSequenceError,
    PathError as PathError,
    PlanError as PlanError,
    ProblemError as ProblemError,
    RedundancyError as RedundancyError,
    RenderError as RenderError,
    RobotError as RobotError,
    SelfmotionError as SelfmotionError,
    StartError as StartError,
)
from selfmotion.batch import Batch as Batch, plan_many as plan_many
from selfmotion.certificate import (
    Certificate as Certificate,
    Column as Column,
    Extreme as Extreme,
    Finding as Finding,
    FinishedMotion as FinishedMotion,
    Quantity as Quantity,
    Requirement as Requirement,
    Tolerance as Tolerance,
    certify as certify,
)
from selfmotion.collision import (
    Box as Box,
    Capsule as Capsule,
    CollisionModel as CollisionModel,
    Cylinder as Cylinder,
    Mesh as Mesh,
    Obstacle as Obstacle,
    Sphere as Sphere,
)
from selfmotion.constraints import (
    Band as Band,
    Binding as Binding,
    BoundConstraint as BoundConstraint,
    Clearance as Clearance,
    ClosedPath as ClosedPath,
    Constraint as Constraint,
    EndAcceleration as EndAcceleration,
    EndConfiguration as EndConfiguration,
    EndVelocity as EndVelocity,
    Envelope as Envelope,
    JointAccelerationLimits as JointAccelerationLimits,
    JointJerkLimits as JointJerkLimits,
    JointPositionLimits as JointPositionLimits,
    JointTorqueLimits as JointTorqueLimits,
    JointVelocityLimits as JointVelocityLimits,
    NodeTangents as NodeTangents,
    StartAcceleration as StartAcceleration,
    StartVelocity as StartVelocity,
    Tilt as Tilt,
    ToolLimits as ToolLimits,
)
from selfmotion.costs import (
    Cost as Cost,
    DirectionalManipulability as DirectionalManipulability,
    FunctionCost as FunctionCost,
    GravityTorque as GravityTorque,
    InverseManipulability as InverseManipulability,
    JointAcceleration as JointAcceleration,
    JointJerk as JointJerk,
    JointLimitDistance as JointLimitDistance,
    JointReversals as JointReversals,
    JointVelocity as JointVelocity,
    KineticEnergy as KineticEnergy,
    LimitUse as LimitUse,
    Manipulability as Manipulability,
    Partials as Partials,
    PathLength as PathLength,
    Posture as Posture,
    Samples as Samples,
    SmallestSingularValue as SmallestSingularValue,
    Towards as Towards,
)
from selfmotion.follow import Follow as Follow, Follows as Follows
from selfmotion.formats import (
    Job as Job,
    ProgramSettings as ProgramSettings,
    SeamJob as SeamJob,
    read_job as read_job,
    read_joint_limits as read_joint_limits,
    read_motion as read_motion,
    read_parts as read_parts,
    read_path as read_path,
    read_problem as read_problem,
    read_program_settings as read_program_settings,
    read_seam_job as read_seam_job,
    write_motion as write_motion,
    write_parts as write_parts,
    write_problem as write_problem,
)
from selfmotion.job import (
    Program as Program,
    Seam as Seam,
    Specification as Specification,
    Step as Step,
    load_program as load_program,
    plan_job as plan_job,
)
from selfmotion.margins import (
    Displacement as Displacement,
    Margin as Margin,
    Margins as Margins,
    Shortfall as Shortfall,
    SubjectMargin as SubjectMargin,
    margin as margin,
)
from selfmotion.motion import (
    BSplineNullMotion as BSplineNullMotion,
    FreeNullMotion as FreeNullMotion,
    NodeNullMotion as NodeNullMotion,
    NullMotion as NullMotion,
    PolynomialNullMotion as PolynomialNullMotion,
    Trajectory as Trajectory,
)
from selfmotion.optimise import (
    Function as Function,
    Iteration as Iteration,
    LineSearch as LineSearch,
    Minimum as Minimum,
    Optimizer as Optimizer,
    QuasiNewton as QuasiNewton,
    Status as Status,
)
from selfmotion.path import (
    Circle as Circle,
    Dwell as Dwell,
    Feed as Feed,
    Joined as Joined,
    Line as Line,
    Path as Path,
    PathSamples as PathSamples,
    Placed as Placed,
    Polyline as Polyline,
    Retimed as Retimed,
    Reversed as Reversed,
    Section as Section,
    Spiral as Spiral,
    TwistPath as TwistPath,
    Waypoints as Waypoints,
    Weave as Weave,
    section_at_rest as section_at_rest,
    with_leads as with_leads,
)
from selfmotion.placement import (
    BoughtMargin as BoughtMargin,
    Corner as Corner,
    Correction as Correction,
    CorrectionSide as CorrectionSide,
    PlaceMap as PlaceMap,
    Placement as Placement,
    Tried as Tried,
    correction as correction,
    place as place,
    plan_with_margin as plan_with_margin,
)
from selfmotion.planning import (
    Fastest as Fastest,
    Search as Search,
    fastest as fastest,
    plan as plan,
    plan_in_parts as plan_in_parts,
)
from selfmotion.problem import (
    Problem as Problem,
    calibrated as calibrated,
    off_nominal as off_nominal,
    sample_problem as sample_problem,
)
from selfmotion.result import (
    Attempt as Attempt,
    Gap as Gap,
    LimitsUsed as LimitsUsed,
    Move as Move,
    Parts as Parts,
    Plan as Plan,
    Report as Report,
    load_move as load_move,
    load_parts as load_parts,
    load_plan as load_plan,
    retime as retime,
    slowdown as slowdown,
)
from selfmotion.robot import (
    NAMED_ARMS as NAMED_ARMS,
    Coordinate as Coordinate,
    FrameCoordinate as FrameCoordinate,
    JointCoordinate as JointCoordinate,
    RobotModel as RobotModel,
    SwivelAngle as SwivelAngle,
    load_robot as load_robot,
)
from selfmotion.sheet import write_sheet as write_sheet
from selfmotion.task import Damping as Damping, Relaxation as Relaxation, Task as Task
from selfmotion.transfer import move as move

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from selfmotion.realtime import Replanner as Replanner, warm_up as warm_up


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

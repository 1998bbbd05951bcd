"""Plans the self-motion of redundant arms along a prescribed tool motion.

The tool motion holds by construction; what is optimised is the self-motion, the joint motion in
the null space of the task.
"""

from selfmotion.certificate import Certificate, Extreme, Tolerance, certify
from selfmotion.costs import (
    Cost,
    FunctionCost,
    InverseManipulability,
    JointVelocity,
    Manipulability,
)
from selfmotion.errors import (
    BreakdownError,
    FileFormatError,
    InverseKinematicsError,
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
from selfmotion.null_motion import NullMotion, PolynomialNullMotion
from selfmotion.path import Circle, Line, Path, TwistPath, Waypoints
from selfmotion.plan import Plan, Report, load_plan
from selfmotion.planner import plan
from selfmotion.problem import Problem
from selfmotion.quasi_newton import Iteration, QuasiNewton, Status
from selfmotion.robot import NAMED_ARMS, RobotModel, load_robot
from selfmotion.sample import sample_problem
from selfmotion.task import Task
from selfmotion.trajectory import Trajectory

__all__ = [
    "NAMED_ARMS",
    "BreakdownError",
    "Certificate",
    "Circle",
    "Cost",
    "Extreme",
    "FileFormatError",
    "FunctionCost",
    "InverseKinematicsError",
    "InverseManipulability",
    "Iteration",
    "JointVelocity",
    "Line",
    "LineSearch",
    "Manipulability",
    "NullMotion",
    "Path",
    "PathError",
    "Plan",
    "PlanError",
    "PolynomialNullMotion",
    "Problem",
    "ProblemError",
    "QuasiNewton",
    "RedundancyError",
    "RenderError",
    "Report",
    "RobotError",
    "RobotModel",
    "SelfmotionError",
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
    "sample_problem",
]

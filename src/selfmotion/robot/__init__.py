"""The arm: a URDF loaded into Pinocchio as a chain with one coordinate per joint."""

from selfmotion.robot.chain import Flags, compose, placements
from selfmotion.robot.chain_series import ChainSeries
from selfmotion.robot.coordinates import Coordinate, FrameCoordinate, JointCoordinate, SwivelAngle
from selfmotion.robot.dynamics import Dynamics
from selfmotion.robot.kinematics import ToolKinematics
from selfmotion.robot.loading import NAMED_ARMS, load_robot, rebuild_robot
from selfmotion.robot.model import RobotModel
from selfmotion.robot.mounting import Mounting, mounting_of
from selfmotion.robot.null_space import null_basis, null_space
from selfmotion.robot.tool_rates import ToolRates
from selfmotion.robot.urdf import Urdf, UrdfJoint

__all__ = [
    "NAMED_ARMS",
    "ChainSeries",
    "Coordinate",
    "Dynamics",
    "Flags",
    "FrameCoordinate",
    "JointCoordinate",
    "Mounting",
    "RobotModel",
    "SwivelAngle",
    "ToolKinematics",
    "ToolRates",
    "Urdf",
    "UrdfJoint",
    "compose",
    "load_robot",
    "mounting_of",
    "null_basis",
    "null_space",
    "placements",
    "rebuild_robot",
]

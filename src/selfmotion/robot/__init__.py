"""The arm: a URDF loaded into Pinocchio as a chain with one coordinate per joint."""

from selfmotion.robot.chain import Chain, ChainArrays, Kinematics, null_space
from selfmotion.robot.chain_series import ChainSeries
from selfmotion.robot.coordinates import Coordinate, FrameCoordinate, JointCoordinate, SwivelAngle
from selfmotion.robot.dynamics import Dynamics
from selfmotion.robot.loading import NAMED_ARMS, load_robot, rebuild_robot
from selfmotion.robot.model import RobotModel
from selfmotion.robot.mounting import Mounting, mounting_of
from selfmotion.robot.placements import Flags, compose, placements
from selfmotion.robot.tool_rates import ToolRates
from selfmotion.robot.urdf import Urdf, UrdfJoint

__all__ = [
    "NAMED_ARMS",
    "Chain",
    "ChainArrays",
    "ChainSeries",
    "Coordinate",
    "Dynamics",
    "Flags",
    "FrameCoordinate",
    "JointCoordinate",
    "Kinematics",
    "Mounting",
    "RobotModel",
    "SwivelAngle",
    "ToolRates",
    "Urdf",
    "UrdfJoint",
    "compose",
    "load_robot",
    "mounting_of",
    "null_space",
    "placements",
    "rebuild_robot",
]

"""The arm: a URDF loaded into Pinocchio as a chain with one coordinate per joint."""

from selfmotion.robot.loading import NAMED_ARMS, load_robot, rebuild_robot
from selfmotion.robot.model import RobotModel

__all__ = ["NAMED_ARMS", "RobotModel", "load_robot", "rebuild_robot"]

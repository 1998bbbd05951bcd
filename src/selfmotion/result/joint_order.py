"""Motions with their joints in the order of the robot."""

from selfmotion.motion import Trajectory
from selfmotion.robot import RobotModel


def in_order_of(robot: RobotModel, motion: Trajectory) -> Trajectory:
    """Return a motion in the robot's order of joints; one of other joints as it is."""
    names = robot.joint_names
    if motion.joint_names == names or set(motion.joint_names) != set(names):
        return motion
    return motion.of_joints(names)

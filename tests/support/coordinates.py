"""Coordinates of a Panda, one of each kind."""

import selfmotion as sm

COORDINATES = {
    "joint": sm.robot.JointCoordinate("panda_joint3"),
    "height": sm.robot.FrameCoordinate("panda_link4"),
    "aside": sm.robot.FrameCoordinate("panda_hand", [1.0, 2.0, 0.0]),
    "swivel": sm.robot.SwivelAngle(),
    "swivel from the side": sm.robot.SwivelAngle([0.2, 1.0, 0.1], elbow="panda_link4"),
}

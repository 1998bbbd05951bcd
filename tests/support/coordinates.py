"""Coordinates of a Panda, one of each kind."""

import selfmotion as sm

COORDINATES = {
    "joint": sm.JointCoordinate("panda_joint3"),
    "height": sm.FrameCoordinate("panda_link4"),
    "aside": sm.FrameCoordinate("panda_hand", [1.0, 2.0, 0.0]),
    "swivel": sm.SwivelAngle(),
    "swivel from the side": sm.SwivelAngle([0.2, 1.0, 0.1], elbow="panda_link4"),
}

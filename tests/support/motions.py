"""Motions of known extremes."""

import selfmotion as sm
from selfmotion.basics import Array
from support.arms import robot_named


def motion_of(
    q: Array | list[list[float]], qd: Array | list[list[float]], t: list[float] | None = None
) -> sm.certificate.FinishedMotion:
    """Return a motion of the planar arm, by default in 1 s steps."""
    robot = robot_named("planar_3r")
    times = [float(k) for k in range(len(q))] if t is None else t
    return sm.certificate.FinishedMotion(robot, sm.Trajectory(times, q, qd, robot.joint_names))

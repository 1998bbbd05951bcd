"""Everything compiled and allocated before the arm moves."""

import numpy as np

from selfmotion.path import Line
from selfmotion.realtime.replanner import Replanner
from selfmotion.task import SE3

# Steps until what a step needs is made: the first ones begin a plan, the others shift it.
_STEPS = 5


def warm_up(replanner: Replanner) -> None:
    """Let a replanner do all that it may have to do, and forget it: no step compiles later.

    Kernels are compiled once per machine and loaded once per process, which takes seconds where
    the first step of a moving arm would wait for it.

    Parameters
    ----------
    replanner : Replanner
        As it will be used; it must not have begun.
    """
    robot = replanner.robot
    q = robot.dexterous_configuration(replanner.task)
    pose = robot.pose(q)
    later = SE3(pose.rotation, pose.translation + np.array([0.0, 0.0, 0.01]))
    far = SE3(pose.rotation, pose.translation + 10.0 * robot.reach)
    still = np.zeros(robot.dof)
    # On the path, then without a state, then towards what is out of reach.
    for goal, measured in ((later, q), (later, np.full(robot.dof, np.nan)), (far, q)):
        replanner.reset()
        path = Line(pose, goal, 1.0)
        replanner.step(0.0, q, still, path)
        for k in range(1, _STEPS):
            replanner.step(k * replanner.period, measured, still, path)
    replanner.reset()

"""Plans to replay, made once per test run."""

from functools import cache

import selfmotion as sm


@cache
def planar_plan(mu: float = 1.0) -> sm.Plan:
    """The paper's sample problem, there and back in two seconds."""
    return sm.plan(sm.sample_problem(mu=mu, duration=2.0))


@cache
def arm_plan(name: str) -> sm.Plan:
    """A vertical circle of 0.1 m in four seconds."""
    robot = sm.load_robot(name)
    task = sm.Task.POSE if robot.dof > 6 else sm.Task.POSITION
    start = robot.dexterous_configuration(task)
    path = sm.Circle.around(robot.pose(start), 0.1, 4.0, normal=(1.0, 0.0, 0.0))
    return sm.plan(sm.Problem(robot, path, task, start))

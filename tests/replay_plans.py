"""Plans to replay, made once per test run."""

from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace

import numpy as np
import pinocchio as pin

import selfmotion as sm


@cache
def planar_plan(mu: float = 1.0) -> sm.Plan:
    """The paper's sample problem, there and back in two seconds."""
    return sm.plan(sm.sample_problem(mu=mu, duration=2.0))


@cache
def arm_plan(name: str) -> sm.Plan:
    """A vertical circle of 6 cm in four seconds: small enough for the smallest arm."""
    robot = sm.load_robot(name)
    task = sm.Task.POSE if robot.dof > 6 else sm.Task.POSITION
    start = robot.dexterous_configuration(task)
    path = sm.Circle.around(robot.pose(start), 0.06, 4.0, normal=(1.0, 0.0, 0.0))
    return sm.plan(sm.Problem(robot, path, task, start))


@dataclass(frozen=True)
class Clearance:
    value: float
    first: str
    second: str


class Shelf:
    """A stand-in for a collision model: one obstacle of each shape below the tool's path."""

    def __init__(self, plan: sm.Plan) -> None:
        self.robot = plan.robot
        middle = plan.path.samples(np.linspace(0, plan.path.duration, 9)).translation.mean(axis=0)
        below = pin.SE3(np.eye(3), middle - [0.0, 0.0, 0.3])
        self.start = plan.path.pose(0.0).translation
        self.height = below.translation[2]
        file = plan.robot.geometry(pin.GeometryType.VISUAL).geometryObjects[0].meshPath
        self.obstacles = (
            SimpleNamespace(shape="box", name="shelf", pose=below, size=np.array([0.3, 0.4, 0.02])),
            SimpleNamespace(shape="sphere", name="ball", pose=below, radius=0.05),
            SimpleNamespace(shape="cylinder", name="post", pose=below, radius=0.03, length=0.4),
            SimpleNamespace(shape="capsule", name="a/b", pose=below, radius=0.02, length=0.2),
            SimpleNamespace(shape="mesh", name="part", pose=below, file=file, scale=0.5),
        )

    def distance(self, q: np.ndarray) -> Clearance:
        tool = self.robot.pose(q).translation
        other = "shelf" if np.linalg.norm(tool - self.start) < 0.06 else "a/b"
        return Clearance(float(tool[2] - self.height), "panda_hand", other)

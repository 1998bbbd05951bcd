"""Plans to replay, made without the planner: tool motions followed by the pseudo-inverse."""

from dataclasses import dataclass
from enum import Enum
from functools import cache

import numpy as np
import pinocchio as pin

from selfmotion.robot import RobotModel, load_robot
from selfmotion.task import Task
from selfmotion.trajectory import Trajectory


class Status(Enum):
    CONVERGED = "converged"


@dataclass(frozen=True)
class Extreme:
    value: float
    time: float
    name: str


@dataclass(frozen=True)
class Report:
    cost: float = 3.25
    initial_cost: float = 4.5
    terms: tuple = ()
    initial_terms: tuple = ()
    evaluations: int = 7
    gradient_evaluations: int = 6
    jacobian_evaluations: int = 2814
    iterations: int = 5
    status: Status = Status.CONVERGED
    message: str = "the gradient is below its tolerance"
    seconds: float = 0.0125
    steps: int = 400


@dataclass(frozen=True)
class Certificate:
    verified: bool = True
    verdict: str = "verified: at most 3.2e-10 m and 7.1e-10 rad off the path"
    position_error: Extreme = Extreme(3.2e-10, 0.52, "")
    rotation_error: Extreme = Extreme(7.1e-10, 1.31, "")
    limit_margin: Extreme = Extreme(0.412, 1.5, "joint 4")
    velocity_ratio: Extreme = Extreme(0.46, 0.2, "joint 2")
    smallest_singular_value: Extreme = Extreme(0.183, 0.9, "")
    closure: float = 0.0021
    samples: int = 2001


@dataclass(frozen=True)
class Samples:
    translation: np.ndarray
    rotation: np.ndarray
    twist: np.ndarray


class ToolMotion:
    """An ellipse about a centre at constant orientation, `turns` of it in `duration`."""

    def __init__(self, center, semi_axes, rotation, duration, turns=1.0):
        self.center, self.axes = np.asarray(center), np.asarray(semi_axes)
        self.rotation, self.duration, self.turns = np.asarray(rotation), duration, turns

    def samples(self, t):
        angle = 2 * np.pi * self.turns * np.asarray(t) / self.duration
        rate = 2 * np.pi * self.turns / self.duration
        cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
        twist = np.zeros((len(angle), 6))
        twist[:, :3] = rate * (cosine * self.axes[1] - sine * self.axes[0])
        return Samples(
            self.center + cosine * self.axes[0] + sine * self.axes[1],
            np.broadcast_to(self.rotation, (len(angle), 3, 3)),
            twist,
        )

    def pose(self, t):
        here = self.samples([t])
        return pin.SE3(self.rotation, here.translation[0])


@dataclass(frozen=True)
class Plan:
    robot: RobotModel
    path: ToolMotion
    task: Task
    trajectory: Trajectory
    initial_trajectory: Trajectory | None
    report: Report
    certificate: Certificate
    coefficients: np.ndarray
    obstacles: tuple = ()


def follow(robot, path, task, q0, self_motion=0.0, steps=400):
    """Integrate q̇ = J⁺(ẋ + 5 e) + self_motion · (a direction in the null space)."""
    times = np.linspace(0.0, path.duration, steps + 1)
    direction = np.cos(1.0 + np.arange(robot.dof))

    def speed(t, q):
        pose = robot.pose(q)
        jacobian = robot.task_jacobian(q, task)
        wanted = path.samples([t]).twist[0] + 5.0 * task.twist_error(path.pose(t), pose)
        inverse = np.linalg.pinv(jacobian)
        push = self_motion * np.cos(2 * np.pi * t / path.duration) * direction
        rows = task.select(wanted[:, None], pose.rotation)[:, 0]
        return inverse @ (rows - jacobian @ push) + push

    q, rates, h = [np.asarray(q0, dtype=float)], [], path.duration / steps
    for t in times[:-1]:
        here = q[-1]
        k1 = speed(t, here)
        k2 = speed(t + h / 2, here + h / 2 * k1)
        k3 = speed(t + h / 2, here + h / 2 * k2)
        k4 = speed(t + h, here + h * k3)
        rates.append(k1)
        q.append(here + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
    rates.append(speed(times[-1], q[-1]))
    return Trajectory(times, np.array(q), np.array(rates), robot.joint_names)


def make_plan(robot, path, task, q0, self_motion, **fields):
    certificate = fields.pop("certificate", Certificate())
    start = follow(robot, path, task, q0)
    shown = follow(robot, path, task, q0, self_motion)
    terms = {"joint speed": 3.0, "joint limits": 0.25}
    report = Report(terms=terms, initial_terms={"joint speed": 2.9, "joint limits": 1.6})
    return Plan(robot, path, task, shown, start, report, certificate, np.zeros(7), **fields)


@cache
def planar_plan(self_motion=1.2):
    """The paper's sample problem: (3 cos πt, 2 cos πt) for two seconds."""
    robot = load_robot("planar_3r")
    path = ToolMotion([0.0, 0.0, 0.0], [[3.0, 2.0, 0.0], [0.0, 0.0, 0.0]], np.eye(3), 2.0)
    return make_plan(robot, path, Task.PLANAR, [0.0, np.pi / 2, -np.pi / 2], self_motion)


POSTURES = {
    "panda": [0.0, -0.4, 0.0, -2.2, 0.0, 1.9, 0.8],
    "xarm7": [0.0, -0.3, 0.0, 1.2, 0.0, 1.4, 0.0],
    "baxter": [-0.3, -0.4, 0.0, 1.2, 0.0, 0.7, 0.0],
    "tiago": [0.15, 0.5, 0.2, -1.5, 1.8, -1.0, 0.5, 0.0],
    "pr2": [0.15, -0.5, 0.2, -0.8, -1.4, 0.4, -0.8, 0.3],
    "ur5": [0.0, -1.2, 1.6, -1.8, -1.5, 0.0],
    "ur10": [0.0, -1.2, 1.6, -1.8, -1.5, 0.0],
    "kinova": [0.0, 3.6, 1.6, 1.5, 2.6, 0.5],
    "z1": [0.0, 1.3, -1.2, -0.3, 0.2, 0.0],
}


@cache
def arm_plan(name, self_motion=0.35, duration=4.0, radius=0.1):
    """A vertical circle in front of a named arm."""
    robot = load_robot(name)
    task = Task.POSE if robot.dof > 6 else Task.POSITION
    q0 = POSTURES[name]
    pose = robot.pose(q0)
    axes = [[0.0, 0.0, radius], [0.0, radius, 0.0]]
    path = ToolMotion(pose.translation - axes[0], axes, pose.rotation, duration)
    return make_plan(robot, path, task, q0, self_motion)

"""Arms, tasks and paths that the laws are checked on."""

from collections.abc import Callable, Sequence

import numpy as np
import pinocchio as pin

import selfmotion as sm
from selfmotion.basics import Array, Counts
from selfmotion.model.motion import NullMotionTable
from selfmotion.planning.paper import Objective
from selfmotion.planning.rollout import Rollout, Start

# Arms with a task each, chosen so that every task and redundancy from 1 to 5 occurs.
CASES = [
    ("planar_3r", "planar"),
    ("panda", "pose"),
    ("panda", "pointing"),
    ("xarm7", "pose"),
    ("xarm7", "position"),
    ("baxter", "pose"),
    ("tiago", "pose"),
    ("pr2", "pose"),
    ("pr2", "planar"),
    ("ur5", "position"),
    ("ur5", "pointing"),
    ("ur10", "pointing"),
    ("kinova", "position"),
    ("kinova", "pointing"),
    ("z1", "position"),
]

PANDA_HOME = np.array(sm.NAMED_ARMS["panda"].home)

Case = tuple[sm.RobotModel, sm.Task, Array, sm.paths.Path]

_robots: dict[str, sm.RobotModel] = {}


def robot_named(name: str) -> sm.RobotModel:
    """Load an arm once per test run."""
    if name not in _robots:
        _robots[name] = sm.load_robot(name)
    return _robots[name]


def start_of(robot: sm.RobotModel, task: str) -> Array:
    return robot.dexterous_configuration(task)


def short_line(robot: sm.RobotModel, start: Array, duration: float = 1.5) -> sm.paths.Line:
    """Return a line of 6 cm that also turns the tool a little, from `start`."""
    pose = robot.pose(start)
    end = pose.copy()
    end.translation = pose.translation + np.array([-0.04, 0.03, -0.03])
    end.rotation = pin.exp3(np.array([0.0, 0.0, 0.1])) @ pose.rotation
    return sm.paths.Line(pose, end, duration)


def objective_of(
    rollout: Rollout,
    table: NullMotionTable,
    costs: Sequence[sm.costs.Cost],
    start: Start,
) -> Objective:
    """Return an objective of parts, for laws that hold whatever problem they come from."""
    return Objective(rollout, table, costs, start, (), Counts())


def central_difference(function: Callable[[Array], float], x: Array, step: float = 1e-6) -> Array:
    """Return the gradient of `function` by central differences."""
    gradient = np.empty_like(x)
    for i in range(len(x)):
        shift = np.zeros_like(x)
        shift[i] = step
        gradient[i] = (function(x + shift) - function(x - shift)) / (2.0 * step)
    return gradient

"""Arms, tasks and paths that the laws are checked on."""

from collections.abc import Callable, Sequence

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.engine import Counts, Deviation, Objective, Rollout
from selfmotion.engine.conditions import Conditions
from selfmotion.engine.start import Start
from selfmotion.motion import NullMotionTable

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

# Files that take longest, each by itself.
LONGEST = {"test_site", "test_readme", "test_study", "test_acceptance", "test_realtime"}

_robots: dict[str, sm.RobotModel] = {}


def robot_named(name: str) -> sm.RobotModel:
    """Load an arm once per test run."""
    if name not in _robots:
        _robots[name] = sm.load_robot(name)
    return _robots[name]


def start_of(robot: sm.RobotModel, task: str) -> Array:
    return robot.dexterous_configuration(task)


def short_line(robot: sm.RobotModel, start: Array, duration: float = 1.5) -> sm.Line:
    """Return a line of 6 cm that also turns the tool a little, from `start`."""
    pose = robot.pose(start)
    end = pose.copy()
    end.translation = pose.translation + np.array([-0.04, 0.03, -0.03])
    end.rotation = pin.exp3(np.array([0.0, 0.0, 0.1])) @ pose.rotation
    return sm.Line(pose, end, duration)


@pytest.fixture(params=sorted({name for name, _ in CASES}))
def robot(request: pytest.FixtureRequest) -> sm.RobotModel:
    """Each named arm in turn."""
    return robot_named(request.param)


@pytest.fixture(params=CASES, ids=lambda case: "-".join(case))
def case(request: pytest.FixtureRequest) -> tuple[sm.RobotModel, sm.Task, Array, sm.Path]:
    """Each arm with its task, a start and a short path."""
    name, task = request.param
    arm = robot_named(name)
    start = start_of(arm, task)
    return arm, sm.Task.of(task), start, short_line(arm, start)


@pytest.fixture
def panda() -> sm.RobotModel:
    return robot_named("panda")


@pytest.fixture
def planar() -> sm.RobotModel:
    return robot_named("planar_3r")


PANDA_HOME = np.array(sm.NAMED_ARMS["panda"].home)


@pytest.fixture
def panda_circle(panda: sm.RobotModel) -> Callable[[str], sm.Problem]:
    """Return a maker of the problem: Panda on a vertical circle of 0.15 m in 4 s."""
    path = sm.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    return lambda task="pose", **options: sm.Problem(panda, path, task, PANDA_HOME, **options)


def objective_of(
    rollout: Rollout,
    table: NullMotionTable,
    costs: Sequence[sm.Cost],
    start: Start,
    *,
    deviation: Deviation | None = None,
    constraints: Sequence[sm.BoundConstraint] = (),
) -> Objective:
    """Return an objective of parts, for laws that hold whatever problem they come from."""
    grid, path = rollout.grid, rollout.path
    return Objective(
        rollout,
        table,
        costs,
        start,
        deviation or Deviation(path, (), grid.stage_times, (False, False)),
        Conditions(constraints, grid),
        Counts(),
    )


def central_difference(function: Callable[[Array], float], x: Array, step: float = 1e-6) -> Array:
    """Return the gradient of `function` by central differences."""
    gradient = np.empty_like(x)
    for i in range(len(x)):
        shift = np.zeros_like(x)
        shift[i] = step
        gradient[i] = (function(x + shift) - function(x - shift)) / (2.0 * step)
    return gradient


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the files that take longest, so that no worker is left alone with one."""
    items.sort(key=lambda item: item.path.stem not in LONGEST)

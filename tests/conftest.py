"""Arms, tasks and paths that the laws are checked on."""

import functools
import gc
from collections.abc import Callable, Generator

import pytest
import typer.main

import selfmotion as sm
from selfmotion.basics import Array
from support.arms import CASES, PANDA_HOME, robot_named, short_line, start_of

pytest_plugins = ("support.durations",)

# The tree of commands is built once, and not for each of a thousand times that one of them is run.
typer.main.get_command = functools.cache(typer.main.get_command)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Leave all tests out of garbage collections: thousands of them stay to the end anyway."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.fixture(params=sorted({name for name, _ in CASES}))
def robot(request: pytest.FixtureRequest) -> sm.RobotModel:
    """Each named arm in turn."""
    return robot_named(request.param)


@pytest.fixture(params=CASES, ids=lambda case: "-".join(case))
def case(request: pytest.FixtureRequest) -> tuple[sm.RobotModel, sm.Task, Array, sm.paths.Path]:
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


@pytest.fixture
def panda_circle(panda: sm.RobotModel) -> Callable[[str], sm.Problem]:
    """Return a maker of the problem: Panda on a vertical circle of 0.15 m in 4 s."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    return lambda task="pose", **options: sm.Problem(panda, path, task, PANDA_HOME, **options)

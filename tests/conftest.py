"""Arms, tasks and paths that the laws are checked on."""

from collections.abc import Callable

import pytest

import selfmotion as sm
from selfmotion.basics import Array
from support.arms import CASES, PANDA_HOME, robot_named, short_line, start_of

# Files that take longest, each by itself.
LONGEST = (
    *("test_site", "test_browser", "test_readme", "test_study", "test_generated", "test_pictures"),
    *("test_layout", "test_interruption", "test_run", "test_motions", "test_app", "test_deviation"),
    *("test_riding", "test_job", "test_content", "test_feed", "test_cells", "test_retiming"),
)


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


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the files that take longest, so that no worker is left alone with one."""
    place = {name: number for number, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.path.stem, len(place)))

"""What tests of formats share."""

import pytest

import selfmotion as sm
from support.arms import PANDA_HOME, robot_named


@pytest.fixture(scope="session")
def plan() -> sm.Plan:
    """Return the motion of a Panda round a circle of 3 s."""
    panda = robot_named("panda")
    circle = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.1, 3.0, normal=(1.0, 0.0, 0.0))
    return sm.plan(sm.Problem(panda, circle, start=PANDA_HOME))

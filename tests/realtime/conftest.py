"""What the loop's laws are checked on."""

import pytest

import selfmotion as sm
from support.arms import PANDA_HOME


@pytest.fixture
def slow_circle(panda: sm.RobotModel) -> sm.paths.Circle:
    return sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.08, 6.0, normal=(1.0, 0.0, 0.0))

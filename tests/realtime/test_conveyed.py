"""A conveyed path is a path."""

import selfmotion as sm
from selfmotion import realtime
from selfmotion.testing import check_path


def test_a_conveyed_path_is_a_path(panda: sm.RobotModel, slow_circle: sm.paths.Circle) -> None:
    check_path(realtime.Conveyed(slow_circle, (0.1, 0.0, 0.02), (0.0, 0.3, 0.0)))

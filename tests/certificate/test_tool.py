"""The tool's rates are told with the time that they take."""

import numpy as np
import pytest

from selfmotion.certificate.tool import ToolMotion
from support.arms import robot_named
from support.motions import motion_of


@pytest.mark.parametrize("column", range(4))
def test_the_tools_rates_are_told_with_the_time_they_take(column: int) -> None:
    """The stretched arm turning about its base at 2 rad/s: ω r, ω, ω² r, and no turn faster."""
    robot = robot_named("planar_3r")
    reach = float(np.linalg.norm(robot.pose(np.zeros(3)).translation[:2]))
    motion = motion_of([[0.0] * 3, [2.0, 0.0, 0.0]], [[2.0, 0.0, 0.0]] * 2)
    rates = [2.0 * reach, 2.0, 4.0 * reach, 0.0]
    limit = np.full(4, np.inf)
    limit[column] = rates[column] / 4.0 if column < 3 else 1.0
    requirement = ToolMotion(robot, limit)
    found = requirement.judge(motion)
    names = ("speed", "turn rate", "acceleration", "turn acceleration")
    assert requirement.covers == (f"tool {names[column]}",)
    assert found.amount == pytest.approx(4.0 if column < 3 else 0.0, rel=1e-3, abs=1e-6)
    assert found.kept is (column == 3)
    if column < 3:
        longer = found.amount if column < 2 else found.amount**0.5
        assert f"a {names[column]} of {found.amount * limit[column]:.4g}" in found.text
        assert f"give it {longer:.5g} times the duration" in found.text

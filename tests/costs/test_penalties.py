"""The cost of limits' use is the time at any pace."""

import pytest

import selfmotion as sm
from selfmotion.shell import testing
from support.arms import PANDA_HOME


@pytest.mark.parametrize("power", [4.0, 8.0, 16.0])
def test_the_cost_keeps_the_laws(panda: sm.RobotModel, power: float) -> None:
    testing.check_cost(
        sm.costs.LimitUse(panda.velocity_limit, panda.acceleration_limit, power), panda
    )
    testing.check_cost(sm.costs.LimitUse(2.0, power=power), panda)


def test_the_cost_is_the_time_at_any_pace(panda: sm.RobotModel) -> None:
    """For velocities alone its integral does not change with the pace."""
    start = panda.pose(PANDA_HOME)
    costs = [sm.costs.LimitUse(panda.velocity_limit)]
    found = [
        sm.plan(
            sm.Problem(panda, sm.paths.Circle.around(start, 0.1, t), start=PANDA_HOME, costs=costs),
            max_evaluations=1,
        ).report.initial_cost
        for t in (2.0, 6.0)
    ]
    # The smallest share, where nothing moves, counts longer at a slow pace.
    assert found[0] == pytest.approx(found[1], rel=1e-3)

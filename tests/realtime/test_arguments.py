"""What cannot be kept is refused before the first step."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.realtime import Replanner
from support.arms import PANDA_HOME


def no_limits(robot: sm.RobotModel) -> Replanner:
    return Replanner(sm.load_robot("ur5"), "position")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (no_limits, "no limit of speed or acceleration"),
        (
            lambda arm: Replanner(arm, constraints=[sm.constraints.ClosedPath()]),
            "ClosedPath is not kept",
        ),
        (lambda arm: Replanner(arm, period=0.0), "period"),
        (lambda arm: Replanner(arm, steps=3), "steps"),
        (
            lambda arm: Replanner(arm, null_motion=sm.PolynomialNullMotion(space="joint")),
            "expected 'null'",
        ),
    ],
)
def test_what_cannot_be_kept_is_refused(panda: sm.RobotModel, make: object, words: str) -> None:
    with pytest.raises(sm.errors.ProblemError, match=words):
        make(panda)  # type: ignore[operator]


def test_a_first_state_that_cannot_be_stopped_in_time_is_refused(
    panda: sm.RobotModel, slow_circle: sm.paths.Circle
) -> None:
    near = PANDA_HOME.copy()
    near[3] = panda.upper[3] - 0.01
    fast = np.zeros(7)
    fast[3] = 2.0
    with pytest.raises(sm.errors.StartError, match="panda_joint4"):
        Replanner(panda).step(0.0, near, fast, slow_circle)


def test_a_first_state_in_degrees_is_asked_about(
    panda: sm.RobotModel, slow_circle: sm.paths.Circle
) -> None:
    near = PANDA_HOME.copy()
    near[3] = panda.upper[3] + 0.1
    rad = r"is at .* rad, 0 rad/s, from where it cannot stop within .* rad at up to .* rad/s"
    for q, asked in ((np.degrees(PANDA_HOME), True), (near, False)):
        with pytest.raises(sm.errors.StartError, match=rad) as caught:
            Replanner(panda).step(0.0, q, np.zeros(7), slow_circle)
        assert ("in degrees?" in str(caught.value)) is asked

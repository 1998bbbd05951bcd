"""Verified plans are run by an arm's controller: at 1 kHz, from standstill to standstill."""

import dataclasses

import numpy as np
import pytest

import selfmotion as sm
from support.acceptance import LIMITS, commanded, shares
from support.arms import PANDA_HOME


def used(motion: sm.Trajectory, name: str) -> np.ndarray:
    return shares(commanded(motion.t, motion.q, motion.qd, motion.qdd), LIMITS[name])


@pytest.mark.parametrize("name", ["panda", "xarm7"])
def test_the_planner_knows_what_the_makers_publish(name: str) -> None:
    robot, limits = sm.load_robot(name), LIMITS[name]
    np.testing.assert_array_equal(robot.acceleration_limit, limits.acceleration)
    np.testing.assert_array_equal(robot.jerk_limit, limits.jerk)


@pytest.mark.parametrize("name", ["panda", "xarm7"])
@pytest.mark.parametrize("free", [False, True])
def test_a_fast_circle_is_run(name: str, free: bool) -> None:
    """So fast that limits of speed or acceleration bind."""
    robot = sm.load_robot(name)
    start = robot.dexterous_configuration("pose")
    seconds = {("panda", False): 2.6, ("panda", True): 2.0}.get((name, free), 1.6)
    path = sm.paths.Circle.around(robot.pose(start), 0.1, seconds, normal=(1.0, 0.0, 0.0))
    plan = sm.plan(sm.Problem(robot, path, "pose", None if free else start)).require()
    assert {"accelerations", "rest at both ends"} <= set(plan.certificate.covers)
    found = used(plan.trajectory, name)
    assert 0.5 < found.max() <= 1.0


def test_standstill_is_part_of_it(panda: sm.RobotModel) -> None:
    """An arm that is to begin at 0.07 rad/s is refused, whatever its acceleration is later."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    problem = sm.Problem(
        panda, path, "position", PANDA_HOME, costs=[sm.costs.InverseManipulability(1.0)]
    )
    assert used(sm.plan(problem).trajectory, "panda").max() <= 1.0
    moving = sm.plan(dataclasses.replace(problem, rest=False))
    speed = np.abs(moving.trajectory.qd[0]).max()
    assert speed > 0.01
    assert used(moving.trajectory, "panda")[2] > 1.0
    assert "rest" not in " ".join(moving.certificate.covers)

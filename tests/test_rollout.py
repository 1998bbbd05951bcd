"""Where a rollout breaks down, and what polishing its nodes does."""

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from conftest import robot_named, short_line, start_of
from selfmotion.basics.arrays import Array
from selfmotion.engine.rollout import Rollout
from selfmotion.motion.grid import Grid

Case = tuple[sm.RobotModel, sm.Task, Array, sm.Path]


@pytest.mark.parametrize("last", [False, True])
def test_a_breakdown_has_the_time_of_the_first_number_that_is_not_finite(
    case: Case, last: bool
) -> None:
    robot, task, start, path = case
    rollout = Rollout(robot, path, task, Grid.aligned(path.knots, 8))
    times = rollout.grid.stage_times
    stage = len(times) - 1 if last else 13
    epsilon = np.zeros((len(times), robot.dof))
    assert rollout.run(start, epsilon) is None
    assert rollout.jacobian_evaluations == len(times)
    for broken in (np.nan, np.inf):
        epsilon[stage, 0] = broken
        before = rollout.jacobian_evaluations
        assert rollout.run(start, epsilon) == times[stage]
        assert rollout.jacobian_evaluations == before + stage + 1


@pytest.mark.parametrize(("name", "task"), [("panda", "pointing"), ("ur5", "pointing")])
def test_polished_nodes_of_a_tilted_pointing_path_are_on_it(name: str, task: str) -> None:
    """A tool axis along no axis of the world, and a grid so coarse that there is much to do."""
    robot = robot_named(name)
    start = start_of(robot, task) + 0.3
    pose = robot.pose(start)
    assert np.abs(pose.rotation[:, 2]).max() < 0.95
    end = pose.copy()
    end.translation = pose.translation + np.array([-0.04, 0.03, -0.03])
    end.rotation = pin.exp3(np.array([0.2, -0.3, 0.1])) @ pose.rotation
    path = sm.Line(pose, end, 1.5)
    rows = sm.Task.of(task)
    rollout = Rollout(robot, path, rows, Grid.aligned(path.knots, 8))
    assert rollout.run(start, 0.1 * np.ones((33, robot.dof))) is None
    assert np.abs(rollout.drift[:, :5]).max() > 1e-7
    t, q, qd = rollout.polished()
    for here, speed, when in zip(q, qd, t, strict=True):
        error = rows.twist_error(path.pose(when), robot.pose(here))
        np.testing.assert_allclose(error, 0.0, atol=1e-12)
        rotation = robot.pose(here).rotation
        wanted = rows.select(path.twist(when)[:, None], rotation)[:, 0]
        np.testing.assert_allclose(robot.task_jacobian(here, rows) @ speed, wanted, atol=1e-12)


def test_polishing_leaves_the_run_as_it_is(panda: sm.RobotModel) -> None:
    """What `samples` and `pullback` return is that of the last run."""
    start = start_of(panda, "pose")
    path = short_line(panda, start)
    rollout = Rollout(panda, path, sm.Task.POSE, Grid.aligned(path.knots, 8))
    assert rollout.run(start, 0.1 * np.ones((33, 7))) is None
    before, drift = rollout.samples().q.copy(), rollout.drift
    counted = rollout.jacobian_evaluations
    _, q, _ = rollout.polished()
    assert rollout.jacobian_evaluations == counted + len(q)
    assert not np.array_equal(q, before[rollout.grid.node_stages])
    np.testing.assert_array_equal(rollout.samples().q, before)
    np.testing.assert_array_equal(rollout.drift, drift)


def test_what_broke_down_is_polished_as_far_as_it_goes(panda: sm.RobotModel) -> None:
    """Beyond the breakdown there is nothing that could be put onto the path."""
    start = start_of(panda, "pose")
    path = short_line(panda, start)
    rollout = Rollout(panda, path, sm.Task.POSE, Grid.aligned(path.knots, 8))
    epsilon = np.zeros((33, 7))
    epsilon[13] = np.inf
    assert rollout.run(start, epsilon) is not None
    t, q, _ = rollout.polished()
    for when, here in zip(t[:3], q[:3], strict=True):
        assert max(sm.Task.POSE.miss(path.pose(when), panda.pose(here))) < 1e-11

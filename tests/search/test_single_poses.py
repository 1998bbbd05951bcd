"""Single poses: Newton's method from near by stays near, and from anywhere goes far."""

from types import SimpleNamespace

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.search import SinglePoses
from selfmotion.planning.search.manifold import LONGEST_CORRECTION
from selfmotion.planning.search.single_poses import room_of
from support.arms import robot_named
from support.paths import line_of

# Where Newton's method ends [m or rad].
AT_POSE = 1e-9


@pytest.mark.parametrize(("name", "task"), [("panda", "pose"), ("xarm7", "pose")])
def test_what_is_no_start_from_anywhere_stays_near(name: str, task: str) -> None:
    robot = robot_named(name)
    problem = sm.Problem(robot, line_of(robot, task), task, clearance=None)
    poses = SinglePoses(Formulation.of(problem), np.random.default_rng(0))
    counts = []
    for given in ({}, {"far": True}):
        found, arrived = poses.project(poses._seeds, 1.0, **given)
        counts.append(int(arrived.sum()))
        for q in found[arrived][:5]:
            assert max(sm.Task.of(task).miss(problem.path.pose(1.0), robot.pose(q))) < AT_POSE
    assert 0 < 2 * counts[0] < counts[1]
    # From beside a solution both come back to it.
    beside = found[arrived] + np.random.default_rng(1).normal(scale=1e-3, size=robot.dof)
    near, arrived = poses.project(beside, 1.0)
    assert arrived.all()
    assert np.abs(near - beside).max() < LONGEST_CORRECTION


def test_room_is_what_is_left_of_a_distance_beyond_the_one_that_is_required() -> None:
    """The least of all: the closest bodies may be those with the most room."""

    def bodies(distance: float) -> SimpleNamespace:
        closest = SimpleNamespace(value=distance)
        return SimpleNamespace(distance=lambda q: closest, robot=SimpleNamespace(dof=1))

    both = (bodies(0.3), 0.2), (bodies(0.25), 0.01)
    poses = SimpleNamespace(bounds=SimpleNamespace(bodies=both))
    room, closest, required = room_of(poses, np.zeros(1))
    assert room == pytest.approx(0.1)
    assert (closest.value, required) == (0.3, 0.2)

"""Places in reach: those where other inverse kinematics finds the path, and no others."""

import tomllib

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.model.path import spread_along
from selfmotion.model.task import SE3
from selfmotion.shell.view.handles import handles_of
from selfmotion.shell.view.placement_map import PlacementMap
from support.views import CIRCLE

# So many places in reach, and out of it, are looked at by other code, with so many starts.
GREEN, OTHERS, STARTS = 5, 2, 30


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    file = tmp_path_factory.mktemp("map") / "circle.toml"
    file.write_text(CIRCLE)
    return sm.files.read_job(file).problem


def in_reach(problem, by):
    """Whether the poses of a path displaced by (2,) are found one by one."""
    for time in spread_along(problem.path, 12):
        pose = problem.path.pose(time)
        moved = SE3(pose.rotation, pose.translation + np.append(by, 0.0))
        try:
            problem.robot.inverse_kinematics(moved, problem.task, attempts=STARTS)
        except sm.errors.InverseKinematicsError:
            return False
    return True


@pytest.mark.parametrize(("name", "way"), [("path", 1.0), ("base", -1.0)])
def test_places_are_green_where_the_path_is_in_reach(problem, name, way):
    handle = handles_of(tomllib.loads(CIRCLE), problem)[name]
    assert PlacementMap.can_move([problem], handle)
    found = PlacementMap([problem], [problem.robot.home[None]], handle)
    while not found.is_done:
        found.test_next()
    here = (handle.prefix * handle.pose).translation[:2]
    for reached, count in ((True, GREEN), (False, OTHERS)):
        places = found.positions[found.is_reachable == reached]
        for place in places[:: len(places) // count]:
            assert in_reach(problem, way * (place - here)) == reached


def test_what_is_no_place_of_the_path_has_no_map(problem):
    handles = handles_of(tomllib.loads(CIRCLE), problem)
    for name in ("post", "tool"):
        assert not PlacementMap.can_move([problem], handles[name])


def test_of_several_paths_all_have_to_be_in_reach(problem):
    """And where one is so far away that it never is, nothing is green."""
    handle = handles_of(tomllib.loads(CIRCLE), problem)["path"]
    home = problem.robot.home[None]

    def green(*problems):
        found = PlacementMap(problems, [home] * len(problems), handle)
        while not found.is_done:
            found.test_next()
        return found.is_reachable

    up = SE3(np.eye(3), np.array([0.0, 0.0, 0.25]))
    far = SE3(np.eye(3), np.array([0.0, 0.0, 5.0]))
    lifted = problem.changed(path=sm.paths.Placed(problem.path, up))
    away = problem.changed(path=sm.paths.Placed(problem.path, far))
    # Both have the same middle over the ground, and so the same places.
    np.testing.assert_array_equal(green(problem, lifted), green(problem) & green(lifted))
    assert not green(away, problem).any()

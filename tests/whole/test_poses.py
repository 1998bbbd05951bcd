"""Wherever a pose is asked for, an SE3 and a matrix (4, 4) are the same."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

import selfmotion as sm
from support.arms import PANDA_HOME, robot_named

HERE = pin.SE3(pin.exp3(np.array([0.1, -0.2, 0.3])), np.array([0.4, 0.1, 0.5]))
THERE = pin.SE3(pin.exp3(np.array([0.1, 0.2, 0.3])), np.array([0.5, -0.1, 0.4]))


def at(path: sm.paths.Path) -> np.ndarray:
    return path.pose(0.7 * path.duration).homogeneous


def box(pose: Any) -> np.ndarray:
    return sm.obstacles.Box("post", pose, [0.1, 0.1, 0.4]).pose.homogeneous


def followed(pose: Any) -> np.ndarray:
    panda = robot_named("panda")
    held = sm.Follow(pose, "planar", tool="panda_link6")
    problem = sm.Problem(panda, [sm.Follow(sm.paths.Dwell(THERE, 1.0), "position"), held])
    return problem.follows.items[1].path.pose(0.5).homogeneous


def seen(pose: Any) -> np.ndarray:
    panda = robot_named("panda")
    replanner = sm.Replanner(panda, "position")
    target = panda.pose(PANDA_HOME)
    target = target.homogeneous if isinstance(pose, np.ndarray) else target
    return np.array(replanner.step(0.0, PANDA_HOME, np.zeros(7), target=target).q)


def kept_off(pose: Any) -> np.ndarray:
    panda = robot_named("panda")
    apart = sm.constraints.Clearance([sm.obstacles.Sphere("ball", [0.9, 0.9, 0.9], 0.05)], 0.01)
    replanner = sm.Replanner(panda, "position", constraints=[apart])
    path = sm.paths.Dwell(panda.pose(PANDA_HOME), 1.0)
    state = 0.0, PANDA_HOME, np.zeros(7), path
    return np.array(replanner.step(*state, obstacles={"ball": pose}).q)


def loaded(**options: Any) -> np.ndarray:
    return sm.load_robot("panda", **options).pose(PANDA_HOME).homogeneous


ASKED: dict[str, Callable[[Any], Any]] = {
    "Line start": lambda pose: at(sm.paths.Line(pose, THERE, 1.0)),
    "Line end": lambda pose: at(sm.paths.Line(THERE, pose, 1.0)),
    "Circle": lambda pose: at(sm.paths.Circle.around(pose, 0.1, 1.0)),
    "Spiral": lambda pose: at(sm.paths.Spiral(pose, [0.3, 0, 0.5], [0, 0, 1], 1.0, 2.0, 0.2)),
    "Dwell": lambda pose: at(sm.paths.Dwell(pose, 1.0)),
    "Placed": lambda pose: at(sm.paths.Placed(sm.paths.Line(HERE, THERE, 1.0), pose)),
    "Waypoints": lambda pose: at(sm.paths.Waypoints.from_poses([0.0, 1.0], [pose, THERE])),
    "Polyline": lambda pose: at(sm.paths.Polyline.from_poses([pose, THERE])),
    "Follow": followed,
    "Box": box,
    "inverse kinematics": lambda pose: robot_named("panda").inverse_kinematics(pose, "position"),
    "base": lambda pose: loaded(base=pose),
    "tool_offset": lambda pose: loaded(tool_offset=pose),
    "Replanner.step target": seen,
    "Replanner.step obstacles": kept_off,
}  # fmt: skip


@pytest.mark.parametrize("name", ASKED)
def test_a_pose_is_an_se3_or_a_matrix(name: str) -> None:
    np.testing.assert_allclose(ASKED[name](HERE), ASKED[name](HERE.homogeneous), atol=1e-12)


@pytest.mark.parametrize("make", [sm.paths.Polyline, lambda x, r: sm.paths.Waypoints([0, 1], x, r)])
def test_rotations_of_scipy_are_what_they_say(make: Callable[..., sm.paths.Path]) -> None:
    positions = [HERE.translation, THERE.translation]
    turns = Rotation.from_matrix([HERE.rotation, THERE.rotation])
    path = make(positions, turns)
    np.testing.assert_allclose(path.pose(0.0).homogeneous, HERE.homogeneous, atol=1e-12)
    np.testing.assert_allclose(path.pose(path.duration).rotation, THERE.rotation, atol=1e-12)
    again = make(positions, turns.as_quat(scalar_first=True))
    np.testing.assert_allclose(at(path), at(again), atol=1e-12)

"""The judge of the suite: accepts what is valid, and refuses each thing that can be wrong."""

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from suite_judge import SuiteJudge

import selfmotion as sm
from selfmotion.basics import Array
from support.places import DATA

CRITERIA: dict[str, Any] = {
    "position_m": 1e-4,
    "rotation_deg": 0.1,
    "joint_step_deg": 7.0,
    "prismatic_step_m": 0.02,
    "joint_limits": True,
    "collision_free": True,
}


DISABLED = {
    frozenset(("torso_lift_link", "shoulder_lift_link")),
    frozenset(("l_gripper_finger_link", "r_gripper_finger_link")),
}


@pytest.fixture(scope="module")
def fetch() -> sm.RobotModel:
    return sm.load_robot(DATA / "fetch.urdf", tool="gripper_link")


@pytest.fixture(scope="module")
def motion() -> Array:
    start = np.array([0.1, 0.9, 0.3, 0.0, 0.9, 0.0, 0.6, 0.0])
    return start + np.linspace(0.0, 0.2, 8)[:, None] * [0.1, 1, 0, 0, 0, 0, 1, 1]


def reason(
    fetch: sm.RobotModel,
    q: Array,
    *,
    of: Array | None = None,
    boxes: tuple[tuple[Array, Any], ...] = (),
    free_axis: str | None = None,
) -> str:
    targets = [fetch.pose(x) for x in (q if of is None else of)]
    return SuiteJudge(fetch, list(boxes), DISABLED, CRITERIA, free_axis).judge(targets, q).reason


def test_a_valid_motion_is_valid_and_measured(fetch: sm.RobotModel, motion: Array) -> None:
    judge = SuiteJudge(fetch, [], DISABLED, CRITERIA, None)
    found = judge.judge([fetch.pose(x) for x in motion], motion)
    assert found.reason == ""
    assert found.length_rad == pytest.approx(0.6)
    assert found.length_m == pytest.approx(0.02)


def test_each_criterion_refuses(fetch: sm.RobotModel, motion: Array) -> None:
    off = motion.copy()
    off[3, 1] += 1e-2
    assert "off the path" in reason(fetch, off, of=motion)
    assert "a joint step of" in reason(fetch, motion[[0, -1]])
    slid = motion[[0, 0]] + [[0.0] * 8, [0.021] + [0.0] * 7]
    assert "step of 0.0210 m" in reason(fetch, slid)
    beyond = motion + np.array([0.3] + [0.0] * 7)
    assert "beyond a joint limit" in reason(fetch, beyond)
    folded = motion.copy()
    folded[:, 1:8] = [0.0, 1.4, 0.0, 2.2, 0.0, 1.5, 0.0]
    assert "meets" in reason(fetch, folded)


def test_a_box_in_the_way_is_met(fetch: sm.RobotModel, motion: Array) -> None:
    here = pin.SE3(np.eye(3), fetch.pose(motion[4]).translation)
    assert "'gripper" in reason(fetch, motion, boxes=((np.full(3, 0.05), here),))
    away = pin.SE3(np.eye(3), np.array([0.0, 0.0, 3.0]))
    assert reason(fetch, motion, boxes=((np.full(3, 0.05), away),)) == ""


def test_turning_about_the_free_axis_is_free(fetch: sm.RobotModel, motion: Array) -> None:
    """The last joint turns the gripper about its x axis."""
    turned = motion + np.array([0.0] * 7 + [0.05])
    assert "off the path" in reason(fetch, turned, of=motion)
    assert reason(fetch, turned, of=motion, free_axis="x") == ""


def test_a_turn_more_is_no_step(fetch: sm.RobotModel, motion: Array) -> None:
    turned = motion.copy()
    turned[4:, 7] += 2.0 * np.pi
    assert reason(fetch, turned) == ""

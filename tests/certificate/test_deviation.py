"""The deviation of a pose from its target, row by row."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.certificate.path_error import (
    deviation_from,
    deviation_size,
    excess,
    jacobians,
    poses,
    rotation_vectors,
)
from support.arms import robot_named
from support.two_arms import baxter_with_both_arms

ROUNDING = 1e-12


def rotation(rng: np.random.Generator, size: float = 1.5) -> Array:
    return np.asarray(pin.exp3(rng.uniform(-size, size, 3)))


@pytest.mark.parametrize("in_tool_axes", [False, True])
@pytest.mark.parametrize("task", list(sm.Task))
def test_the_deviation_is_that_of_the_poses(task: sm.Task, in_tool_axes: bool) -> None:
    """Against Pinocchio's logarithm; the tool's axis alone by the turn between two vectors."""
    panda, rng = robot_named("panda"), np.random.default_rng(1)
    lower, upper = panda.finite_limits()
    q = rng.uniform(lower, upper, (6, 7))
    targets = [(rotation(rng) @ panda.pose(x).rotation, rng.normal(size=3)) for x in q]
    turns, places = (np.array(part) for part in zip(*targets, strict=True))
    path: Any = SimpleNamespace(
        samples=lambda t: SimpleNamespace(rotation=turns, translation=places)
    )
    follow: Any = SimpleNamespace(chain=panda.chain, path=path, task=task)
    found = deviation_from(follow, np.zeros(6), q, in_tool_axes)
    for k, configuration in enumerate(q):
        pose = panda.pose(configuration)
        miss = (pose.translation - places[k]) * np.isin(range(3), task.rows)
        expected = turns[k].T @ miss if in_tool_axes else miss
        np.testing.assert_allclose(found[k, :3], expected, atol=ROUNDING)
        relative = turns[k].T @ pose.rotation
        turn = np.zeros(3)
        if task.tool_axes:
            axis = relative[:, 2]
            normal = np.cross([0.0, 0.0, 1.0], axis)
            turn = normal / np.linalg.norm(normal) * np.arccos(axis[2])
        elif np.any(task.rows >= 3):
            turn = pin.log3(relative)
        np.testing.assert_allclose(found[k, 3:], turn, atol=1e-9)


@pytest.mark.parametrize("reference", [None, "right_gripper"])
def test_jacobians_are_what_poses_change_by(reference: str | None) -> None:
    """In the frame of the base, which moves with the other hand."""
    robot, rng, step = baxter_with_both_arms(reference), np.random.default_rng(0), 1e-6
    q = robot.dexterous_configuration("pose") + 0.1 * rng.normal(size=robot.dof)
    found, turns = jacobians(robot.chain, q[None])
    for joint, unit in enumerate(np.eye(robot.dof)):
        (ahead, behind), places = poses(robot.chain, q + step * np.outer([1.0, -1.0], unit))
        moved = (places[0] - places[1]) / (2.0 * step)
        turned = pin.log3(ahead @ behind.T) / (2.0 * step)
        np.testing.assert_allclose(found[0, :, joint], [*moved, *turned], atol=1e-8)
    np.testing.assert_allclose(turns[0], robot.pose(q).rotation, atol=ROUNDING)


@pytest.mark.parametrize("task", list(sm.Task))
def test_turns_of_many_intervals_are_those_one_by_one(task: sm.Task) -> None:
    rng = np.random.default_rng(3)
    turns = np.array([rotation(rng) for _ in range(12)])
    found = rotation_vectors(task, turns.reshape(2, 6, 3, 3))
    np.testing.assert_array_equal(found.reshape(12, 3), rotation_vectors(task, turns))


@pytest.mark.parametrize("task", ["pose", "pointing"])
def test_half_a_turn_and_none_are_what_they_are(task: str) -> None:
    half = np.diag([1.0, -1.0, -1.0])
    actual = np.array([half, np.eye(3)])
    found = rotation_vectors(sm.Task.of(task), np.asarray(actual))
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), [np.pi, 0.0])


def test_what_is_relaxed_is_taken_off_its_rows_in_its_window() -> None:
    item = sm.Relaxation(("x", "y"), 0.5, during=(1.0, 2.0))
    deviation = np.tile([3.0, 4.0, 7.0, 0.1, 0.2, 0.3], (6, 1))
    deviation[4] *= 0.1
    deviation[5, :2] = 0.0
    t = np.array([0.5, 1.0, 2.0, 2.5, 1.5, 1.5])
    size = deviation_size(item, 3.0, t, deviation)
    np.testing.assert_allclose(size, [0.0, 5.0, 5.0, 0.0, 0.5, 0.0])
    beyond = excess([item], 3.0, t, deviation)
    expected = deviation.copy()
    expected[1:3, :2] *= 0.9
    expected[4:, :2] = 0.0
    np.testing.assert_allclose(beyond, expected)

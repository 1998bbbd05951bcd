"""The deviation of a pose from its target, row by row."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.certificate.deviation import (
    deviation_from,
    deviation_size,
    excess,
    rotation_vectors,
)
from support.arms import robot_named

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

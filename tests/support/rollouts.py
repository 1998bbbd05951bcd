"""Null motions of rollouts."""

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.follow import Follows
from selfmotion.model.motion import Grid, NullMotionTable
from selfmotion.planning.rollout import Rollout
from support.arms import Case


def random_epsilon(rollout: Rollout, seed: int, size: float = 0.3) -> Array:
    """Return a smooth null motion: random cubics per joint."""
    t = rollout.grid.stage_times / rollout.follows.duration
    coefficients = np.random.default_rng(seed).normal(size=(4, rollout.robot.dof))
    return size * np.vander(t, 4) @ coefficients


def rollout_of(case: Case, steps: int = 12) -> Rollout:
    robot, task, _, path = case
    return Rollout(Follows.of(robot, path, task), Grid.aligned(path.knots, steps))


def assert_sensitivities(
    rollout: Rollout, table: NullMotionTable, start: Array, x: Array, tolerance: float
) -> None:
    """Check that the derivatives of all speeds by x are central differences."""
    assert rollout.run(start, table.epsilon(x)) is None
    _, exact = rollout.sensitivities(table.matrix(), np.zeros((rollout.robot.dof, table.size)))
    for i in range(table.size):
        shift = np.zeros_like(x)
        shift[i] = 1e-6
        ends = []
        for sign in (1.0, -1.0):
            assert rollout.run(start, table.epsilon(x + sign * shift)) is None
            ends.append(rollout.samples().qd.copy())
        differences = (ends[0] - ends[1]) / 2e-6
        scale = max(1.0, np.abs(differences).max())
        np.testing.assert_allclose(exact[:, :, i], differences, atol=tolerance * scale)

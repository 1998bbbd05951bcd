"""Null motions of rollouts."""

import numpy as np

from selfmotion.basics import Array
from selfmotion.engine.rollout import Rollout
from selfmotion.follow import Follows
from selfmotion.motion import Grid
from support.arms import Case


def random_epsilon(rollout: Rollout, seed: int, size: float = 0.3) -> Array:
    """Return a smooth null motion: random cubics per joint."""
    t = rollout.grid.stage_times / rollout.follows.duration
    coefficients = np.random.default_rng(seed).normal(size=(4, rollout.robot.dof))
    return size * np.vander(t, 4) @ coefficients


def rollout_of(case: Case, steps: int = 12) -> Rollout:
    robot, task, _, path = case
    return Rollout(Follows.of(robot, path, task), Grid.aligned(path.knots, steps))

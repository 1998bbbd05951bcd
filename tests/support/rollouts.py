"""Null motions of rollouts."""

import numpy as np

from selfmotion.basics import Array
from selfmotion.engine.rollout import Rollout


def random_epsilon(rollout: Rollout, seed: int, size: float = 0.3) -> Array:
    """Return a smooth null motion: random cubics per joint."""
    t = rollout.grid.stage_times / rollout.follows.duration
    coefficients = np.random.default_rng(seed).normal(size=(4, rollout.robot.dof))
    return size * np.vander(t, 4) @ coefficients

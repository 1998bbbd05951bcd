"""From a decision vector to the motion, its cost, and the gradient."""

from selfmotion.engine.augmented_lagrangian import AugmentedLagrangian
from selfmotion.engine.deviation import Deviation
from selfmotion.engine.objective import Objective, inverse_metric
from selfmotion.engine.rollout import FEEDBACK, Rollout
from selfmotion.engine.start import FixedStart, FreeStart, Start

__all__ = [
    "FEEDBACK",
    "AugmentedLagrangian",
    "Deviation",
    "FixedStart",
    "FreeStart",
    "Objective",
    "Rollout",
    "Start",
    "inverse_metric",
]

"""From a decision vector to the motion, its cost, and the gradient."""

from selfmotion.engine.counts import Counts
from selfmotion.engine.deviation import Deviation
from selfmotion.engine.objective import Evaluation, Objective
from selfmotion.engine.remaining import Remaining, finest
from selfmotion.engine.rollout import Rollout
from selfmotion.engine.start import FixedStart, FreeStart
from selfmotion.engine.still import (
    MOST_HALVINGS,
    Guide,
    StillMotion,
    rough_still_motion,
    settled_still_motion,
)

__all__ = [
    "MOST_HALVINGS",
    "Counts",
    "Deviation",
    "Evaluation",
    "FixedStart",
    "FreeStart",
    "Guide",
    "Objective",
    "Remaining",
    "Rollout",
    "StillMotion",
    "finest",
    "rough_still_motion",
    "settled_still_motion",
]

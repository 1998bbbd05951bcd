"""Eq. 4 integrated from a start: motions of a null motion, and the minimum-norm motion."""

from selfmotion.planning.rollout.minimum_norm import (
    MAX_HALVINGS as MAX_HALVINGS,
    Guide as Guide,
    MinimumNormMotion as MinimumNormMotion,
    brought_to_rest as brought_to_rest,
    converged_minimum_norm as converged_minimum_norm,
)
from selfmotion.planning.rollout.rollout import Rollout as Rollout
from selfmotion.planning.rollout.starts import (
    FixedStart as FixedStart,
    FreeStart as FreeStart,
    Start as Start,
)

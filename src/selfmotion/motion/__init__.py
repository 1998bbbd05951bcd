"""The nouns of a joint motion over time: grid, trajectory, null motion."""

from selfmotion.motion.columns import column_names as column_names
from selfmotion.motion.evaluation import Evaluation as Evaluation
from selfmotion.motion.grid import Grid as Grid
from selfmotion.motion.joining import (
    joined_motions as joined_motions,
    reversed_motion as reversed_motion,
    slowdown_of as slowdown_of,
)
from selfmotion.motion.null_motion import (
    BSplineNullMotion as BSplineNullMotion,
    FreeNullMotion as FreeNullMotion,
    NodeNullMotion as NodeNullMotion,
    NullMotion as NullMotion,
    PolynomialNullMotion as PolynomialNullMotion,
    fading_window as fading_window,
    resting_window as resting_window,
)
from selfmotion.motion.null_motion_table import NullMotionTable as NullMotionTable
from selfmotion.motion.sampling import Sampling as Sampling
from selfmotion.motion.trajectory import MOST_SAMPLES as MOST_SAMPLES, Trajectory as Trajectory

__all__ = [
    "BSplineNullMotion",
    "FreeNullMotion",
    "NodeNullMotion",
    "NullMotion",
]

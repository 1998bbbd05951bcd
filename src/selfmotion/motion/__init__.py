"""The nouns of a joint motion over time: grid, trajectory, null motion."""

from selfmotion.motion.grid import Grid
from selfmotion.motion.null_motion import (
    BSplineNullMotion,
    NullMotion,
    NullMotionTable,
    PolynomialNullMotion,
    RefinedNullMotion,
    TransportedFrame,
    resting_window,
)
from selfmotion.motion.sampling import Sampling
from selfmotion.motion.trajectory import Trajectory

__all__ = [
    "BSplineNullMotion",
    "Grid",
    "NullMotion",
    "NullMotionTable",
    "PolynomialNullMotion",
    "RefinedNullMotion",
    "Sampling",
    "Trajectory",
    "TransportedFrame",
    "resting_window",
]

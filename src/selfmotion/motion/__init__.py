"""The nouns of a joint motion over time: grid, trajectory, null motion."""

from selfmotion.motion.grid import Grid
from selfmotion.motion.joining import joined_motions, reversed_motion
from selfmotion.motion.null_motion import (
    BSplineNullMotion,
    NullMotion,
    NullMotionTable,
    PolynomialNullMotion,
    RefinedNullMotion,
    TransportedFrame,
    resting_window,
    transport,
)
from selfmotion.motion.sampling import Sampling
from selfmotion.motion.trajectory import Trajectory, column_names

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
    "column_names",
    "joined_motions",
    "resting_window",
    "reversed_motion",
    "transport",
]

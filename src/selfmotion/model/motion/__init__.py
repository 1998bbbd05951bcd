"""The nouns of a joint motion over time: grid, trajectory, null motion."""

from selfmotion.model.motion.differences import Differences as Differences
from selfmotion.model.motion.grid import Grid as Grid, Sampling as Sampling
from selfmotion.model.motion.null_motion import (
    BSplineNullMotion as BSplineNullMotion,
    FreeNullMotion as FreeNullMotion,
    NodeNullMotion as NodeNullMotion,
    NullMotion as NullMotion,
    NullMotionTable as NullMotionTable,
    PolynomialNullMotion as PolynomialNullMotion,
    fading_window as fading_window,
    resting_window as resting_window,
)
from selfmotion.model.motion.spline import (
    differentiated as differentiated,
    evaluated as evaluated,
    hermite as hermite,
)
from selfmotion.model.motion.trajectory import (
    MAX_SAMPLES as MAX_SAMPLES,
    Evaluation as Evaluation,
    Trajectory as Trajectory,
    column_names as column_names,
    joined_motions as joined_motions,
    part_of_motion as part_of_motion,
    reversed_motion as reversed_motion,
    slowdown_of as slowdown_of,
)

__all__ = [
    "BSplineNullMotion",
    "FreeNullMotion",
    "NodeNullMotion",
    "NullMotion",
]

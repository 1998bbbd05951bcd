"""The closest pair of bodies over time, for a page."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array
from selfmotion.collision import CollisionModel
from selfmotion.motion import Trajectory

# A distance query costs milliseconds, a hundred times one point of the other curves.
_POINTS = 121


@dataclass(frozen=True, eq=False)
class ClearanceCurve:
    """Clearance on a uniform grid of times.

    Attributes
    ----------
    t : (K,)
        Times from the start of the motion [s].
    value : (K,)
        Smallest distance over all pairs of bodies [m].
    pairs : tuple of (str, str)
        The pair at each time.
    """

    t: Array
    value: Array
    pairs: tuple[tuple[str, str], ...]


def clearance_curve(
    trajectory: Trajectory, models: Sequence[CollisionModel]
) -> ClearanceCurve | None:
    """Return the clearance along a motion, or None where there is no pair of bodies to check."""
    watched = [model for model in models if model.pairs]
    if not watched:
        return None
    times = np.linspace(0.0, trajectory.duration, _POINTS)
    clock = np.minimum(trajectory.t[0] + times, trajectory.t[-1])
    found = [
        min((model.distance(q) for model in watched), key=lambda closest: closest.value)
        for q in trajectory(clock)
    ]
    return ClearanceCurve(
        times,
        np.array([each.value for each in found]),
        tuple((each.first, each.second) for each in found),
    )

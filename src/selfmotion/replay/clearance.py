"""The closest pair of bodies over time, for a page."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from selfmotion.arrays import Array
from selfmotion.trajectory import Trajectory

# A distance query costs milliseconds, a hundred times one point of the other curves.
_POINTS = 121


class Clearance(Protocol):
    """A smallest distance [m] and the names of the two bodies."""

    @property
    def value(self) -> float: ...  # noqa: D102
    @property
    def first(self) -> str: ...  # noqa: D102
    @property
    def second(self) -> str: ...  # noqa: D102


class Distances(Protocol):
    """What a replay asks of a collision model: its obstacles, and the clearance at q (n,)."""

    @property
    def obstacles(self) -> Sequence[Any]: ...  # noqa: D102
    def distance(self, q: Array, /) -> Clearance: ...  # noqa: D102


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


def clearance_curve(trajectory: Trajectory, distances: Distances) -> ClearanceCurve:
    """Ask for the clearance along a motion."""
    times = np.linspace(0.0, trajectory.duration, _POINTS)
    found = [distances.distance(q) for q in trajectory(trajectory.t[0] + times)]
    return ClearanceCurve(
        times,
        np.array([each.value for each in found]),
        tuple((each.first, each.second) for each in found),
    )

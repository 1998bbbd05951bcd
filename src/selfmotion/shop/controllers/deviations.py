"""Largest deviation of a controller's motion from the planned one."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array
from selfmotion.certificate import Tolerance
from selfmotion.model.motion import Trajectory
from selfmotion.model.robot import Chain
from selfmotion.shop.controllers.segments import Segment

# Factor from the largest deviation at the sampled times to an upper bound between them.
SAMPLING_FACTOR = 1.02


class Deviation(NamedTuple):
    """Largest deviation of a controller's motion from the planned one.

    Attributes
    ----------
    position, rotation : float
        Of the tool [m, rad].
    joint : float
        Of any joint [rad or m].
    """

    position: float
    rotation: float
    joint: float

    def share(self, allowed: Tolerance) -> float:
        """Return the deviation as a share of the tolerance; above 1 it is violated."""
        rotation = max(self.rotation, self.joint) / allowed.rotation
        return SAMPLING_FACTOR * max(self.position / allowed.position, rotation)

    @property
    def stated(self) -> "Deviation":
        """The value that files state: with a factor for maxima between the sampled times."""
        return Deviation(
            SAMPLING_FACTOR * self.position,
            SAMPLING_FACTOR * self.rotation,
            SAMPLING_FACTOR * self.joint,
        )


class Deviations(NamedTuple):
    """Largest deviations along seams, and in free moves.

    Attributes
    ----------
    path, moves : Deviation
    """

    path: Deviation
    moves: Deviation

    def worse(self, other: "Deviations") -> "Deviations":
        """Return the componentwise maximum."""
        return Deviations(*(Deviation(*map(max, *pair)) for pair in zip(self, other, strict=True)))


NO_DEVIATION = Deviation(0.0, 0.0, 0.0)


def deviation_of(
    segment: Segment, motion: Trajectory, chains: Sequence[Chain], first: float = 0.0
) -> Deviation:
    """Return the largest deviation of a segment from a motion over all interpolations.

    Between targets a controller may interpolate linearly in joint space; blend each corner along
    the line between the midpoints of its two sides, the largest blend of any controller; or follow
    the clamped cubic spline through all targets. All are compared at equal times, which bounds the
    speeds as well; segments at a speed are compared at equal arc lengths.
    """
    times, exact = segment.evaluation_times(), segment.reference(motion, first)
    worst = NO_DEVIATION
    for line in segment.interpolated(times):
        worst = Deviation(*map(max, worst, deviation_between(line, exact, chains)))
    return worst


def deviation_between(q: Array, exact: Array, chains: Sequence[Chain]) -> Deviation:
    """Return the largest deviation between two sequences of configurations (K, n).

    Infinite where a configuration is NaN: inverse kinematics has no solution there.
    """
    from scipy.spatial.transform import Rotation

    if not np.isfinite(q).all():
        return Deviation(np.inf, np.inf, np.inf)
    position = rotation = 0.0
    for chain in chains:
        _, rotations, translations = chain.along(q)
        _, exact_rotations, exact_translations = chain.along(exact)
        distances = np.linalg.norm(translations - exact_translations, axis=1)
        position = max(position, float(distances.max()))
        relative = np.einsum("kji,kjl->kil", rotations, exact_rotations)
        angles = Rotation.from_matrix(relative).magnitude()
        rotation = max(rotation, float(angles.max()))
    return Deviation(position, rotation, float(np.abs(q - exact).max()))

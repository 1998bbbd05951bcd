"""Distance from obstacles, and of links from each other."""

from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

import numpy as np

from selfmotion.arrays import Array
from selfmotion.collision import ClearanceModel, Clearances, CollisionModel, Obstacle
from selfmotion.constraints.base import NodePartials, NodeTangents, motion_of_order
from selfmotion.errors import ProblemError
from selfmotion.robot import RobotModel
from selfmotion.samples import Samples
from selfmotion.task import Task


@dataclass(frozen=True, eq=False)
class Clearance:
    """The arm keeps a distance from obstacles and from itself.

    While optimising, links are capsules that contain their meshes; the certificate measures the
    meshes themselves.

    Parameters
    ----------
    obstacles : sequence of Obstacle
        The world.
    distance : float
        Smallest distance [m].
    srdf : path, optional
        File whose ``disable_collisions`` are left out.
    """

    obstacles: tuple[Obstacle, ...] = ()
    distance: float = 5e-3
    srdf: str | Path | None = None

    def model(self, robot: RobotModel) -> CollisionModel:
        """Return the exact model that the certificate measures with."""
        return CollisionModel(robot, self.obstacles, self.srdf)

    def bind(self, robot: RobotModel, task: Task, start: Array, end: Array) -> "BoundClearance":
        """See `Constraint.bind`."""
        if not self.distance >= 0.0:
            raise ProblemError(f"clearance: distance is {self.distance} m, expected ≥ 0")
        return BoundClearance(_clearance_model(self, robot), self.distance)


# Each start of a plan binds the constraint anew; fitting the world to the arm takes longer than
# many a motion. Both arguments are compared by identity.
@lru_cache(maxsize=4)
def _clearance_model(clearance: Clearance, robot: RobotModel) -> ClearanceModel:
    return ClearanceModel(clearance.model(robot))


@dataclass(frozen=True, eq=False)
class BoundClearance:
    """h = (d_min + margin - d) / 0.1 m for each pair of bodies."""

    model: ClearanceModel
    distance: float
    name: str = "clearance"
    equality = False
    margin: float = 5e-4
    _last: list[Any] = field(default_factory=list, repr=False)

    @property
    def tolerance(self) -> float:
        """See `BoundConstraint.tolerance`: half the margin."""
        return 0.5 * self.margin / _METRE

    def residual(self, samples: Samples) -> Array:
        """See `BoundConstraint.residual`."""
        return (self.distance + self.margin - self._clearances(samples).values) / _METRE

    def pullback(self, samples: Samples, weights: Array) -> NodePartials:
        """See `BoundConstraint.pullback`."""
        return NodePartials(q=self._clearances(samples).pullback(-weights / _METRE))

    def tangents(self, samples: Samples, motion: NodeTangents) -> Array:
        """See `BoundConstraint.tangents`."""
        jacobian = self._clearances(samples).jacobian()
        return np.asarray(-(jacobian @ motion.q) / _METRE)

    def _clearances(self, samples: Samples) -> Clearances:
        """Return the distances at the nodes; those of the last motion are kept."""
        q = motion_of_order(samples, 0)
        if not self._last or not np.array_equal(self._last[0], q):
            self._last[:] = [q, self.model.clearances(q)]
        return cast(Clearances, self._last[1])

    def describe(self, samples: Samples, row: int, column: int) -> str:
        """See `BoundConstraint.describe`."""
        first, second = self.model.pairs[column]
        value = self.distance + self.margin - self.residual(samples)[row, column] * _METRE
        return (
            f"capsules of '{first}' and '{second}' are {value * 1e3:.2f} mm apart at t = "
            f"{samples.grid.nodes[row]:.3f} s, wanted {self.distance * 1e3:.2f} mm"
        )


# Clearances count in units of this, to weigh about as much as joint angles.
_METRE = 0.1

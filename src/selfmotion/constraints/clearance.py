"""Distance from obstacles, and of links from each other."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from selfmotion.arrays import Array
from selfmotion.collision import ClearanceModel, CollisionModel, Obstacle
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

    def bind(self, robot: RobotModel, task: Task, start: Array) -> "BoundClearance":
        """See `Constraint.bind`."""
        if not self.distance >= 0.0:
            raise ProblemError(f"clearance: distance is {self.distance} m, expected ≥ 0")
        return BoundClearance(ClearanceModel(self.model(robot)), self.distance)


@dataclass(frozen=True, eq=False)
class BoundClearance:
    """h = (d_min + margin - d) / 0.1 m for each pair of bodies."""

    model: ClearanceModel
    distance: float
    name: str = "clearance"
    equality = False
    margin: float = 5e-4

    @property
    def tolerance(self) -> float:
        """See `BoundConstraint.tolerance`: half the margin."""
        return 0.5 * self.margin / _METRE

    def residual(self, samples: Samples) -> Array:
        """See `BoundConstraint.residual`."""
        values = self.model.clearances(motion_of_order(samples, 0)).values
        return (self.distance + self.margin - values) / _METRE

    def pullback(self, samples: Samples, weights: Array) -> NodePartials:
        """See `BoundConstraint.pullback`."""
        clearances = self.model.clearances(motion_of_order(samples, 0))
        return NodePartials(q=clearances.pullback(-weights / _METRE))

    def tangents(self, samples: Samples, motion: NodeTangents) -> Array:
        """See `BoundConstraint.tangents`."""
        jacobian = self.model.clearances(motion_of_order(samples, 0)).jacobian()
        return np.asarray(-(jacobian @ motion.q) / _METRE)

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

"""Distances of pairs of bodies: of their hulls first, of the meshes where those do not decide."""

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.model.collision.bodies import Body, moved_by
from selfmotion.model.collision.distances import HullDistances, Ints
from selfmotion.model.collision.mesh_distances import MeshDistances
from selfmotion.model.robot import RobotModel

# Joints that differ by less than this [rad or m] give the same distances, to rounding.
_ALIKE = 1e-9


class PairDistances:
    """Distances of pairs of bodies; the meshes are visited for those alone that may decide.

    Parameters
    ----------
    robot : RobotModel
    bodies : sequence of Body
    pairs : (P, 2)
        Which bodies.

    Attributes
    ----------
    hulls : HullDistances
    meshes : MeshDistances
    """

    def __init__(self, robot: RobotModel, bodies: Sequence[Body], pairs: Ints) -> None:
        self.hulls = HullDistances(robot, bodies, pairs)
        self.meshes = MeshDistances(
            [body.solid for body in bodies], [body.name for body in bodies], pairs
        )
        self._robot, self._bodies, self._pairs = robot, bodies, pairs

    def closest(self, q: Array, bounds: Array, below: float = math.inf) -> tuple[float, int]:
        """Return the smallest distance at q (n,) and its pair, with lower bounds (P,) known.

        `below` and no pair (-1) where none is smaller.
        """
        places = self.hulls.place(q)
        near = np.flatnonzero(bounds < below).tolist()
        found = sorted((self.hulls.distance(pair, bounds[pair]), pair) for pair in near)
        best = below, -1
        for hulls, pair in found:
            if hulls >= best[0]:
                break
            value = self.meshes.refine(places, pair, hulls, best[0])
            if value < best[0]:
                best = value, pair
        return best

    def points(self, q: Array, pair: int) -> Array:
        """Return the two nearest points of a pair at q (n,), in world axes, (2, 3) [m]."""
        return self.meshes.points(self.hulls.place(q), pair)

    def distances(self, q: Array, within: Array, exact_below: Array) -> Array:
        """Return the distances at samples (K, n), (K, P); see `CollisionModel.distances`."""
        values = self.hulls.lower_bounds(q, float(within.max(initial=-math.inf)))
        rows, pairs = np.nonzero(values < within)
        placed, places = -1, None
        for row, pair in zip(rows.tolist(), pairs.tolist(), strict=True):
            if row != placed:
                placed, places = row, self.hulls.place(q[row])
            hulls = self.hulls.distance(pair, values[row, pair])
            far = hulls >= exact_below[row, pair]
            values[row, pair] = hulls if far else self.meshes.refine(places, pair, hulls)
        return values

    def closer(self, q: Array, margin: float) -> Flags:
        """Return at which samples (K, n) a pair is closer than the margin, (K,)."""
        bounds = self.hulls.lower_bounds(q, margin)
        found, open_ = self.hulls.closer(q, bounds, margin, self.meshes.hulls_decide)
        undecided: dict[int, list[tuple[int, float]]] = {}
        for row, pair, hulls in open_:
            undecided.setdefault(pair, []).append((row, hulls))
        # The smallest bound usually decides, and comes first.
        for pair, near in sorted(undecided.items(), key=lambda item: min(h for _, h in item[1])):
            open_rows = [(row, hulls) for row, hulls in near if not found[row]]
            rows = np.array([row for row, _ in open_rows], dtype=np.int64)
            found[rows] = self._by_meshes(pair, q[rows], [hulls for _, hulls in open_rows], margin)
        return found

    def _by_meshes(self, pair: int, q: Array, hulls: Sequence[float], margin: float) -> Flags:
        """Return the mask of a pair whose hulls and meshes are closer than the margin, (K,).

        Configurations (K, n) with the same relative placement of the bodies are computed once:
        along a self-motion the same joints often rest.
        """
        joints = np.round(q[:, self._moving[pair]] / _ALIKE)
        _, once, which = np.unique(joints, axis=0, return_index=True, return_inverse=True)
        closer = [
            self.meshes.refine(self.hulls.place(q[row]), pair, hulls[row], margin) < margin
            for row in once.tolist()
        ]
        return np.array(closer, dtype=bool)[which.reshape(-1)]

    @cached_property
    def _moving(self) -> Flags:
        """Which joints move one body of each pair and not the other, (P, n)."""
        first, second = moved_by(self._bodies, self._robot)[self._pairs.T]
        parted = (first != second).astype(np.float64)
        return np.asarray(self._robot.coupling.bounds(parted) > 0.0)

"""Distances between the robot's real collision geometry, itself and the world."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.basics import Array, CollisionError
from selfmotion.collision import shapes
from selfmotion.collision.obstacles import Obstacle
from selfmotion.collision.pairs import Body, candidate_pairs
from selfmotion.robot import RobotModel


@dataclass(frozen=True)
class Closest:
    """The smallest distance found, and where.

    Attributes
    ----------
    value : float
        [m]; negative when the two overlap, inf when there is no pair to check.
    first, second : str
        The two links, or link and obstacle; empty when there is no pair.
    index : int
        Row of the samples it was found in.
    """

    value: float
    first: str
    second: str
    index: int = 0


_NO_PAIR = Closest(math.inf, "", "")


class CollisionModel:
    """Exact clearance of an arm from itself and from obstacles that stand still.

    Every body is a solid. While two bodies are apart their distance is that of the real meshes.
    When they overlap, the value is minus the depth by which their convex hulls do, an upper bound
    of the true depth; a mesh that fills its hull to 0.1 % of the volume counts as the hull. A body
    wholly inside another one overlaps it, which the distance of two surfaces alone would miss.

    Parameters
    ----------
    robot : RobotModel
        The arm. All its links count, those on locked joints too, where they are held.
    obstacles : sequence of Obstacle
        The world. The robot's immovable base is not checked against it.
    srdf : Path, optional
        File whose ``<disable_collisions>`` pairs are left out.

    Raises
    ------
    CollisionError
        Two obstacles, or an obstacle and a link, have the same name; a mesh or the SRDF cannot be
        read.
    RobotError
        A mesh of the robot is missing.

    Notes
    -----
    Links joined by a movable joint are not checked against each other, nor are pairs that overlap
    in each of 500 sampled configurations: they touch by design. Without collision geometry in the
    URDF (`has_bodies` is False) there is no pair at all.

    Distances of the convex hulls (GJK) bound those of the meshes from below, so the meshes are
    visited only for the few pairs that may hold the minimum.
    """

    def __init__(
        self,
        robot: RobotModel,
        obstacles: Sequence[Obstacle] = (),
        srdf: str | Path | None = None,
    ) -> None:
        self.robot = robot
        self.obstacles = tuple(obstacles)
        self._meshes = robot.geometry(pin.GeometryType.COLLISION)
        self.has_bodies = len(self._meshes.geometryObjects) > 0
        links = [
            Body(robot.model.frames[piece.parentFrame].name, piece.parentJoint, is_obstacle=False)
            for piece in self._meshes.geometryObjects
        ]
        _check_names(self.obstacles, robot.urdf.links)
        world = [Body(obstacle.name, 0, is_obstacle=True) for obstacle in self.obstacles]
        self._bodies = links + world
        for obstacle in self.obstacles:
            self._meshes.addGeometryObject(_geometry_object(obstacle))
        self._hulls = _hulls_of(self._meshes)
        self._solids = [shapes.Solid(piece.geometry) for piece in self._meshes.geometryObjects]
        self._set_pairs(candidate_pairs(self._bodies, robot.urdf, srdf))
        self._set_pairs(self._not_always_touching())

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Names of the bodies that are checked; a link of several pieces appears repeatedly."""
        return tuple((self._bodies[i].name, self._bodies[j].name) for i, j in self._index_pairs)

    def distance(self, q: npt.ArrayLike) -> Closest:
        """Return the smallest distance over all pairs at `q`.

        Raises
        ------
        RobotError
            `q` is not a configuration of the arm.
        """
        return self._closest(self.robot.configuration(q), _NO_PAIR, 0)

    def worst(self, q_samples: npt.ArrayLike) -> Closest:
        """Return the smallest distance over a motion (K, n); its `index` is the row.

        Raises
        ------
        RobotError
            A row is not a configuration of the arm.
        """
        worst = _NO_PAIR
        for index, q in enumerate(np.atleast_2d(np.asarray(q_samples, dtype=np.float64))):
            worst = self._closest(self.robot.configuration(q), worst, index)
        return worst

    def collides(self, q: Array, margin: float = 0.0) -> bool:
        """Whether some pair is closer than `margin` [m] at `q` (n,); made for many calls.

        The convex hulls decide alone where they are apart by more than the margin, and where all
        meshes are convex to 0.1 % of the volume; only other meshes are visited. So the answer is
        never False in error, and True in error within the gap of mesh and hull at most.

        Raises
        ------
        RobotError
            `q` is not a configuration of the arm.
        """
        if q.shape != (self.robot.dof,) or not math.isfinite(q.dot(q)):
            self.robot.configuration(q)
        if not self._index_pairs:
            return False
        if margin != self._margin:
            self._set_margin(margin)
        self.place_hulls(q)
        self._broad_phase.update(False)
        if not pin.computeCollisions(self._broad_phase, True):
            return False
        if self._hulls_decide:
            return True
        lower = self._lower_bounds()
        near = np.flatnonzero(lower < margin)
        return any(self._pair_distance(int(i), lower[i]) < margin for i in near)

    def overlaps(self, q_samples: Array) -> dict[tuple[str, str], npt.NDArray[np.bool_]]:
        """Return for each pair of names at which samples (K, n) the two overlap, (K,)."""
        found = {names: np.zeros(len(q_samples), dtype=bool) for names in self.pairs}
        for k, q in enumerate(q_samples):
            for i in np.flatnonzero(self._place(self.robot.configuration(q)) <= 0.0):
                row = found[self._names(int(i))]
                row[k] = row[k] or self._pair_distance(int(i), 0.0) <= 0.0
        return found

    def place_hulls(self, q: Array) -> None:
        """Place the convex hulls at `q` (n,), for `hull_contact`."""
        pin.updateGeometryPlacements(self.robot.model, self._data, self._hulls, self._hull_data, q)

    def hull_contact(self, pairs: Sequence[int]) -> tuple[float, ...]:
        """Return the smallest distance of some pairs' hulls as they are placed, and where.

        Made for many calls.

        Parameters
        ----------
        pairs : sequence of int
            Indices into `pairs`.

        Returns
        -------
        (7,)
            The distance [m], minus the depth where they overlap; the normal from the second body
            to the first; a point of the first that is nearest. In world axes.
        """
        model, data = self._hulls, self._hull_data
        contact = pin.computeDistance(model, data, pairs[0])
        for pair in pairs[1:]:
            other = pin.computeDistance(model, data, pair)
            if other.min_distance < contact.min_distance:
                contact = other
        x, y, z = contact.normal.tolist()
        return (contact.min_distance, -x, -y, -z, *contact.getNearestPoint1().tolist())

    def _closest(self, q: Array, best: Closest, index: int) -> Closest:
        """Return the smaller of `best` and the distance at `q`."""
        if not self._index_pairs:
            return best
        lower = self._place(q)
        for i in np.argsort(lower, kind="stable"):
            if lower[i] >= best.value:
                break
            value = self._pair_distance(int(i), float(lower[i]))
            if value < best.value:
                best = Closest(value, *self._names(int(i)), index)
        return best

    def _names(self, pair: int) -> tuple[str, str]:
        first, second = self._index_pairs[pair]
        return self._bodies[first].name, self._bodies[second].name

    def _place(self, q: Array) -> Array:
        """Place all bodies and return the distances of their hulls, (P,)."""
        self.place_hulls(q)
        return self._lower_bounds()

    def _lower_bounds(self) -> Array:
        """Return the distances of the hulls as they are placed, and place the meshes with them."""
        pin.updateGeometryPlacements(self.robot.model, self._data, self._meshes, self._mesh_data)
        pin.computeDistances(self._hulls, self._hull_data)
        return np.array([result.min_distance for result in self._hull_results])

    def _pair_distance(self, pair: int, hulls: float) -> float:
        """Return the distance of one pair [m], given that of its convex hulls."""
        if pair not in self._refined or (hulls <= 0.0 and self._refined[pair]):
            return hulls
        surfaces = pin.computeDistance(self._meshes, self._mesh_data, pair).min_distance
        if hulls > 0.0:
            return float(surfaces)
        if surfaces <= 0.0 or self._nested(*self._index_pairs[pair]):
            return hulls
        return float(surfaces)

    def _nested(self, first: int, second: int) -> bool:
        """Whether one body is inside the other, their surfaces apart."""
        return self._holds(first, second) or self._holds(second, first)

    def _holds(self, outer: int, inner: int) -> bool:
        relative = self._mesh_data.oMg[outer].actInv(self._mesh_data.oMg[inner])
        points = self._solids[inner].seeds @ relative.rotation.T + relative.translation
        return self._solids[outer].contains_any(points)

    def _not_always_touching(self) -> list[tuple[int, int]]:
        rng = np.random.default_rng(0)
        lower, upper = self.robot.finite_limits()
        touching = [
            i
            for i, (a, b) in enumerate(self._index_pairs)
            if not (self._bodies[a].is_obstacle or self._bodies[b].is_obstacle)
        ]
        for _ in range(_SAMPLES):
            if not touching:
                break
            distances = self._place(rng.uniform(lower, upper))
            touching = [i for i in touching if self._pair_distance(i, distances[i]) <= 0.0]
        return [pair for i, pair in enumerate(self._index_pairs) if i not in set(touching)]

    def _set_pairs(self, pairs: list[tuple[int, int]]) -> None:
        self._index_pairs = pairs
        for geometry in (self._hulls, self._meshes):
            geometry.removeAllCollisionPairs()
            for first, second in pairs:
                geometry.addCollisionPair(pin.CollisionPair(first, second))
        # Own data: neither threads nor the robot's kinematics share state with the checks.
        self._data = self.robot.model.createData()
        self._hull_data = self._hulls.createData()
        self._mesh_data = self._meshes.createData()
        for request in self._hull_data.distanceRequests:
            request.gjk_tolerance = _SOLVED
        self._hull_results = [self._hull_data.distanceResults[i] for i in range(len(pairs))]
        self._refined = self._pairs_to_refine()
        self._hulls_decide = all(self._refined.values())
        self._broad_phase = pin.BroadPhaseManager_DynamicAABBTreeCollisionManager(
            self.robot.model, self._hulls, self._hull_data
        )
        self._set_margin(0.0)

    def _set_margin(self, margin: float) -> None:
        self._margin = margin
        for i in range(len(self._index_pairs)):
            self._hull_data.collisionRequests[i].security_margin = margin

    def _pairs_to_refine(self) -> dict[int, bool]:
        """Map the pairs with a mesh to whether the hulls decide about overlap all the same."""
        return {
            index: self._solids[i].is_convex and self._solids[j].is_convex
            for index, (i, j) in enumerate(self._index_pairs)
            if self._solids[i].is_mesh or self._solids[j].is_mesh
        }


# Relative accuracy of distances of hulls: at coal's 1e-6 they jump by a micrometre from one
# configuration to the next, which an optimiser takes for slope. Depths of overlap keep coal's
# accuracy: asked for more, its EPA now and then fails and returns the largest float.
_SOLVED = 1e-12

# Configurations in which a pair must overlap to count as touching by design.
_SAMPLES = 500


def _check_names(obstacles: Sequence[Obstacle], links: Sequence[str]) -> None:
    taken = set(links)
    for obstacle in obstacles:
        if obstacle.name in taken:
            raise CollisionError(f"{obstacle.label}: a link or another obstacle has this name too")
        taken.add(obstacle.name)


def _geometry_object(obstacle: Obstacle) -> Any:
    return pin.GeometryObject(
        obstacle.name, 0, 0, obstacle.pose, shapes.obstacle_geometry(obstacle)
    )


def _hulls_of(meshes: Any) -> Any:
    hulls = pin.GeometryModel()
    for piece in meshes.geometryObjects:
        hull = shapes.convex_hull(piece.geometry)
        hulls.addGeometryObject(
            pin.GeometryObject(
                piece.name, piece.parentJoint, piece.parentFrame, piece.placement, hull
            )
        )
    return hulls

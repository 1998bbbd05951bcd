"""Solids as coal knows them: obstacles, convex hulls, points inside meshes."""

from functools import cached_property
from typing import Any

import coal
import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, CollisionError
from selfmotion.collision.obstacles import Box, Capsule, Cylinder, Mesh, Obstacle, Sphere

# A mesh whose hull is larger by less than this share of its volume counts as convex.
_CONVEX = 1e-3


def obstacle_geometry(obstacle: Obstacle) -> Any:
    """Return the coal geometry of an obstacle, in the obstacle's frame.

    Raises
    ------
    CollisionError
        A mesh file is missing or cannot be read.
    """
    match obstacle:
        case Box():
            return coal.Box(*obstacle.size.tolist())
        case Sphere():
            return coal.Sphere(obstacle.radius)
        case Cylinder():
            return coal.Cylinder(obstacle.radius, obstacle.length)
        case Capsule():
            return coal.Capsule(obstacle.radius, obstacle.length)
        case Mesh():
            return _load(obstacle)
    raise CollisionError(f"{obstacle!r} is no obstacle")


def _load(mesh: Mesh) -> Any:
    if not mesh.file.is_file():
        raise CollisionError(f"{mesh.label}: no such file: {mesh.file}")
    try:
        return coal.MeshLoader().load(str(mesh.file), np.full(3, mesh.scale))
    except (RuntimeError, ValueError) as error:
        raise CollisionError(f"{mesh.label}: {mesh.file} cannot be read: {error}") from error


def is_mesh(geometry: Any) -> bool:
    """Whether coal sees surfaces only, rather than a solid."""
    return isinstance(geometry, coal.BVHModelBase)


def convex_hull(geometry: Any) -> Any:
    """Return the convex hull of a mesh, anything else as it is.

    A flat mesh has no hull and is returned as it is too.
    """
    if not is_mesh(geometry):
        return geometry
    try:
        geometry.buildConvexHull(True, "Qt")
    except RuntimeError:
        return geometry
    return geometry.convex


class Solid:
    """What coal cannot tell of a mesh: whether it is convex, and what is inside.

    Attributes
    ----------
    geometry : coal geometry
        Its frame is that of all points here.
    """

    def __init__(self, geometry: Any) -> None:
        self.geometry = geometry
        self.is_mesh = is_mesh(geometry)

    @cached_property
    def is_convex(self) -> bool:
        """Whether it and its convex hull are the same solid, to 0.1 % of the volume."""
        if not self.is_mesh:
            return True
        hull = convex_hull(self.geometry)
        if is_mesh(hull):
            return False
        volume: float = hull.computeVolume()
        return bool(abs(volume - self.geometry.computeVolume()) <= _CONVEX * volume)

    @cached_property
    def seeds(self) -> Array:
        """Points of the solid, one at least on each connected surface, (S, 3)."""
        if not self.is_mesh:
            return np.zeros((1, 3))
        faces, count = triangles(self.geometry), self.geometry.num_vertices
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        links = coo_array(
            (np.ones(2 * len(faces)), (faces[:, :2].ravel(), faces[:, 1:].ravel())),
            shape=(count, count),
        )
        _, component = connected_components(links, directed=False)
        _, first = np.unique(component[faces[:, 0]], return_index=True)
        vertices: Array = self.geometry.vertices()[faces[first, 0]]
        return vertices

    @cached_property
    def _corners(self) -> Array:
        corners: Array = self.geometry.vertices()[triangles(self.geometry)]
        return corners

    def contains_any(self, points: Array) -> bool:
        """Whether one of the points (S, 3) is inside.

        Inside a mesh means a winding number above one half, which also serves meshes with holes.
        """
        if not self.is_mesh:
            return any(_point_distance(self.geometry, point) <= 0.0 for point in points)
        box = self.geometry.aabb_local
        within = np.all((points >= box.min_) & (points <= box.max_), axis=1)
        return any(abs(winding_number(self._corners, point)) > 0.5 for point in points[within])


def triangles(mesh: Any) -> npt.NDArray[np.intp]:
    """Return the corner indices of a mesh's triangles, (T, 3)."""
    corners = (mesh.tri_indices(i) for i in range(mesh.num_tris))
    return np.array([(t[0], t[1], t[2]) for t in corners], dtype=np.intp).reshape(-1, 3)


def winding_number(corners: Array, point: Array) -> float:
    """Return how often the triangles (T, 3, 3) wind around the point: 1 inside, 0 outside.

    The sum of their solid angles over 4π, after Van Oosterom and Strackee (1983).
    """
    a, b, c = np.moveaxis(corners - point, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    edges = la * lb * lc + _dot(a, b) * lc + _dot(b, c) * la + _dot(c, a) * lb
    return float(np.arctan2(volume, edges).sum() / (2.0 * np.pi))


def _dot(a: Array, b: Array) -> Array:
    product: Array = np.einsum("ij,ij->i", a, b)
    return product


def _point_distance(geometry: Any, point: Array) -> float:
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    place = coal.Transform3s(np.eye(3), point)
    coal.distance(coal.Sphere(1e-9), place, geometry, coal.Transform3s(), request, result)
    return float(result.min_distance)

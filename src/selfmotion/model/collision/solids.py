"""Solids for coal: convex hulls, points inside a mesh, extent of a body."""

from functools import cached_property
from typing import Any

import coal
import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, CollisionError

Indices = npt.NDArray[np.int64]

# Largest relative excess of a hull's volume over that of a mesh that counts as convex.
_CONVEX = 1e-3
# A body that reaches farther from its origin [m] has wrong units, at least.
_LARGEST = 1e4
# A mesh thinner than this share of its size is flat.
_FLAT = 1e-7
# Half thickness of the hull of a flat mesh [m].
_HALF_THICKNESS = 1e-6
# Tolerance for a point to be in a piece [share of the size].
_INSIDE = 1e-6
# Largest number of points that are checked for it.
_MAX_CHECKED = 20_000
# Points outside of all pieces by more than this belong to a lost part, not to a sliver [share].
_SLIVER = 1e-2
# Cache of decompositions: each model of a cell needs them.
_cut: "dict[tuple[bytes, bytes], tuple[Solid, ...]]" = {}
# Largest number of these.
_MAX_CUT = 32
# coal rejects hulls with a corner of 255 neighbours or more.
_NEIGHBOURS = 250


class Solid:
    """Geometry of a body, its convex hull, and point membership, which coal has not for meshes.

    Parameters
    ----------
    geometry : coal geometry
        Its frame is that of all points here.
    label : str
        Its name in messages.

    Attributes
    ----------
    geometry : coal geometry
    is_mesh : bool
        Whether coal sees surfaces only, rather than a solid.
    hull : coal geometry
        Its convex hull; the geometry itself where that is no mesh.
    is_flat : bool
        A mesh in one plane: it has no inside. Its hull reaches 1 µm beyond it to both sides.

    Raises
    ------
    CollisionError
        The geometry is unbounded, or a mesh has no triangle, corners that are not finite, or all
        of them on one line.
    """

    def __init__(self, geometry: Any, label: str) -> None:
        self.geometry, self.is_mesh = geometry, isinstance(geometry, coal.BVHModelBase)
        self._label = label
        self.is_flat, self.hull = False, geometry
        if self.is_mesh:
            self._check_mesh(label)
            self.is_flat, corners = _thickened(np.array(geometry.vertices()), label)
            self.hull, self._planes = _hull_of(corners, label)
        elif isinstance(geometry, coal.Sphere):
            # coal's formula for a sphere and a cylinder that overlap (3.0.3) is wrong for spheres
            # with their centre near the cylinder's axis; a capsule of length 0 is correct.
            self.hull = coal.Capsule(geometry.radius, 0.0)
        # Not computed before it is needed, here and for the hull.
        self.hull.computeLocalAABB()
        box = self.hull.aabb_local
        self.low, self.high = np.array(box.min_), np.array(box.max_)
        if not np.all(np.abs([self.low, self.high]) < _LARGEST):
            raise CollisionError(
                f"{label}: it reaches from {self.low.tolist()} to {self.high.tolist()} m, expected "
                f"less than {_LARGEST:g} m; is it in other units, or unbounded?"
            )

    def _check_mesh(self, label: str) -> None:
        corners = np.array(self.geometry.vertices())
        if not self.geometry.num_tris:
            raise CollisionError(f"{label}: its mesh has no triangles")
        bad = np.flatnonzero(~np.isfinite(corners).all(axis=1))
        if bad.size:
            raise CollisionError(
                f"{label}: corner {bad[0]} of its mesh is at {corners[bad[0]].tolist()}, not finite"
            )

    @cached_property
    def outline(self) -> tuple[Array, float]:
        """Points (V, 3) and a radius: the body is in the convex hull of the balls there."""
        hull = self.hull
        if isinstance(hull, coal.Capsule | coal.Cylinder):
            ends = np.outer([-hull.halfLength, hull.halfLength], [0.0, 0.0, 1.0])
            return ends, float(hull.radius)
        if isinstance(hull, coal.ConvexBase):
            return np.array(hull.points()), 0.0
        return self._box, 0.0

    def surface(self) -> tuple[Array, Indices]:
        """Return corners (V, 3) and triangles (T, 3) of its surface, for drawings.

        The mesh itself; of other geometry the hull of its corners, or else the box around it.
        """
        if self.is_mesh:
            return self._corners, self._welded
        from scipy.spatial import ConvexHull

        corners = self.outline[0] if isinstance(self.hull, coal.ConvexBase) else self._box
        return corners, np.asarray(ConvexHull(corners).simplices, dtype=np.int64)

    @property
    def _box(self) -> Array:
        sides = zip(self.low, self.high, strict=True)
        return np.array(np.meshgrid(*sides)).reshape(3, -1).T

    @cached_property
    def is_convex(self) -> bool:
        """Whether it and its convex hull are the same solid, to 0.1 % of the volume."""
        if not self.is_mesh:
            return True
        volume = abs(self.hull.computeVolume())
        own = abs(self.geometry.computeVolume())
        return bool(not self.is_flat and abs(volume - own) <= _CONVEX * volume)

    @cached_property
    def pieces(self) -> "tuple[Solid, ...]":
        """Convex solids that together contain it: itself where it is convex, or cannot be cut.

        Its corners and the middles of its triangles (20,000 of these points at most are checked)
        are in the pieces, to a millionth of its size.
        """
        if self.is_convex or self.is_flat or not self.is_closed:
            return (self,)
        key = self._corners.tobytes(), self._welded.tobytes()
        if key not in _cut:
            _cut[key] = self._cover()
            while len(_cut) > _MAX_CUT:
                del _cut[next(iter(_cut))]
        return _cut[key] or (self,)

    def _cover(self) -> "tuple[Solid, ...]":
        """Return `pieces`; none where they do not contain it."""
        from selfmotion.model.collision.decomposition import convex_pieces

        points = np.concatenate([self._corners, self._triangles.mean(axis=1)])
        points = points[:: -(-len(points) // _MAX_CHECKED)]
        size = float(np.ptp(self._corners, axis=0).max())
        pieces = list(convex_pieces(self._corners, self._welded))
        try:
            hulls = [_hull_of(_thickened(part, self._label)[1], self._label) for part in pieces]
            outside, nearest = _outside([planes for _, planes in hulls], points)
            missing = outside > _INSIDE * size
            # Slivers may be lost by rounding: the next piece takes their corners.
            for k in np.unique(nearest[missing & (outside < _SLIVER * size)]).tolist():
                grown = np.concatenate([pieces[k], points[missing & (nearest == k)]])
                hulls[k] = _hull_of(_thickened(grown, self._label)[1], self._label)
        except CollisionError:
            # A piece that is a needle.
            return ()
        outside, _ = _outside([planes for _, planes in hulls], points)
        if np.any(outside > _INSIDE * size):
            return ()
        return tuple(Solid(hull, self._label) for hull, _ in hulls)

    @cached_property
    def is_closed(self) -> bool:
        """Whether it has an inside: it is no mesh, or one of closed surfaces.

        Closed is a surface whose every edge is run through as often in one direction as in the
        other. Corners nearer than 1e-7 of the size count as one.
        """
        if not self.is_mesh:
            return True
        faces, count = self._welded, len(self._corners)
        ahead = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        codes = ahead[:, 0] * count + ahead[:, 1]
        reverse = ahead[:, 1] * count + ahead[:, 0]
        return bool(np.array_equal(np.sort(codes), np.sort(reverse)))

    @cached_property
    def seeds(self) -> Array:
        """Points of the solid, one at least on each connected surface, (S, 3)."""
        if not self.is_mesh:
            return np.zeros((1, 3))
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        faces, count = self._welded, len(self._corners)
        links = coo_array(
            (np.ones(2 * len(faces)), (faces[:, :2].ravel(), faces[:, 1:].ravel())),
            shape=(count, count),
        )
        _, component = connected_components(links, directed=False)
        _, first = np.unique(component[faces[:, 0]], return_index=True)
        return np.asarray(self._corners[faces[first, 0]])

    def contains_any(self, points: Array) -> bool:
        """Whether one of the points (S, 3) is inside a mesh, farther than rounding from it.

        Inside means a winding number above one half, which also serves most meshes with holes.
        Other geometry, whose distances coal measures from the solid, needs no such test.
        """
        if not self.is_mesh or self.is_flat:
            return False
        from selfmotion.model.collision.kernels import winding_number

        within = np.all(points @ self._planes[:, :3].T + self._planes[:, 3] <= 0.0, axis=1)
        return any(abs(winding_number(self._triangles, point)) > 0.5 for point in points[within])

    @cached_property
    def _welded(self) -> Indices:
        """Corners of the triangles, (T, 3), indices into `_corners`; none twice in one."""
        _, index = self._weld
        corners = (self.geometry.tri_indices(i) for i in range(self.geometry.num_tris))
        faces = index[np.array([(t[0], t[1], t[2]) for t in corners], dtype=np.int64)]
        proper = faces[:, [0, 1, 2]] != faces[:, [1, 2, 0]]
        return np.asarray(faces[proper.all(axis=1)])

    @cached_property
    def _triangles(self) -> Array:
        return np.ascontiguousarray(self._corners[self._welded])

    @property
    def _corners(self) -> Array:
        return self._weld[0]

    @cached_property
    def _weld(self) -> tuple[Array, Indices]:
        points = np.array(self.geometry.vertices())
        grid = np.round(points / (_FLAT * float(np.ptp(points, axis=0).max())))
        _, first, index = np.unique(grid, axis=0, return_index=True, return_inverse=True)
        return points[first], index.reshape(-1)


def _outside(solids: list[Array], points: Array) -> tuple[Array, Indices]:
    """Return distances of points (K, 3) from the nearest convex solid's planes, and its number."""
    least, nearest = np.full(len(points), np.inf), np.zeros(len(points), dtype=np.int64)
    for k, planes in enumerate(solids):
        beyond = (points @ planes[:, :3].T + planes[:, 3]).max(axis=1)
        nearest[beyond < least] = k
        least = np.minimum(least, beyond)
    return least, nearest


def _thickened(points: Array, label: str) -> tuple[bool, Array]:
    """Return whether points (V, 3) are in one plane; if so, copies to both sides instead."""
    _, extents, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    if len(extents) < 3 or not extents[1] > _FLAT * extents[0]:
        raise CollisionError(f"{label}: all corners of its mesh are on one line; give it a width")
    if extents[2] > _FLAT * extents[0]:
        return False, points
    offset = _HALF_THICKNESS * axes[2]
    return True, np.concatenate([points + offset, points - offset])


def _hull_of(points: Array, label: str) -> tuple[Any, Array]:
    """Return the convex hull of points (V, 3), and its planes n · x + c = 0 as rows (n, c).

    Of the corners that scipy finds: coal's own function ends the process where there is no hull.
    """
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
        if np.bincount(hull.simplices.ravel()).max() > _NEIGHBOURS:
            # A flat side with many corners is a fan round one of them, but not when joggled.
            hull = ConvexHull(points, qhull_options="QJ")
    except QhullError as error:
        raise CollisionError(f"{label}: its mesh has no convex hull: {error}") from error
    index = np.zeros(len(points), dtype=np.int64)
    index[hull.vertices] = np.arange(len(hull.vertices))
    # qhull's triangles turn either way; coal wants their normals to point outwards.
    a, b, c = points[hull.simplices].transpose(1, 0, 2)
    inward = np.sum(np.cross(b - a, c - a) * hull.equations[:, :3], axis=1) < 0.0
    faces = index[np.where(inward[:, None], hull.simplices[:, ::-1], hull.simplices)]
    corners, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    corners.extend(list(points[hull.vertices]))
    triangles.extend([coal.Triangle(*face) for face in faces.tolist()])
    return coal.Convex(corners, triangles), np.asarray(hull.equations)

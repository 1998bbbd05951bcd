"""Outlines: points, edges and radii whose convex hull contains a piece of geometry."""

from dataclasses import dataclass
from typing import Any

import coal
import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, CollisionError
from selfmotion.collision.shapes import is_mesh, triangles

# Sides of the prism around a cylinder: it is wider than the cylinder by 0.9 %.
_SIDES = 24


@dataclass(frozen=True, eq=False)
class Outline:
    """Balls at points, joined by edges; the solid is within their convex hull.

    Attributes
    ----------
    points : (N, 3)
        Centres of the balls [m].
    radii : (N,)
        Their radii [m], 0 but for round geometry.
    edges : (E, 2)
        Index pairs. Between two parallel planes, the solid is within the convex hull of the balls
        there and of the points where edges pass the planes.
    """

    points: Array
    radii: Array
    edges: npt.NDArray[np.intp]

    def moved(self, placement: Any) -> "Outline":
        """Return it in the axes that `placement` (SE3) is given in."""
        points = self.points @ placement.rotation.T + placement.translation
        return Outline(points, self.radii, self.edges)

    def slab(self, axis: Array, low: float, high: float) -> tuple[Array, Array]:
        """Return points (M, 3) and radii (M,) of the part with low ≤ axis · x ≤ high."""
        height = self.points @ axis
        inside = (height >= low) & (height <= high)
        points, radii = [self.points[inside]], [self.radii[inside]]
        start, end = self.edges.T
        for level in (low, high):
            passes = (height[start] - level) * (height[end] - level) < 0.0
            a, b = start[passes], end[passes]
            s = (level - height[a]) / (height[b] - height[a])
            points.append(self.points[a] + s[:, None] * (self.points[b] - self.points[a]))
            radii.append(np.maximum(self.radii[a], self.radii[b]))
        return np.concatenate(points), np.concatenate(radii)


def join(outlines: list[Outline]) -> Outline:
    """Return all outlines as one."""
    offsets = np.cumsum([0, *(len(outline.points) for outline in outlines)])
    return Outline(
        np.concatenate([outline.points for outline in outlines]),
        np.concatenate([outline.radii for outline in outlines]),
        np.concatenate(
            [o.edges + offset for o, offset in zip(outlines, offsets, strict=False)]
        ).astype(np.intp),
    )


def outline(geometry: Any) -> Outline:
    """Return the outline of a coal geometry in its own axes.

    Raises
    ------
    CollisionError
        It is of a kind that URDF does not know.
    """
    if is_mesh(geometry):
        faces = triangles(geometry)
        edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        points = np.array(geometry.vertices())
        return Outline(points, np.zeros(len(points)), np.unique(np.sort(edges, axis=1), axis=0))
    if isinstance(geometry, coal.Sphere):
        return Outline(np.zeros((1, 3)), np.array([geometry.radius]), np.zeros((0, 2), np.intp))
    if isinstance(geometry, coal.Capsule):
        ends = np.array([[0.0, 0.0, -geometry.halfLength], [0.0, 0.0, geometry.halfLength]])
        return Outline(ends, np.full(2, geometry.radius), np.array([[0, 1]]))
    if isinstance(geometry, coal.Box):
        rim = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * geometry.halfSide[:2]
        return _prism(rim, geometry.halfSide[2])
    if isinstance(geometry, coal.Cylinder):
        angle = 2.0 * np.pi / _SIDES * np.arange(_SIDES)
        rim = np.column_stack([np.cos(angle), np.sin(angle)])
        return _prism(rim * geometry.radius / np.cos(np.pi / _SIDES), geometry.halfLength)
    raise CollisionError(f"collision geometry {type(geometry).__name__} has no outline")


def extreme(points: Array, radii: Array) -> tuple[Array, Array]:
    """Return those of the balls that decide about the convex hull."""
    if radii.any() or len(points) < 5:
        return points, radii
    from scipy.spatial import ConvexHull, QhullError

    try:
        corners = ConvexHull(points).vertices
    except QhullError:  # all in one plane
        return points, radii
    return points[corners], radii[corners]


def _prism(rim: Array, half: float) -> Outline:
    count = len(rim)
    base = np.arange(count)
    following = (base + 1) % count
    edges = [(base, following), (base + count, following + count), (base, base + count)]
    points = np.concatenate(
        [np.column_stack([rim, np.full(count, level)]) for level in (-half, half)]
    )
    return Outline(
        points, np.zeros(2 * count), np.concatenate([np.column_stack(pair) for pair in edges])
    )

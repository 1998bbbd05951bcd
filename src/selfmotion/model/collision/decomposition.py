"""Convex decomposition of a mesh: pieces that together contain it, for planning.

The solid is cut along planes of its own faces, which recovers bars and plates, and otherwise
through the middle; pieces whose common hull adds little volume are joined again. Cutting and hulls
are Manifold's, which keeps solids closed (E. Lalish, "Manifold",
https://github.com/elalish/manifold). The order of cuts and joins is that of X. Wei et al.,
"Approximate convex decomposition for 3D meshes with collision-aware concavity and tree search",
SIGGRAPH 2022.
"""

import heapq
import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array

# Largest number of pieces: each is a pair with each link.
MAX_PIECES = 32
# A part is cut while its hull adds more than this share of the whole hull's volume.
_EXCESS = 2e-3
# Two are joined where their common hull adds less than this share.
_JOINED = 5e-4
# Planes tried for each cut …
_TRIED = 6
# … among the planes of this number of the largest faces.
_LARGEST = 100
# Parts of more triangles try a single plane, since cuts take long.
_FINE = 3000
# Faces with normals within this angle [rad] …
_SAME_NORMAL = 0.05
# … and offsets within this share of the size are of one plane.
_SAME_PLACE = 0.01
# Smallest extent of a solid on both sides of a plane that cuts it [share of the size].
_CUTS = 2e-3
# Meshes of more triangles are not cut, which would take above half a minute.
_MAX_TRIANGLES = 100_000
# Nearest pieces of each piece that are candidates for joining it.
_NEIGHBOURS = 10
# Factor by which a cut with two small remainders is preferred to one with a large one.
_PREFERENCE = 0.75
# Factor by which a cut through the middle has to be better than one along a face.
_MIDDLE = 1.3


@dataclass(frozen=True, eq=False)
class _Part:
    """A closed part of the solid, or the hull of several joined parts."""

    solid: Any

    @cached_property
    def hull(self) -> Any:
        return self.solid.hull()

    @cached_property
    def size(self) -> float:
        """The volume of its hull."""
        return float(self.hull.volume())

    @cached_property
    def excess(self) -> float:
        """Volume of the hull minus its own."""
        return max(self.size - float(self.solid.volume()), 0.0)

    @cached_property
    def middle(self) -> Array:
        """The middle of the box around it, (3,)."""
        return np.asarray(np.reshape(self.hull.bounding_box(), (2, 3)).mean(axis=0))


def convex_pieces(corners: Array, faces: npt.NDArray[np.int64]) -> tuple[Array, ...]:
    """Return the corners (V, 3) of at most `MAX_PIECES` convex pieces that together contain a mesh.

    Empty where the mesh is not closed, or has more than 100,000 triangles.

    Parameters
    ----------
    corners : (V, 3)
    faces : (T, 3)
        Indices of corners, of either orientation; it is the same for the whole mesh.
    """
    import manifold3d

    if len(faces) > _MAX_TRIANGLES:
        return ()
    shells = _shells(faces)
    # Shells that touch share no corners.
    index = shells[:, None] * len(corners) + faces
    used, index = np.unique(index, return_inverse=True)
    triangles = corners[faces]
    # Six times the volume.
    volume = np.einsum("ti,ti->", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2]))
    turned = np.ascontiguousarray(index.reshape(-1, 3)[:, :: 1 if volume > 0.0 else -1])
    mesh = manifold3d.Mesh64(np.array(corners[used % len(corners)]), turned.astype(np.uint64))
    solid = manifold3d.Manifold(mesh)
    if solid.status() != manifold3d.Error.NoError or solid.is_empty():
        return ()
    whole = float(solid.hull().volume())
    parts = _joined(_cut(solid, whole), whole)
    return tuple(np.array(part.hull.to_mesh64().vert_properties[:, :3]) for part in parts)


def _shells(faces: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return the number of the closed surface of each triangle, (T,).

    Surfaces hang together by edges of two triangles; solids that touch may have edges in common.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    _, index, counts = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    by_edge = np.argsort(index.reshape(-1), kind="stable")
    pairs = by_edge[counts[index.reshape(-1)[by_edge]] == 2].reshape(-1, 2) % len(faces)
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(faces),) * 2)
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)


def _cut(solid: Any, whole: float) -> list[_Part]:
    """Return parts of a solid, whose hull has the volume `whole`, that are nearly convex."""
    order = itertools.count()
    queue = [(-part.excess, next(order), part) for part in _connected(solid)]
    heapq.heapify(queue)
    # Fine parts are joined again, so that more than the limit are allowed here.
    while len(queue) < 2 * MAX_PIECES and -queue[0][0] > _EXCESS * whole:
        _, _, worst = heapq.heappop(queue)
        for part in _best_cut(worst):
            heapq.heappush(queue, (-part.excess, next(order), part))
    return [part for _, _, part in sorted(queue, key=lambda item: item[1])]


def _best_cut(part: _Part) -> list[_Part]:
    """Return the parts on both sides of the plane after which hulls add the least volume."""
    cuts: list[tuple[float, int, list[_Part]]] = []
    for normal, offset, weight in _planes(part):
        sides = part.solid.split_by_plane(normal.tolist(), offset)
        found = [piece for side in sides for piece in _connected(side)]
        left = sum(piece.excess**_PREFERENCE for piece in found)
        cuts.append((weight * left, len(cuts), found))
    return min(cuts)[2]


def _connected(solid: Any) -> list[_Part]:
    """Return the parts of a solid that do not hang together; all as one where one is a cavity."""
    found = solid.decompose()
    if any(part.volume() < 0.0 for part in found):
        found = [solid]
    return [_Part(part) for part in found if part.volume() > 0.0]


def _planes(part: _Part) -> Iterator[tuple[Array, float, float]]:
    """Yield normals, offsets and weights of planes to cut a part along.

    Planes of its faces and through its middle; the weight multiplies the excess after a cut.
    """
    mesh = part.solid.to_mesh64()
    triangles = mesh.vert_properties[mesh.tri_verts.astype(np.int64), :3]
    crossed = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    areas = np.linalg.norm(crossed, axis=1)
    real = areas > 1e-12 * areas.max()
    normals, areas = crossed[real] / areas[real, None], areas[real]
    # A plane is the same seen from behind.
    largest = np.abs(normals).argmax(axis=1)
    normals = normals * np.sign(normals[np.arange(len(normals)), largest])[:, None]
    offsets = np.einsum("ti,ti->t", normals, triangles[real, 0])
    outline = part.hull.to_mesh64().vert_properties[:, :3]
    size = float(np.ptp(outline, axis=0).max())
    keys = np.round(np.column_stack([normals / _SAME_NORMAL, offsets / (_SAME_PLACE * size)]))
    _, first, index = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    weights = np.bincount(index.reshape(-1), areas)
    widest = np.argsort(-weights, kind="stable")[:_LARGEST]
    first, weights = first[widest], weights[widest]
    heights = outline @ normals[first].T - offsets[first]
    depths = np.minimum(heights.max(axis=0), -heights.min(axis=0))
    is_fine = len(triangles) > _FINE
    best = np.argsort(-weights * depths, kind="stable")[: 1 if is_fine else _TRIED]
    for k in best[depths[best] > _CUTS * size].tolist():
        yield normals[first[k]], float(offsets[first[k]]), 1.0
    lengthwise = np.argsort(-np.ptp(outline, axis=0), kind="stable")
    for axis in lengthwise[: 1 if is_fine else 3].tolist():
        yield np.eye(3)[axis], float(part.middle[axis]), _MIDDLE


def _joined(parts: list[_Part], whole: float) -> list[_Part]:
    """Return parts, joined where that adds little, and until there are at most `MAX_PIECES`."""
    alive, order = dict(enumerate(parts)), itertools.count(len(parts))
    costs: dict[tuple[int, int], tuple[float, _Part]] = {}

    def weigh(i: int) -> None:
        others = [j for j in alive if j != i]
        away = [float(np.linalg.norm(alive[j].middle - alive[i].middle)) for j in others]
        for _, j in sorted(zip(away, others, strict=True))[:_NEIGHBOURS]:
            pair = min(i, j), max(i, j)
            if pair not in costs:
                both = _Part(alive[i].hull.batch_hull([alive[i].hull, alive[j].hull]))
                costs[pair] = both.size - alive[i].size - alive[j].size, both

    for i in alive:
        weigh(i)
    while costs:
        (i, j), (added, both) = min(costs.items(), key=lambda item: (item[1][0], item[0]))
        if added > _JOINED * whole and len(alive) <= MAX_PIECES:
            break
        del alive[i], alive[j]
        for pair in [pair for pair in costs if {i, j} & set(pair)]:
            del costs[pair]
        new = next(order)
        alive[new] = both
        weigh(new)
    return list(alive.values())

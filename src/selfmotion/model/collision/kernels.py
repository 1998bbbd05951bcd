"""Compiled: bounding boxes of all pairs at all samples, and winding numbers."""

import math

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, Flags, inlined, kernel
from selfmotion.model.robot import compose, placements

Ints = npt.NDArray[np.int64]
Vector = tuple[float, float, float]
# Edges whose cosine differs from one by less are parallel: the faces decide about them.
_PARALLEL = 1e-6


@inlined
def separation(
    a: Array, b: Array, t: Array, g: Array, h: Array, limit: float, work: Array
) -> float:
    """Return the signed distance of two boxes along the best of 15 axes.

    These are the normals of all faces, and the normals of an edge of each (S. Gottschalk, M. Lin,
    D. Manocha, "OBBTree", SIGGRAPH 1996). Of boxes that overlap it is minus the depth, of others at
    most the distance. The faces alone suffice if they separate by `limit`.

    Parameters
    ----------
    a, b : (3, 3)
        Columns: axes of the boxes.
    t : (3,)
        From the middle of the first to that of the second.
    g, h : (3,)
        Half lengths of the first and of the second.
    work : (5, 3)
        Room to work in.
    """
    c, u, v = work[:3], work[3], work[4]
    for i in range(3):
        u[i] = a[0, i] * t[0] + a[1, i] * t[1] + a[2, i] * t[2]
        v[i] = b[0, i] * t[0] + b[1, i] * t[1] + b[2, i] * t[2]
        for j in range(3):
            c[i, j] = a[0, i] * b[0, j] + a[1, i] * b[1, j] + a[2, i] * b[2, j]
    best = -math.inf
    for i in range(3):
        reach = abs(c[i, 0]) * h[0] + abs(c[i, 1]) * h[1] + abs(c[i, 2]) * h[2]
        best = max(best, abs(u[i]) - g[i] - reach)
        reach = abs(c[0, i]) * g[0] + abs(c[1, i]) * g[1] + abs(c[2, i]) * g[2]
        best = max(best, abs(v[i]) - h[i] - reach)
    if best >= limit:
        return best
    for i in range(3):
        k, m = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            square = 1.0 - c[i, j] * c[i, j]
            if square > _PARALLEL:
                p, r = (j + 1) % 3, (j + 2) % 3
                gap = abs(u[m] * c[k, j] - u[k] * c[m, j])
                gap -= g[k] * abs(c[m, j]) + g[m] * abs(c[k, j])
                gap -= h[p] * abs(c[i, r]) + h[r] * abs(c[i, p])
                best = max(best, gap / math.sqrt(square))
    return best


@kernel
def lower_bounds(
    q: Array,
    coordinates: Ints,
    parents: Ints,
    rotations: Array,
    positions: Array,
    axes: Array,
    is_revolute: Flags,
    scales: Array,
    joints: Ints,
    turns: Array,
    middles: Array,
    halves: Array,
    pairs: Ints,
    limit: float,
) -> Array:
    """Return `BoundingBoxes.lower_bounds`; the tree as in `placements`."""
    bounds = np.empty((len(q), len(pairs)))
    count = len(coordinates) + 1
    r, p = np.empty((count, 3, 3)), np.empty((count, 3))
    turned, place = np.empty((len(joints), 3, 3)), np.empty((len(joints), 3))
    radii, t, work = np.empty(len(joints)), np.empty(3), np.empty((5, 3))
    for i in range(len(joints)):
        h = halves[i]
        radii[i] = math.sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2])
    for k in range(len(q)):
        placements(
            q[k], coordinates, parents, rotations, positions, axes, is_revolute, scales, r, p
        )
        for i in range(len(joints)):
            j = joints[i]
            compose(r[j], p[j], turns[i], middles[i], turned[i], place[i])
        for pair in range(len(pairs)):
            i, j = pairs[pair, 0], pairs[pair, 1]
            for a in range(3):
                t[a] = place[j, a] - place[i, a]
            gap = math.sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]) - radii[i] - radii[j]
            if gap < limit:
                gap = max(
                    gap, separation(turned[i], turned[j], t, halves[i], halves[j], limit, work)
                )
            bounds[k, pair] = gap
    return bounds


@inlined
def _from(corner: Array, point: Array) -> Vector:
    return (corner[0] - point[0], corner[1] - point[1], corner[2] - point[2])


@inlined
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def winding_number(corners: Array, point: Array) -> float:
    """Return the winding number of the triangles (T, 3, 3) around the point: 1 inside, 0 outside.

    The sum of their solid angles over 4π, after Van Oosterom and Strackee (1983).
    """
    total = 0.0
    for k in range(len(corners)):
        a, b, c = (
            _from(corners[k, 0], point),
            _from(corners[k, 1], point),
            _from(corners[k, 2], point),
        )
        la, lb, lc = math.sqrt(_dot(a, a)), math.sqrt(_dot(b, b)), math.sqrt(_dot(c, c))
        volume = (
            a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
        )
        edges = la * lb * lc + _dot(a, b) * lc + _dot(b, c) * la + _dot(c, a) * lb
        total += math.atan2(volume, edges)
    return total / (2.0 * math.pi)

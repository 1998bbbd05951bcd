"""Bounding boxes of all bodies at all samples: how far apart pairs are at least."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.arrays import Array
from selfmotion.collision.solids import Solid
from selfmotion.jit import kernel
from selfmotion.robot import RobotModel

Ints = npt.NDArray[np.int64]
# Edges whose cosine differs from one by less are parallel: the faces decide about them.
_PARALLEL = 1e-6


class BoundingBoxes:
    """A box around the convex hull of each body, along the axes of the body's own frame.

    Parameters
    ----------
    robot : RobotModel
    bodies : sequence of (int, pinocchio.SE3, Solid)
        The joint that carries it, its placement there, and the body.
    """

    def __init__(self, robot: RobotModel, bodies: Sequence[tuple[int, pin.SE3, Solid]]) -> None:
        self._model, self._data = robot.model, robot.model.createData()
        # Views into the data, which Pinocchio updates: reading placements costs no call.
        moving = list(self._data.oMi)[1:]
        self._rotation_views = [place.rotation for place in moving]
        self._position_views = [place.translation for place in moving]
        self._joints = np.array([joint for joint, _, _ in bodies], dtype=np.int64)
        self._axes = np.array([place.rotation for _, place, _ in bodies]).reshape(-1, 3, 3)
        middles = [place.act(0.5 * (solid.low + solid.high)) for _, place, solid in bodies]
        self._middles = np.array(middles).reshape(-1, 3)
        halves = [0.5 * (solid.high - solid.low) for _, _, solid in bodies]
        self._halves = np.array(halves).reshape(-1, 3)

    @property
    def radii(self) -> Array:
        """Half the diagonals of the boxes, (B,) [m]."""
        return np.asarray(np.linalg.norm(self._halves, axis=1))

    def lower_bounds(self, q: Array, pairs: Ints, limit: float = math.inf) -> Array:
        """Return what each pair's signed distance is at least, (K, P) [m].

        Parameters
        ----------
        q : (K, n)
        pairs : (P, 2)
            Indices of bodies.
        limit : float
            Where the spheres around the boxes are this far apart, their distance is enough [m].
        """
        rotations, positions = self._placements(q)
        return lower_bounds(
            rotations, positions, self._joints, self._axes, self._middles, self._halves, pairs,
            limit,
        )  # fmt: skip

    def _placements(self, q: Array) -> tuple[Array, Array]:
        count, n = q.shape
        # Row 0 of each is the world.
        rotations, positions = np.zeros((count, 3 * (n + 1), 3)), np.zeros((count, 3 * (n + 1)))
        rotations[:, :3] = np.eye(3)
        for k in range(count):
            pin.forwardKinematics(self._model, self._data, q[k])
            np.concatenate(self._rotation_views, out=rotations[k, 3:])
            np.concatenate(self._position_views, out=positions[k, 3:])
        shape = (count, n + 1, 3)
        return rotations.reshape(*shape, 3), positions.reshape(shape)


@kernel
def separation(a: Array, b: Array, t: Array, g: Array, h: Array) -> float:
    """Return the signed distance of two boxes along the best of 15 axes.

    These are the normals of all faces, and what is normal to an edge of each (S. Gottschalk, M.
    Lin, D. Manocha, "OBBTree", SIGGRAPH 1996). Of boxes that overlap it is minus the depth, of
    others at most the distance.

    Parameters
    ----------
    a, b : (3, 3)
        Columns: axes of the boxes.
    t : (3,)
        From the middle of the first to that of the second.
    g, h : (3,)
        Half lengths of the first and of the second.
    """
    c, u, v = np.empty((3, 3)), np.empty(3), np.empty(3)
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
    rotations: Array,
    positions: Array,
    joints: Ints,
    axes: Array,
    middles: Array,
    halves: Array,
    pairs: Ints,
    limit: float,
) -> Array:
    """Return `BoundingBoxes.lower_bounds`, for placements (K, J, 3, 3) and (K, J, 3) of joints."""
    bounds = np.empty((len(rotations), len(pairs)))
    turned, place = np.empty((len(joints), 3, 3)), np.empty((len(joints), 3))
    radii, t = np.sqrt((halves * halves).sum(axis=1)), np.empty(3)
    for k in range(len(rotations)):
        for i in range(len(joints)):
            rotation, position = rotations[k, joints[i]], positions[k, joints[i]]
            for a in range(3):
                x, y, z = rotation[a, 0], rotation[a, 1], rotation[a, 2]
                place[i, a] = position[a] + (
                    x * middles[i, 0] + y * middles[i, 1] + z * middles[i, 2]
                )
                for b in range(3):
                    turned[i, a, b] = x * axes[i, 0, b] + y * axes[i, 1, b] + z * axes[i, 2, b]
        for pair in range(len(pairs)):
            i, j = pairs[pair, 0], pairs[pair, 1]
            for a in range(3):
                t[a] = place[j, a] - place[i, a]
            gap = math.sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]) - radii[i] - radii[j]
            if gap < limit:
                gap = max(gap, separation(turned[i], turned[j], t, halves[i], halves[j]))
            bounds[k, pair] = gap
    return bounds

"""Bounding boxes of all bodies at all samples: how far apart pairs are at least."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array
from selfmotion.collision.bodies import Body
from selfmotion.robot import RobotModel

Ints = npt.NDArray[np.int64]


class BoundingBoxes:
    """A box around the convex hull of each body, along the axes of the body's own frame.

    Parameters
    ----------
    robot : RobotModel
    bodies : sequence of Body
    """

    def __init__(self, robot: RobotModel, bodies: Sequence[Body]) -> None:
        self._tree = robot.tree
        joints = np.array([body.joint for body in bodies], dtype=np.int64)
        turns = np.array([body.place.rotation for body in bodies]).reshape(-1, 3, 3)
        middles = [body.place.act(0.5 * (body.solid.low + body.solid.high)) for body in bodies]
        halves = [0.5 * (body.solid.high - body.solid.low) for body in bodies]
        self._halves = np.array(halves).reshape(-1, 3)
        self._boxes = (joints, turns, np.array(middles).reshape(-1, 3), self._halves)

    def move(self, index: int, body: Body) -> None:
        """Take the place of a body anew."""
        _, turns, middles, _ = self._boxes
        turns[index] = body.place.rotation
        middles[index] = body.place.act(0.5 * (body.solid.low + body.solid.high))

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
            Where the spheres around the boxes, or faces of these, are this far apart, that is
            enough [m].
        """
        # Here, because importing numba takes longer than everything else in the package.
        from selfmotion.collision import kernels

        return kernels.lower_bounds(q, *self._tree, *self._boxes, pairs, limit)

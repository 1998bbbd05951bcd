"""Bounding boxes of all bodies at all samples: how far apart pairs are at least."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.arrays import Array
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
        self._model, self._data = robot.model, robot.model.createData()
        # Views into the data, which Pinocchio updates: reading placements costs no call.
        moving = list(self._data.oMi)[1:]
        self._rotation_views = [place.rotation for place in moving]
        self._position_views = [place.translation for place in moving]
        self._joints = np.array([body.joint for body in bodies], dtype=np.int64)
        self._axes = np.array([body.place.rotation for body in bodies]).reshape(-1, 3, 3)
        middles = [body.place.act(0.5 * (body.solid.low + body.solid.high)) for body in bodies]
        self._middles = np.array(middles).reshape(-1, 3)
        halves = [0.5 * (body.solid.high - body.solid.low) for body in bodies]
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
        # Here, because importing numba takes longer than everything else in the package.
        from selfmotion.collision import kernels

        rotations, positions = self._placements(q)
        return kernels.lower_bounds(
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

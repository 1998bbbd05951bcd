"""A smooth turning through given orientations, and its rate."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    Array,
)
from selfmotion.model.task import exponentials, products


class Turning:
    """scipy's `RotationSpline` (C²): from each orientation on by a cubic rotation vector.

    Orientation and rate come from one rotation vector, of which scipy's would make two.

    Parameters
    ----------
    t : (N,)
        Times [s].
    quaternions : (N, 4)
        [w, x, y, z].

    Attributes
    ----------
    x : (N,)
        The times.
    c : (4, N - 1, 3)
        Coefficients of the rotation vectors, the highest first.
    """

    def __init__(self, t: Array, quaternions: Array) -> None:
        from scipy.spatial.transform import Rotation, RotationSpline

        spline = RotationSpline(t, Rotation.from_quat(quaternions, scalar_first=True))
        self.x: Array = spline.interpolator.x
        self.c: Array = spline.interpolator.c
        self._first: Array = spline.rotations.as_matrix()

    def at(self, t: Array) -> tuple[Array, Array]:
        """Return orientations (K, 3, 3) and angular velocities (K, 3) at times, world axes."""
        k: npt.NDArray[np.intp] = np.searchsorted(self.x[1:-1], t, side="right")
        s = (t - self.x[k])[:, None]
        cubic, square, slope, none = self.c.take(k, axis=1)
        vectors = ((cubic * s + square) * s + slope) * s + none
        rates = (3.0 * cubic * s + 2.0 * square) * s + slope
        first = self._first[k]
        rotations, angular = exponentials(vectors, rates)
        return first @ rotations, products(first, angular)

"""Splines through given positions, and through given orientations, with their rates."""

from __future__ import annotations

import numpy as np

from selfmotion.basics import Array, plain
from selfmotion.model.path.spline_kernels import cubics_at, turns_at


class Cubics:
    """scipy's `CubicSpline` (C², not-a-knot) through positions.

    Parameters
    ----------
    t : (N,)
        Times [s].
    points : (N, 3)
        [m].

    Attributes
    ----------
    x : (N,)
        The times.
    c : (4, N - 1, 3)
        Coefficients, the highest first.
    """

    def __init__(self, t: Array, points: Array) -> None:
        from scipy.interpolate import CubicSpline

        spline = CubicSpline(t, points)
        self.x, self.c = plain(spline.x), plain(spline.c)

    def at(self, t: Array) -> tuple[Array, Array]:
        """Return positions and velocities at times, (K, 3) each."""
        values, rates = np.empty((len(t), 3)), np.empty((len(t), 3))
        cubics_at(self.x, self.c, plain(t), values, rates)
        return values, rates


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
        self.x, self.c = plain(spline.interpolator.x), plain(spline.interpolator.c)
        self._first = plain(spline.rotations.as_matrix())

    def at(self, t: Array) -> tuple[Array, Array]:
        """Return orientations (K, 3, 3) and angular velocities (K, 3) at times, world axes."""
        rotations, angular = np.empty((len(t), 3, 3)), np.empty((len(t), 3))
        turns_at(self.x, self.c, self._first, plain(t), rotations, angular)
        return rotations, angular

"""The basis that null motions are given in, carried along a motion."""

import numpy as np

from selfmotion.basics import Array
from selfmotion.kernels import carried
from selfmotion.robot import null_space


class TransportedFrame:
    """A null-space basis carried along a motion without turning inside the null space.

    At the nodes as `carried` has it; between them the entries follow a cubic spline.

    Parameters
    ----------
    t : (N,)
        Times of the nodes [s].
    jacobians : (N, m, n)
        Task Jacobians there.
    """

    def __init__(self, t: Array, jacobians: Array) -> None:
        from scipy.interpolate import CubicSpline

        self._spline = CubicSpline(t, carried(null_space(jacobians[0]), jacobians))

    def __call__(self, t: Array) -> Array:
        """Return the basis at times `t` (S,), (S, n, r)."""
        return np.asarray(self._spline(t))

"""The basis that null motions are given in, carried along a motion."""

import numpy as np

from selfmotion import kernels
from selfmotion.basics import Array
from selfmotion.follow import Follows
from selfmotion.robot import null_space

# Jacobians with a pivot of JJᵀ [m², rad²] below this are taken for singular.
_SINGULAR = 1e-12


class TransportedFrame:
    """A null-space basis carried along a motion without turning inside the null space.

    At each node the basis is the orthonormal one nearest to its predecessor (the polar factor of
    its projection), a discrete parallel transport: continuous whatever the signs and order of the
    singular vectors do. Between nodes the entries follow a cubic spline.

    Parameters
    ----------
    t : (N,)
        Times of the nodes [s].
    jacobians : (N, m, n)
        Task Jacobians there.
    """

    def __init__(self, t: Array, jacobians: Array) -> None:
        from scipy.interpolate import CubicSpline

        self._spline = CubicSpline(t, transport(jacobians))

    def __call__(self, t: Array) -> Array:
        """Return the basis at times `t` (S,), (S, n, r)."""
        return np.asarray(self._spline(t))


def transport(jacobians: Array) -> Array:
    """Return orthonormal null-space bases of `jacobians` (N, m, n) along a motion, (N, n, r)."""
    first = null_space(jacobians[0])
    bases = np.empty((len(jacobians), *first.shape))
    kernels.transport(first, np.ascontiguousarray(jacobians), _SINGULAR, bases)
    return bases


def carried_bases(follows: Follows, q: Array) -> Array:
    """Return null-space bases along a motion (N, n), (N, n, r), each turned to the last one."""
    return transport(follows.jacobians(q))

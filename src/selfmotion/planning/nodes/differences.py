"""Finite differences on nodes at any times, exact for polynomials of the fourth degree."""

import numpy as np

from selfmotion.basics import Array

# Nodes in a stencil.
_STENCIL = 5


class Differences:
    """First two time derivatives at nodes, of the polynomials through the five nearest ones.

    Parameters
    ----------
    t : (N + 1,)
        Times of the nodes [s].
    """

    def __init__(self, t: Array) -> None:
        count, width = len(t), min(_STENCIL, len(t))
        first = np.clip(np.arange(count) - width // 2, 0, count - width)
        # Nodes of each node's stencil, (N + 1, S).
        self._stencils = first[:, None] + np.arange(width)
        away = t[self._stencils] - t[:, None]
        unit = np.abs(away).max(axis=1)[:, None, None]
        powers = (away[:, None, :] / unit) ** np.arange(width)[None, :, None]
        derivatives = np.broadcast_to(np.eye(width, 3)[:, 1:], (count, width, 2))
        weights = np.linalg.solve(powers, derivatives)
        weights *= np.array([1.0, 2.0]) / unit ** np.array([1.0, 2.0])
        # Of the first and the second derivative, (2, N + 1, S).
        self._weights = np.moveaxis(weights, 2, 0)

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """Return ẋ and ẍ at the nodes for values x (N + 1, n) there, (N + 1, n) each."""
        first, second = (self._weights[:, :, None, :] @ x[self._stencils])[:, :, 0]
        return first, second

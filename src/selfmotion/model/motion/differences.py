"""Finite differences on nodes at any times, exact for polynomials of the fourth degree."""

import numpy as np

from selfmotion.basics import Array, Ints, kernel, plain

# Nodes in a stencil.
_STENCIL = 5


class Differences:
    """Time derivatives of the polynomials through the five nodes nearest to each time.

    Parameters
    ----------
    nodes : (N + 1,)
        Times of the nodes [s].
    times : (S,), optional
        Times of the derivatives [s]; by default those of the nodes.

    Attributes
    ----------
    first : (S,)
        The first node of each time's stencil.
    weights : (3, S, K)
        Of the value, the first and the second derivative, by the nodes of the stencil.
    """

    def __init__(self, nodes: Array, times: Array | None = None) -> None:
        times = nodes if times is None else times
        width = min(_STENCIL, len(nodes))
        nearest = np.searchsorted(nodes, times) - width // 2
        self.first: Ints = np.clip(nearest, 0, len(nodes) - width)
        self.weights = np.zeros((3, len(times), width))
        _set_weights(plain(nodes), plain(times), self.first, self.weights)

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """Return ẋ and ẍ at the times for values x (N + 1, n) at the nodes, (S, n) each."""
        found = np.zeros((2, len(self.first), x.shape[1]))
        _add_differences(self.weights, self.first, plain(x), found)
        first, second = found
        return first, second


@kernel
def _set_weights(nodes: Array, times: Array, first: Ints, weights: Array) -> None:
    """Set the weights (3, S, K) of derivatives at times (S,); of the orders below K.

    B. Fornberg, Generation of finite difference formulas on arbitrarily spaced grids, Math. Comp.
    51, 1988.
    """
    orders, count, width = weights.shape
    for s in range(count):
        grid = nodes[first[s] :]
        own = weights[:, s]
        own[0, 0] = 1.0
        product, away = 1.0, grid[0] - times[s]
        for i in range(1, width):
            highest = min(i, orders - 1)
            before, last, away = away, product, grid[i] - times[s]
            product = 1.0
            for j in range(i):
                apart = grid[i] - grid[j]
                product *= apart
                if j == i - 1:
                    for k in range(highest, 0, -1):
                        own[k, i] = last * (k * own[k - 1, j] - before * own[k, j]) / product
                    own[0, i] = -last * before * own[0, j] / product
                for k in range(highest, 0, -1):
                    own[k, j] = (away * own[k, j] - k * own[k - 1, j]) / apart
                own[0, j] = away * own[0, j] / apart


@kernel
def _add_differences(weights: Array, first: Ints, x: Array, out: Array) -> None:
    """Add the first and second derivatives of values x (N + 1, n) to `out` (2, S, n)."""
    _, count, width = weights.shape
    for s in range(count):
        for k in range(width):
            for j in range(x.shape[1]):
                value = x[first[s] + k, j]
                out[0, s, j] += weights[1, s, k] * value
                out[1, s, j] += weights[2, s, k] * value

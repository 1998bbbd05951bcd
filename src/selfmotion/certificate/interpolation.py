"""Polynomials through measured points: what lies between, and how far it can be trusted."""

from functools import cache

import numpy as np

from selfmotion.basics import Array

# Between the points the polynomials are looked at this many times.
_DENSE = 33
# Between two of these a curve leaves its chord by an eighth of its second difference, and by a
# quarter of that more for how this changes.
SAG = 0.125 * 1.25


@cache
def stencil(count: int) -> tuple[Array, Array, Array, Array]:
    """Return the points of [0, 1]; from every other to the rest; points between; from all to them.

    Lagrange interpolation, as matrices.
    """
    shares = np.linspace(0.0, 1.0, count)
    between = np.linspace(0.0, 1.0, _DENSE)
    return (
        shares,
        _lagrange(shares[::2], shares[1::2]),
        between,
        _lagrange(shares, between),
    )


def _lagrange(nodes: Array, points: Array) -> Array:
    """Return the matrix (P, N) from values at nodes (N,) to the polynomial's at points (P,)."""
    matrix = np.ones((len(points), len(nodes)))
    for j, node in enumerate(nodes):
        for other in np.delete(nodes, j):
            matrix[:, j] *= (points - other) / (node - other)
    return matrix

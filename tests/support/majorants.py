"""Whether majorant series are above the derivatives of what they belong to."""

import math

import numpy as np

from selfmotion.certificate import Stretch
from selfmotion.certificate.bounding import Bounded

# Nodes by which derivatives are found, of which orders, and where.
_NODES, _ORDERS = 13, 4
_PLACES = np.linspace(-1.0, 1.0, 41)


def check_majorants(function: Bounded, stretch: Stretch) -> None:
    """Require of all orders k from 1 that sup |∂ᵏf/∂uᵏ| / k! is at most the k-th of the series."""
    known = function.series(stretch)
    assert known is not None
    u = np.polynomial.chebyshev.chebpts1(_NODES)
    into = np.linalg.inv(np.polynomial.chebyshev.chebvander(u, _NODES - 1))
    taken = np.einsum("kp,ipc->kic", into, function.values(stretch, u))
    for order in range(1, _ORDERS + 1):
        # Derivatives of the polynomial through the nodes: a limit of what rounding leaves.
        slopes = np.polynomial.chebyshev.chebder(taken, order, axis=0)
        found = np.polynomial.chebyshev.chebval(_PLACES, slopes) / math.factorial(order)
        sizes = np.sqrt(np.add.reduceat(found**2, function.blocks, axis=1)).max(axis=2)
        limit = known[:, order].T
        assert np.all(sizes <= limit * (1.0 + 1e-6) + 1e-8 * (1.0 + sizes.max())), order

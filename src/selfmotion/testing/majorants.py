"""Whether majorant series are above the derivatives of what they belong to."""

import math

import numpy as np

from selfmotion.certificate import Bounded, Stretch

# Nodes by which derivatives are found, of which orders, and where.
_NODES, _ORDERS = 13, 4
_PLACES = np.linspace(-1.0, 1.0, 41)
# What rounding leaves of derivatives: as a share of the series, and of the largest found.
_ROUNDING, _SMALL = 1e-6, 1e-8


def check_majorants(function: Bounded, stretch: Stretch, name: str = "a function") -> None:
    """Require of orders k from 1 to 4 that sup |∂ᵏf/∂uᵏ| / k! is at most the k-th of the series.

    Parameters
    ----------
    function : Bounded
        Of which series are known on this stretch.
    stretch : Stretch
    name : str
        What to call it in messages.

    Raises
    ------
    AssertionError
        A derivative is larger: what a verdict says of its function is no proof.
    """
    known = function.series(stretch)
    if known is None:
        raise AssertionError(f"{name}: no series on this motion")
    u = np.polynomial.chebyshev.chebpts1(_NODES)
    into = np.linalg.inv(np.polynomial.chebyshev.chebvander(u, _NODES - 1))
    taken = np.einsum("kp,ipc->kic", into, function.values(stretch, u))
    for order in range(1, _ORDERS + 1):
        # Derivatives of the polynomial through the nodes: a limit of what rounding leaves.
        slopes = np.polynomial.chebyshev.chebder(taken, order, axis=0)
        found = np.polynomial.chebyshev.chebval(_PLACES, slopes) / math.factorial(order)
        sizes = np.sqrt(np.add.reduceat(found**2, function.blocks, axis=1)).max(axis=2)
        allowed = known[:, order].T * (1.0 + _ROUNDING) + _SMALL * (1.0 + sizes.max())
        # Written so that NaN fails.
        if not np.all(sizes <= allowed):
            interval, block = np.unravel_index(np.argmax(sizes - allowed), sizes.shape)
            first, last = stretch.intervals[interval]
            raise AssertionError(
                f"{name}: series() is no majorant: the derivative of order {order} of number "
                f"{block}, over {order}!, reaches {sizes[interval, block]:.4g} from t = "
                f"{first:.6g} to {last:.6g} s, but the series says "
                f"{known[block, order, interval]:.4g} at most"
            )

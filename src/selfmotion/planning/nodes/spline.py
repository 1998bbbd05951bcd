"""A motion between nodes: quintic segments through (q, q̇, q̈), and their evaluation points.

On an interval of length h the segment is a polynomial of s = (t - t_k)/h, linear in its ends

    y = (q, h q̇, h² q̈) of the left node, then of the right one:  (d/dt)^o q = h^-o U_o(s) y,

with the same tables U_o for all intervals. Its control points (of the Bernstein form, G. Farin,
"Curves and Surfaces for CAGD", ch. 5) are linear in y as well, and the curve stays within their
convex hull: bounds on all control points of a derivative are bounds on the whole curve.
"""

from functools import cache, cached_property
from math import comb, perm

import numpy as np

from selfmotion.basics import Array, Ints
from selfmotion.model.motion import Differences, Sampling
from selfmotion.planning.nodes.node_matrix import EndChanges

# Orders of derivatives: q, q̇, q̈ and the jerk.
ORDERS = 4
# Number of control points of each.
CONTROLS = (6, 5, 4, 3)
# Gauss points on an interval: the square of a quintic's derivative is integrated exactly.
_ROOTS, _WEIGHTS = np.polynomial.legendre.leggauss(5)
# As shares of the interval.
GAUSS = 0.5 * (1.0 + _ROOTS)
# Weights of the quadrature, for an interval of length 1.
WEIGHTS = 0.5 * _WEIGHTS
# Shares of an interval at which constraints other than limits of joints apply, besides the last
# node.
POINTS = np.array([0.0, 0.5])
# The same where a constraint is on accelerations: q̈ is a cubic, which may oscillate between two
# points.
FINE_POINTS = np.array([0.0, 0.25, 0.5, 0.75])


def _powers(s: Array, order: int) -> Array:
    """Return the derivatives of an order of 1, s, … s⁵ at s (S,), (S, 6)."""
    each = [perm(p, order) * s ** max(p - order, 0) for p in range(6)]
    return np.stack([x * np.ones_like(s) for x in each], axis=1)


# Coefficients of 1, s, … s⁵ by (q, q̇, q̈) of both ends.
_ENDS = np.linalg.inv(
    np.concatenate([_powers(np.array([s]), order) for s in (0.0, 1.0) for order in range(3)])
)


def unit_bases(s: Array) -> tuple[Array, ...]:
    """Return U_o(s) of q, q̇, q̈ and the jerk at shares s (S,) of an interval, (S, 6) each."""
    return tuple(_powers(s, order) @ _ENDS for order in range(ORDERS))


@cache
def _bases_at(shares: tuple[float, ...]) -> tuple[Array, ...]:
    return unit_bases(np.array(shares))


def _controls() -> tuple[Array, ...]:
    """Return the matrices of the control points of q, q̇, q̈ and jerk by y, (6 - o, 6) each."""
    controls = []
    for order, count in enumerate(CONTROLS):
        s, degree = np.linspace(0.0, 1.0, count), count - 1
        terms = [comb(degree, i) * s**i * (1.0 - s) ** (degree - i) for i in range(count)]
        matrix = np.linalg.solve(np.stack(terms, axis=1), unit_bases(s)[order])
        controls.append(np.asarray(matrix, dtype=np.float64))
    return tuple(controls)


AT_GAUSS = unit_bases(GAUSS)
AT_CONTROLS = _controls()
AT_END = unit_bases(np.ones(1))
# How (q, q̇, q̈) of both ends scale with h to become y.
_SCALED = np.array([0, 1, 2, 0, 1, 2])


class Quintic:
    """Quintic segments on given times.

    Of several motions on the same nodes, one after the other, the interval from the end of one to
    the start of the next is a gap: it has no weight, and nothing moves there.

    Parameters
    ----------
    t : (N + 1,)
        Times of the nodes [s].
    copies : int
        Number of motions; below, N + 1 is the number of nodes of all.
    shares : (P,)
        Shares of an interval at which constraints apply; 0 is the first.

    Attributes
    ----------
    t : (N + 1,)
    steps : (N,)
        Lengths of the intervals [s].
    gaps : (K,)
        Which intervals are gaps.
    sampling : Sampling
        Samples of costs: the Gauss points of each interval.
    rates : (7, N)
        h^-o by order o.
    """

    def __init__(self, t: Array, copies: int = 1, shares: Array = POINTS) -> None:
        self._shares = shares
        self.t = np.tile(t, copies)
        self.steps = np.diff(self.t)
        self.gaps = np.arange(1, copies) * len(t) - 1
        self.steps[self.gaps] = 1.0
        h = self.steps.copy()
        h[self.gaps] = 0.0
        times = (self.t[:-1, None] + h[:, None] * GAUSS).ravel()
        each = (h[:, None] * WEIGHTS).ravel()
        self.sampling = Sampling(times, each, np.arange(len(times)))
        self._powers = self.steps[:, None] ** _SCALED
        # Quadratic forms take them of twice an order.
        self.rates = self.steps ** -np.arange(2.0 * ORDERS - 1.0)[:, None]

    @property
    def count(self) -> int:
        """Number of intervals N."""
        return len(self.steps)

    @cached_property
    def points(self) -> Sampling:
        """Samples of constraints other than limits of joints."""
        inner = (self.t[:-1, None] + self.steps[:, None] * self._shares).ravel()
        return Sampling.trapezoidal(np.append(inner, self.t[-1]))

    @cached_property
    def differences(self) -> Differences:
        """Time derivatives of values at the nodes; for one motion only."""
        return Differences(self.t)

    def ends(self, nodes: Array) -> Array:
        """Return y of each interval, (N, 6, n), for (q, q̇, q̈) of the nodes, (N + 1, 3, n)."""
        y = np.concatenate([nodes[:-1], nodes[1:]], axis=1) * self._powers[:, :, None]
        if self.gaps.size:
            y[self.gaps, 3] = y[self.gaps, 0]
            y[np.ix_(self.gaps, np.array([1, 2, 4, 5]))] = 0.0
        return np.asarray(y)

    def scatter(self, by_ends: Array) -> Array:
        """Return derivatives by (q, q̇, q̈) of the nodes, for those by y (N, 6, n), (N + 1, 3, n).

        The adjoint of `ends`.
        """
        scaled = by_ends * self._powers[:, :, None]
        if self.gaps.size:
            scaled[self.gaps] = 0.0
        by_nodes = np.zeros((self.count + 1, 3, scaled.shape[2]))
        by_nodes[:-1] += scaled[:, :3]
        by_nodes[1:] += scaled[:, 3:]
        return by_nodes

    def changes(self, nodes: Array) -> EndChanges:
        """Return ∂y/∂w of all intervals; `nodes` (N + 1, 3, n, d) is ∂(q, q̇, q̈)/∂w of the nodes."""
        return EndChanges(nodes, self._powers_moving)

    @cached_property
    def _powers_moving(self) -> Array:
        powers = np.array(self._powers)
        powers[self.gaps] = 0.0
        return powers

    def at(self, tables: tuple[Array, ...], order: int, ends: Array) -> Array:
        """Return a derivative at shares of all intervals, (N, S, n), for their U_o and y."""
        return np.asarray((tables[order] @ ends) * self.rates[order][:, None, None])

    @cached_property
    def _at_points(self) -> tuple[Array, ...]:
        return _bases_at(tuple(self._shares.tolist()))

    def at_points(self, order: int, ends: Array) -> Array:
        """Return a derivative at the `points`, (P N + 1, n)."""
        inner = self.at(self._at_points, order, ends).reshape(-1, ends.shape[2])
        last = AT_END[order] @ ends[-1] * self.rates[order][-1]
        return np.concatenate([inner, last])


def control_times(spline: Quintic, order: int) -> Array:
    """Return the times of the control points [s], (N, 6 - o)."""
    shares = np.linspace(0.0, 1.0, CONTROLS[order])
    return np.asarray(spline.t[:-1, None] + spline.steps[:, None] * shares)


def point_matrices(spline: Quintic, which: Ints) -> tuple[Ints, Array]:
    """Return the intervals of some points, and the matrices from y to q … jerk there.

    Points are given by their indices (R,); the result is (R,) and (R, 4, 6).
    """
    count = len(spline._shares)
    last = which == count * spline.count
    k = np.where(last, spline.count - 1, which // count)
    tables = np.stack([*spline._at_points], axis=1)[which % count]
    tables[last] = np.stack([table[0] for table in AT_END])
    powers = spline.steps[k][:, None] ** -np.arange(float(ORDERS))
    return k, tables * powers[:, :, None]

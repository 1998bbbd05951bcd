"""A motion between nodes: the cubic Hermite spline of q and q̇, and where it is looked at."""

from functools import cached_property

import numpy as np

from selfmotion.basics import Array
from selfmotion.motion import Sampling

# Gauss points on each interval: ∫ of the square of a quadratic is exact, and no motion of the nodes
# is without cost at all of them.
_ROOT = 0.5 * np.sqrt(0.6)
_WEIGHTS = np.array([0.0, 5.0, 8.0, 5.0]) / 18.0
# Where an interval's samples are: its first node, then these.
SHARES = np.array([0.0, 0.5 - _ROOT, 0.5, 0.5 + _ROOT])
_SAMPLES = len(SHARES)
# q̈ and the jerk of the right, then the left end of an interval of length 1, by q, q̇ of both ends.
_ENDS = {
    2: np.array([[6.0, 2.0, -6.0, 4.0], [-6.0, -4.0, 6.0, -2.0]]),
    3: np.array([[12.0, 6.0, -12.0, 6.0], [12.0, 6.0, -12.0, 6.0]]),
}
# Which of an interval's samples is in its middle.
_MIDDLE = 2


def _unit(s: Array) -> tuple[Array, ...]:
    """Return what `Hermite.bases` are on an interval of length 1, at shares s (S,), (S, 4) each."""
    one = np.ones_like(s)
    tables = (
        (1 - s**2 * (3 - 2 * s), s * (1 - s) ** 2, s**2 * (3 - 2 * s), s**2 * (s - 1)),
        (6 * s * (s - 1), (1 - s) * (1 - 3 * s), 6 * s * (1 - s), s * (3 * s - 2)),
        (12 * s - 6, 6 * s - 4, 6 - 12 * s, 6 * s - 2),
        (12 * one, 6 * one, -12 * one, 6 * one),
    )
    return tuple(np.stack(table, axis=1) for table in tables)


_UNIT = _unit(SHARES)


class Hermite:
    """The cubic Hermite spline on given times, sampled at its nodes and at Gauss points between.

    Samples come four to an interval (its first node, three points), then the last node.

    Of several motions on the same nodes, one after the other, the interval from the end of one to
    the start of the next is a gap: it weighs nothing, and nothing moves there.

    Parameters
    ----------
    t : (N + 1,)
        Times of the nodes [s].
    copies : int
        How many motions there are; below, N + 1 nodes are those of all.

    Attributes
    ----------
    t : (N + 1,)
    steps : (N,)
        Lengths of the intervals [s].
    gaps : (K,)
        Which intervals are gaps.
    sampling : Sampling
        What costs look at.
    checked : Sampling
        What constraints look at: the nodes, and what is between each two.
    """

    def __init__(self, t: Array, copies: int = 1) -> None:
        self.t, self.steps = np.tile(t, copies), np.diff(np.tile(t, copies))
        self.gaps = np.arange(1, copies) * len(t) - 1
        h = self.steps[:, None].copy()
        h[self.gaps] = 0.0
        self.steps[self.gaps] = 1.0
        times, each = (self.t[:-1, None] + h * SHARES).ravel(), (h * _WEIGHTS).ravel()
        times = np.append(times, t[-1])
        self.sampling = Sampling(times, np.append(each, 0.0), np.arange(len(times)))
        self.checked = Sampling.trapezoidal(times[::_MIDDLE])

    @cached_property
    def bases(self) -> tuple[Array, ...]:
        """How q, q̇, q̈ and the jerk at an interval's samples follow from its ends, (N, 4, 4) each.

        From q, q̇ at the left and q, q̇ at the right end; at the node itself it is the derivative of
        the interval that begins there.
        """
        h, inverse = self.steps, 1.0 / self.steps
        square = inverse * inverse
        powers = np.stack([square * inverse, square, inverse, np.ones_like(h), h], axis=1)
        # By q it is 1/h to the order, by q̇ one less.
        each = (powers[:, [3 - order, 4 - order] * 2] for order in range(4))
        return tuple(power[:, None] * table for power, table in zip(each, _UNIT, strict=True))

    @cached_property
    def between(self) -> tuple[Array, ...]:
        """How q, q̇, q̈ and the jerk between two nodes follow from both ends, (N, 4) each.

        In the middle; but of q̇, a parabola, the control point of its Bernstein form: together with
        its ends it says how fast the motion is at most. And of q̈, a line, its right end: its left
        one is said at the node.
        """
        q, qd, _, qddd = (table[:, _MIDDLE] for table in self.bases)
        ends = np.array([0.0, 1.0, 0.0, 1.0])
        return q, 2.0 * qd - 0.5 * ends, self.at_ends(2)[0], qddd

    @cached_property
    def weights(self) -> Array:
        """Quadrature weights of an interval's samples [s], (N, 4)."""
        return self.sampling.weights[:-1].reshape(-1, _SAMPLES)

    @cached_property
    def shares(self) -> tuple[Array, Array]:
        """How q̈ and the jerk at a node follow from q and q̇ near it, (N + 1, 3, 2) each.

        At the node before, at itself and at the next one: as the interval says that begins there;
        at the last node of a motion that which ends.
        """
        found = []
        for order in (2, 3):
            right, left = (rows.reshape(-1, 2, 2) for rows in self.at_ends(order))
            shares = np.zeros((len(self.t), 3, 2))
            shares[:-1, 1:] = left
            shares[self.gaps] = 0.0
            ends = np.append(self.gaps, len(self.t) - 1)
            shares[ends, :2] = right[ends - 1]
            found.append(shares)
        return found[0], found[1]

    def at_ends(self, order: int) -> tuple[Array, Array]:
        """How q̈ (2) or the jerk (3) at an interval's right and left end follow from both."""
        h = self.steps
        powers = np.stack([1.0 / h**order, 1.0 / h ** (order - 1)] * 2, axis=1)
        right, left = _ENDS[order]
        return powers * right, powers * left

    def accelerations(self, ends: Array) -> tuple[Array, Array]:
        """Return q̈ at the nodes as the intervals before and after say it, (N + 1, n) each.

        For q and q̇ at both ends of each, (N, 4, n); where there is no interval, the other's.
        """
        right, left = (np.einsum("ka,kan->kn", rows, ends) for rows in self.at_ends(2))
        return np.concatenate([left[:1], right]), np.concatenate([left, right[-1:]])

    def at_nodes(self, order: int, q: Array, qd: Array) -> Array:
        """Return q̈ (2) or the jerk (3) at the nodes, (N + 1, …), see `shares`."""
        shares, both = self.shares[order - 2], np.stack([q, qd], axis=1)
        found = np.einsum("ka,ka...->k...", shares[:, 1], both)
        found[1:] += np.einsum("ka,ka...->k...", shares[1:, 0], both[:-1])
        found[:-1] += np.einsum("ka,ka...->k...", shares[:-1, 2], both[1:])
        return np.asarray(found)


def weighted(shares: Array, changes: Array) -> Array:
    """Return Σ_a shares (K, 2) · changes (K, 2, n, d), (K, n, d)."""
    return np.asarray(np.einsum("ka,kani->kni", shares, changes))

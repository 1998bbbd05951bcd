"""A motion between nodes: the cubic Hermite spline of q and q̇, and what costs see of it."""

from functools import cached_property

import numpy as np

from selfmotion.basics import Array, read_only
from selfmotion.costs import Samples, TipSamples
from selfmotion.follow import Follows
from selfmotion.motion import Sampling, Trajectory

# Gauss points on each interval: ∫ of the square of a quadratic is exact, and no motion of the nodes
# is without cost at all of them.
_ROOT = 0.5 * np.sqrt(0.6)
_POINTS, _WEIGHTS = np.array([0.5 - _ROOT, 0.5, 0.5 + _ROOT]), np.array([5.0, 8.0, 5.0]) / 18.0
_SAMPLES = 4
# Which of an interval's samples is in its middle.
MIDDLE = 2


class Hermite:
    """The cubic Hermite spline on given times, sampled at its nodes and at Gauss points between.

    Samples come four to an interval (its first node, three points), then the last node.

    Parameters
    ----------
    t : (N + 1,)
        Times of the nodes [s].

    Attributes
    ----------
    t : (N + 1,)
    steps : (N,)
        Lengths of the intervals [s].
    sampling : Sampling
        Constraints look at its nodes: those here, and the middle of each interval.
    """

    def __init__(self, t: Array) -> None:
        self.t, self.steps = t, np.diff(t)
        shares, weights = np.append(0.0, _POINTS), np.append(0.0, _WEIGHTS)
        h = self.steps[:, None]
        times, each = (t[:-1, None] + h * shares).ravel(), (h * weights).ravel()
        points = MIDDLE * np.arange(2 * len(t) - 1)
        self.sampling = Sampling(np.append(times, t[-1]), np.append(each, 0.0), points)

    @cached_property
    def bases(self) -> tuple[Array, ...]:
        """How q, q̇, q̈ and the jerk at an interval's samples follow from its ends, (N, 4, 4) each.

        From q, q̇ at the left and q, q̇ at the right end; at the node itself it is the derivative of
        the interval that begins there.
        """
        s, h = np.append(0.0, _POINTS), self.steps[:, None]
        one = np.ones_like(s)
        tables = (
            (1 - s**2 * (3 - 2 * s), s * (1 - s) ** 2, s**2 * (3 - 2 * s), s**2 * (s - 1)),
            (6 * s * (s - 1), (1 - s) * (1 - 3 * s), 6 * s * (1 - s), s * (3 * s - 2)),
            (12 * s - 6, 6 * s - 4, 6 - 12 * s, 6 * s - 2),
            (12 * one, 6 * one, -12 * one, 6 * one),
        )
        return tuple(
            np.stack(
                [
                    x / h ** (order - is_rate)
                    for x, is_rate in zip(table, (0, 1, 0, 1), strict=True)
                ],
                axis=2,
            )
            for order, table in enumerate(tables)
        )

    @cached_property
    def weights(self) -> Array:
        """Quadrature weights of an interval's samples [s], (N, 4)."""
        return self.sampling.weights[:-1].reshape(-1, _SAMPLES)

    @cached_property
    def shares(self) -> tuple[Array, Array]:
        """How q̈ and the jerk at a node follow from q and q̇ near it, (N + 1, 3, 2) each.

        At the node before, at itself and at the next one: the mean of what the intervals on both
        sides say; at the ends there is one.
        """
        h, count = self.steps, len(self.t)
        half = np.full((count, 1, 1), 0.5)
        half[[0, -1]] = 1.0
        found = []
        for order, right, left in (
            (2, (6.0, 2.0, -6.0, 4.0), (-6.0, -4.0, 6.0, -2.0)),
            (3, (12.0, 6.0, -12.0, 6.0), (12.0, 6.0, -12.0, 6.0)),
        ):
            powers = np.stack([1.0 / h**order, 1.0 / h ** (order - 1)] * 2, axis=1)
            shares = np.zeros((count, 3, 2))
            shares[1:, :2] += half[1:] * (powers * right).reshape(-1, 2, 2)
            shares[:-1, 1:] += half[:-1] * (powers * left).reshape(-1, 2, 2)
            found.append(shares)
        return found[0], found[1]

    def at_nodes(self, order: int, q: Array, qd: Array) -> Array:
        """Return q̈ (2) or the jerk (3) at the nodes, (N + 1, …), see `shares`."""
        shares, both = self.shares[order - 2], np.stack([q, qd], axis=1)
        found = np.einsum("ka,ka...->k...", shares[:, 1], both)
        found[1:] += np.einsum("ka,ka...->k...", shares[1:, 0], both[:-1])
        found[:-1] += np.einsum("ka,ka...->k...", shares[:-1, 2], both[1:])
        return np.asarray(found)


class PlacedLater(Samples):
    """A motion as costs and constraints see it; tips are placed when they are asked for.

    Parameters
    ----------
    follows : Follows
    sampling : Sampling
    q, qd : (S, n)
    """

    def __init__(self, follows: Follows, sampling: Sampling, q: Array, qd: Array) -> None:
        given = {"sampling": sampling, "follows": follows, "q": read_only(q), "qd": read_only(qd)}
        for name, value in given.items():
            object.__setattr__(self, name, value)

    @cached_property
    def _placed(self) -> Samples:
        return Samples.along(self.follows, self.sampling, self.q, self.qd)

    @cached_property
    def tips(self) -> tuple[TipSamples, ...]:
        """See `Samples`."""
        return self._placed.tips

    @cached_property
    def task_jacobian(self) -> Array:
        """See `Samples`."""
        return self._placed.task_jacobian


class HermiteSamples(PlacedLater):
    """A Hermite spline as costs and constraints see it.

    Parameters
    ----------
    follows : Follows
    spline : Hermite
    q, qd : (N + 1, n)
        At the nodes.

    Attributes
    ----------
    nodes_q, nodes_qd : (N + 1, n)
        Those.
    ends : (N, 4, n)
        q and q̇ at both ends of each interval.
    """

    nodes_q: Array
    nodes_qd: Array
    ends: Array
    _spline: Hermite

    def __init__(self, follows: Follows, spline: Hermite, q: Array, qd: Array) -> None:
        ends = np.stack([q[:-1], qd[:-1], q[1:], qd[1:]], axis=1)
        given = {"_spline": spline, "nodes_q": q, "nodes_qd": qd, "ends": ends}
        for name, value in given.items():
            object.__setattr__(self, name, value)
        at = (self._at_samples(0, q[-1]), self._at_samples(1, qd[-1]))
        super().__init__(follows, spline.sampling, *at)

    def _at_samples(self, order: int, last: Array) -> Array:
        spline = self._spline
        inner = (spline.bases[order] @ self.ends).reshape(-1, self.ends.shape[2])
        return np.concatenate([inner, last[None]])

    @cached_property
    def qdd(self) -> Array:
        """Joint accelerations, (S, n): of the spline, at the nodes means of both sides."""
        return self._faster(2)

    @cached_property
    def qddd(self) -> Array:
        """Joint jerks, (S, n): likewise."""
        return self._faster(3)

    def _faster(self, order: int) -> Array:
        spline = self._spline
        at_nodes = spline.at_nodes(order, self.nodes_q, self.nodes_qd)
        found = self._at_samples(order, at_nodes[-1])
        found[::_SAMPLES] = at_nodes
        return found


class QuinticSamples(PlacedLater):
    """A trajectory as costs see it.

    Parameters
    ----------
    follows : Follows
    sampling : Sampling
    trajectory : Trajectory
    """

    _trajectory: Trajectory

    def __init__(self, follows: Follows, sampling: Sampling, trajectory: Trajectory) -> None:
        super().__init__(follows, sampling, trajectory(sampling.t), trajectory(sampling.t, 1))
        object.__setattr__(self, "_trajectory", trajectory)

    @cached_property
    def qdd(self) -> Array:
        """Joint accelerations, (S, n)."""
        return np.asarray(self._trajectory(self.t, 2))

    @cached_property
    def qddd(self) -> Array:
        """Joint jerks, (S, n)."""
        return np.asarray(self._trajectory(self.t, 3))

"""The cost of a motion given by its nodes, with its gradient and its curvature.

Each interval's cost depends on its two nodes alone, so that the matrix of second derivatives is
block-tridiagonal. With q, q̇ of a node as functions of its coordinates w = (z, ν), Γ = ∂(q, q̇)/∂w
and λ = ∂F/∂(q, q̇),

    ∂F/∂w = Γᵀλ,   ∂²F/∂w∂w' = Γᵀ (∂²F/∂(q, q̇)∂(q, q̇)') Γ' + [w is w'] ∂(Γᵀλ)/∂w at fixed λ.

Costs are quadratic forms of q and its derivatives, so that the first term is exact. The last one,
the manifold's own curvature, is a central difference of exact derivatives along the manifold.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array
from selfmotion.costs import Cost, Samples
from selfmotion.follow import Follows
from selfmotion.nodes.charts import Charts, Place
from selfmotion.nodes.hermite import Hermite, HermiteSamples

# Differences along a manifold are taken this far to both sides [rad or m]: their error is about
# its square, and rounding's is 1e-12 over it.
_REACH = 1e-4
_NAMES = ("q", "qd", "qdd", "qddd")


@dataclass(frozen=True, eq=False)
class Smoothing:
    """What keeps a motion from starting and stopping at once: ½ ∫ b(t) q̈ᵀWq̈ dt.

    Attributes
    ----------
    shares : (N, 4)
        b at the samples [s²].
    weight : (n, n)
        W.
    """

    shares: Array
    weight: Array


class NodeCost:
    """F = ∫ Σ G dt along the Hermite spline of the nodes.

    Parameters
    ----------
    follows : Follows
    spline : Hermite
    costs : sequence of Cost
        Quadratic forms: see `Cost.curvature`.
    smoothing : Smoothing, optional
        Minimised besides, and no part of the costs.
    """

    def __init__(
        self,
        follows: Follows,
        spline: Hermite,
        costs: Sequence[Cost],
        smoothing: Smoothing | None = None,
    ) -> None:
        self._spline, self._costs = spline, tuple(costs)
        self._forms: list[tuple[Array, Array]] = []
        for cost in costs:
            for order, weight in cost.curvature(follows.robot.dof).items():
                self._forms.append((self._stiffness(order, spline.weights), weight))
        self._smoothing: tuple[Array, Array] | None = None
        if smoothing is not None:
            stiffness = self._stiffness(2, spline.weights * smoothing.shares)
            self._smoothing = stiffness, smoothing.weight
            self._forms.append(self._smoothing)

    def _stiffness(self, order: int, weights: Array) -> Array:
        """Return K of ½ Σ K_ab x_aᵀWx_b for the ends x of each interval, (N, 4, 4)."""
        shares = self._spline.bases[order]
        return np.asarray(np.swapaxes(shares, 1, 2) @ (weights[:, :, None] * shares))

    def terms(self, samples: Samples) -> dict[str, float]:
        """Return what each cost contributes to F."""
        return {cost.name: float(samples.weights @ cost.value(samples)) for cost in self._costs}

    def roughness(self, samples: HermiteSamples) -> float:
        """Return what the smoothing adds."""
        if self._smoothing is None:
            return 0.0
        stiffness, weight = self._smoothing
        ends = samples.ends
        return 0.5 * float(np.sum((stiffness @ ends) * (ends @ weight)))

    def slopes(self, samples: HermiteSamples) -> Array:
        """Return the derivatives of each interval's cost by q, q̇ at its ends, (N, 4, n)."""
        weights, bases = self._spline.weights, self._spline.bases
        count, n = len(weights), samples.q.shape[1]
        found = np.zeros((count, 4, n))
        for cost in self._costs:
            partials = cost.gradient(samples)
            for order, name in enumerate(_NAMES):
                part = getattr(partials, name)
                if part is not None:
                    shares = weights[:, :, None] * bases[order]
                    found += np.swapaxes(shares, 1, 2) @ part[:-1].reshape(count, 4, n)
        if self._smoothing is not None:
            stiffness, weight = self._smoothing
            found += stiffness @ (samples.ends @ weight)
        return found

    def curvature(self, changes: Array) -> Array:
        """Return Γᵀ (∂²F) Γ on each interval, by w of its left, then its right node, (N, 4r, 4r).

        `changes` (N + 1, 2, n, 2r) is Γ of the nodes.
        """
        count, _, n, size = changes.shape
        both = np.zeros((count - 1, 4, n, 2 * size))
        both[:, :2, :, :size], both[:, 2:, :, size:] = changes[:-1], changes[1:]
        flat = np.swapaxes(both.reshape(count - 1, 4 * n, 2 * size), 1, 2)
        found = np.zeros((count - 1, 2 * size, 2 * size))
        for stiffness, weight in self._forms:
            turned = stiffness @ (weight @ both).reshape(count - 1, 4, -1)
            found += flat @ turned.reshape(count - 1, 4 * n, 2 * size)
        return found


def scattered(slopes: Array) -> Array:
    """Return derivatives by q, q̇ of the nodes, (N + 1, 2, n), for those of intervals (N, 4, n)."""
    found = np.zeros((len(slopes) + 1, 2, slopes.shape[2]))
    found[:-1] += slopes[:, :2]
    found[1:] += slopes[:, 2:]
    return found


@dataclass(frozen=True, eq=False)
class Around:
    """How nodes move when their coordinates do, to second order.

    Attributes
    ----------
    charts : Charts
    changes : (N + 1, 2, n, 2r)
        Γ = ∂(q, q̇)/∂(z, ν).
    moved : sequence of (Place, Place)
        The nodes moved along each z, to both sides.
    """

    charts: Charts
    changes: Array
    moved: Sequence[tuple[Place, Place]]

    @classmethod
    def of(cls, charts: Charts, nu: Array) -> "Around | None":
        """Look around the reference of charts; None where a neighbour is not to be had."""
        count, n, r = charts.bases.shape
        changes, moved = np.zeros((count, 2, n, 2 * r)), []
        changes[:, 0, :, :r] = changes[:, 1, :, r:] = charts.bases
        for x in range(r):
            z = np.zeros((count, r))
            z[:, x] = _REACH
            above, below = charts.at(z, nu), charts.at(-z, nu)
            if above is None or below is None:
                return None
            changes[:, 1, :, x] = (above.qd - below.qd) / (2.0 * _REACH)
            moved.append((above, below))
        return cls(charts, changes, moved)

    def curvature(self, by_node: Array) -> Array:
        """Return ∂(Γᵀλ)/∂w at fixed λ = `by_node` (N + 1, 2, n), symmetric (N + 1, 2r, 2r)."""
        count, _, r = self.charts.bases.shape
        found = np.zeros((count, 2 * r, 2 * r))
        by_q, by_qd = np.ascontiguousarray(by_node[:, 0]), np.ascontiguousarray(by_node[:, 1])
        for x, (above, below) in enumerate(self.moved):
            sides = [self.charts.pulled(place, by_q, by_qd) for place in (above, below)]
            column = (sides[0] - sides[1]) / (2.0 * _REACH)
            found[:, :, x] = column
            found[:, x, r:] = column[:, r:]
        along = found[:, :r, :r]
        found[:, :r, :r] = 0.5 * (along + np.swapaxes(along, 1, 2))
        return found

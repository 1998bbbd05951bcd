"""The cost of a motion given by its nodes, with its gradient and its curvature.

Each interval's cost depends on its two nodes alone, so that the matrix of second derivatives is
block-tridiagonal. With q, q̇ of a node as functions of its coordinates w = (z, ν), Γ = ∂(q, q̇)/∂w
and λ = ∂F/∂(q, q̇),

    ∂F/∂w = Γᵀλ,   ∂²F/∂w∂w' = Γᵀ (∂²F/∂(q, q̇)∂(q, q̇)') Γ' + [w is w'] ∂(Γᵀλ)/∂w at fixed λ.

Where costs are quadratic forms of q and its derivatives, the first term is exact. Of others, second
derivatives are differences of gradients: by q along the self-motion, which is where nodes can go,
and by q̇. The last term, the manifold's own curvature, is a central difference of exact derivatives
along the manifold.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from selfmotion.basics import Array
from selfmotion.costs import Cost, Partials, PlacedLater, Samples
from selfmotion.follow import Follows
from selfmotion.nodes.charts import Charts, orthonormal
from selfmotion.nodes.hermite import HermiteSamples
from selfmotion.nodes.smoothness import Smoothing
from selfmotion.nodes.spline import SHARES, Hermite

# Differences along a manifold are taken this far to both sides [rad or m]: nodes are as near to it
# there as they have to be, and come onto it in one step. Rounding's error is 1e-16 over it.
_REACH = 1e-6
# Those of costs are taken to one side, so far [rad, m and their rates]: they are second derivatives
# of a matrix that need not be exact.
_NEAR = 1e-6
_NAMES = ("q", "qd", "qdd", "qddd")
# Intervals whose matrices are multiplied at once: what that takes is several times what it leaves.
_LOT = 4096


class NodeCost:
    """F = ∫ Σ G dt along the Hermite spline of the nodes.

    Parameters
    ----------
    follows : Follows
    spline : Hermite
    costs : sequence of Cost
        Of q and q̇, or quadratic forms: see `Cost.curvature`.
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
        self._bent = tuple(cost for cost in costs if not cost.is_quadratic)
        self._dof = follows.robot.dof
        self._smoothing: tuple[Array, Array] | None = None
        if smoothing is not None:
            stiffness = self._stiffness(2, spline.weights * smoothing.shares)
            self._smoothing = stiffness, smoothing.weight

    @cached_property
    def _forms(self) -> list[tuple[Array, Array]]:
        """K and W of all that is quadratic, see `_stiffness`."""
        found = [] if self._smoothing is None else [self._smoothing]
        for cost in (cost for cost in self._costs if cost.is_quadratic):
            for order, weight in cost.curvature(self._dof).items():
                found.append((self._stiffness(order, self._spline.weights), weight))
        return found

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

    def partials(self, samples: Samples) -> tuple[Partials, ...]:
        """Return the derivatives of the integrand of each cost at the samples."""
        return tuple(cost.gradient(samples) for cost in self._costs)

    def slopes(self, samples: HermiteSamples, partials: Sequence[Partials]) -> Array:
        """Return the derivatives of each interval's cost by q, q̇ at its ends, (N, 4, n)."""
        together = _summed(partials)
        weights, bases = self._spline.weights, self._spline.bases
        count, n = len(weights), samples.q.shape[1]
        found = np.zeros((count, 4, n))
        for order, name in enumerate(_NAMES):
            part = getattr(together, name)
            if part is not None:
                shares = weights[:, :, None] * bases[order]
                found += np.swapaxes(shares, 1, 2) @ part[:-1].reshape(count, 4, n)
        if self._smoothing is not None:
            stiffness, weight = self._smoothing
            found += stiffness @ (samples.ends @ weight)
        return found

    def bends_by_rates(self, partials: Sequence[Partials]) -> bool:
        """Whether a cost that is no quadratic form is one of q̈, the jerk or errors."""
        bent = self._of_bent(partials)
        return any(part is not None for part in (bent.qdd, bent.qddd, bent.error))

    def _of_bent(self, partials: Sequence[Partials]) -> Partials:
        """Return the derivatives of all costs that are no quadratic forms."""
        both = zip(self._costs, partials, strict=True)
        return _summed([own for cost, own in both if not cost.is_quadratic])

    def curvature(
        self, samples: HermiteSamples, partials: Sequence[Partials], changes: Array
    ) -> Array:
        """Return Γᵀ (∂²F) Γ on each interval, by w of its left, then its right node, (N, 4r, 4r).

        `changes` (N + 1, 2, n, 2r) is Γ of the nodes.
        """
        count, _, n, size = changes.shape
        found = np.zeros((count - 1, 2 * size, 2 * size))
        for first in range(0, count - 1, _LOT):
            both, part = _at_ends(changes[first : first + _LOT + 1]), slice(first, first + _LOT)
            flat = np.swapaxes(both.reshape(len(both), 4 * n, 2 * size), 1, 2)
            for stiffness, weight in self._forms:
                turned = stiffness[part] @ (weight @ both).reshape(len(both), 4, -1)
                found[part] += flat @ turned.reshape(len(both), 4 * n, 2 * size)
        if self._bent:
            found += self._bending(samples, self._of_bent(partials), _at_ends(changes))
        return found

    def _bending(self, samples: HermiteSamples, here: Partials, both: Array) -> Array:
        """Return what costs that are no quadratic forms, with derivatives `here`, add to it.

        `both` (N, 4, n, 4r) are the changes of q and q̇ at the ends of each interval.
        """
        spline, (count, _, n, size) = self._spline, both.shape
        r = size // 4
        by_q, by_qd = (
            (bases @ both.reshape(count, 4, -1)).reshape(-1, n, size) for bases in spline.bases[:2]
        )
        # Along the self-motion at the samples: between what it is at the nodes.
        left, right = both[:, None, 0, :, :r], both[:, None, 2, :, 2 * r : 3 * r].copy()
        # In a gap nothing moves.
        right[spline.gaps] = left[spline.gaps]
        share = SHARES[:, None, None]
        along = orthonormal((left + share * (right - left)).reshape(-1, n, r))
        turned = np.swapaxes(along, 1, 2)
        moved = turned @ by_q
        directions = np.concatenate([along, along[-1:]])
        found = np.zeros((count * len(SHARES), size, size))
        for x in range(r):
            changed = self._changed(samples, here, directions[:, :, x], 0.0)
            if changed.q is not None:
                row = (turned @ changed.q[:-1, :, None])[:, :, 0]
                found += _outer(np.einsum("sr,srw->sw", row, moved), moved[:, x])
            if changed.qd is not None:
                cross = _outer(np.einsum("sn,snw->sw", changed.qd[:-1], by_qd), moved[:, x])
                found += cross + np.swapaxes(cross, 1, 2)
        if here.qd is not None:
            for j, axis in enumerate(np.eye(n)):
                faster = self._changed(samples, here, 0.0, axis).qd
                if faster is not None:
                    found += _outer(np.einsum("sn,snw->sw", faster[:-1], by_qd), by_qd[:, j])
        found = (spline.weights.reshape(-1, 1, 1) * found).reshape(count, -1, size, size)
        found = found.sum(axis=1)
        return np.asarray(0.5 * (found + np.swapaxes(found, 1, 2)))

    def _changed(
        self, samples: HermiteSamples, here: Partials, q: Array | float, qd: Array | float
    ) -> Partials:
        """Return how the derivatives `here` of bent costs change in directions of q and q̇."""
        moved = {"q": samples.q + _NEAR * q, "qd": samples.qd + _NEAR * qd}
        shifted = PlacedLater(samples.follows, samples.sampling, **moved)
        there = _summed([cost.gradient(shifted) for cost in self._bent])
        parts = {}
        for name in ("q", "qd"):
            before, after = getattr(here, name), getattr(there, name)
            if before is not None and after is not None:
                parts[name] = (after - before) / _NEAR
        return Partials(**parts)


def _at_ends(changes: Array) -> Array:
    """Return how q, q̇ at both ends of intervals change with w of both, (N, 4, n, 4r).

    For Γ of the nodes, (N + 1, 2, n, 2r).
    """
    count, _, n, size = changes.shape
    both = np.zeros((count - 1, 4, n, 2 * size))
    both[:, :2, :, :size], both[:, 2:, :, size:] = changes[:-1], changes[1:]
    return both


def _summed(each: Sequence[Partials]) -> Partials:
    """Return the sum of derivatives."""
    parts = {}
    for name in (*_NAMES, "error"):
        own = [part for part in (getattr(one, name) for one in each) if part is not None]
        if own:
            parts[name] = own[0] if len(own) == 1 else np.sum(own, axis=0)
    return Partials(**parts)


def _outer(a: Array, b: Array) -> Array:
    """Return a bᵀ for each row, (S, k, k)."""
    return np.asarray(a[:, :, None] * b[:, None, :])


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
    changes : (N + 1, 2, n, 2r)
        Γ = ∂(q, q̇)/∂(z, ν).
    curvature : (N + 1, 2r, 2r)
        ∂(Γᵀλ)/∂w at fixed λ, symmetric.
    """

    changes: Array
    curvature: Array

    @classmethod
    def of(cls, charts: Charts, nu: Array, by_node: Array) -> "Around | None":
        """Look around the reference of charts; None where a neighbour is not to be had.

        `by_node` (N + 1, 2, n) is λ.
        """
        count, n, r = charts.bases.shape
        by_q, by_qd = np.ascontiguousarray(by_node[:, 0]), np.ascontiguousarray(by_node[:, 1])
        changes, bends = np.zeros((count, 2, n, 2 * r)), np.zeros((count, 2 * r, 2 * r))
        changes[:, 0, :, :r] = changes[:, 1, :, r:] = charts.bases
        for x in range(r):
            rates, slopes = [], []
            for side in (_REACH, -_REACH):
                z = np.zeros((count, r))
                z[:, x] = side
                beside = charts.at(z, nu)
                if beside is None:
                    return None
                rates.append(beside.qd)
                slopes.append(charts.pulled(beside, by_q, by_qd))
            changes[:, 1, :, x] = (rates[0] - rates[1]) / (2.0 * _REACH)
            column = (slopes[0] - slopes[1]) / (2.0 * _REACH)
            bends[:, :, x] = column
            bends[:, x, r:] = column[:, r:]
        along = bends[:, :r, :r]
        bends[:, :r, :r] = 0.5 * (along + np.swapaxes(along, 1, 2))
        return cls(changes, bends)

"""The cost of a motion given by its nodes, with its gradient and its curvature.

Each interval's cost depends on its two nodes alone, so that the matrix of second derivatives is
block-tridiagonal. With x = (q, q̇, q̈) of a node as functions of its coordinates w = (z, ν, α),
Γ = ∂x/∂w and λ = ∂F/∂x,

    ∂F/∂w = Γᵀλ,   ∂²F/∂w∂w' = Γᵀ (∂²F/∂x∂x') Γ' + [w is w'] ∂(Γᵀλ)/∂w at fixed λ.

Where costs are quadratic forms of q and its derivatives, the first term is exact. Of others, second
derivatives are differences of gradients: by q along the self-motion, which is where nodes can go,
and by the rates. The last term, the manifold's own curvature, is made of differences along the
manifold, and of what is linear or quadratic in ν and α.
"""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.motion import Sampling
from selfmotion.planning.formulation import Formulation, SampledMotion
from selfmotion.planning.nodes.charts import orthonormal
from selfmotion.planning.nodes.node_matrix import EndChanges, NodeMatrix, Points
from selfmotion.planning.nodes.quadratic import (
    NAMES,
    QuadraticForms,
    by_ends,
    integrals,
    summed,
)
from selfmotion.planning.nodes.smoothness import Smoothing
from selfmotion.planning.nodes.spline import AT_GAUSS, GAUSS, Quintic
from selfmotion.problem.costs import LazySamples, Partials, Samples, is_quadratic_form

# Step of one-sided differences of costs' gradients [rad, m and their rates]: this matrix need not
# be exact.
_NEAR = 1e-6
# Samples, or nodes, that are evaluated in one pass, of several directions.
_TOGETHER = 4096


class NodeCost:
    """F = ∫ Σ G dt along the quintic segments between the nodes.

    Costs are functions of the arm's joints, which are the first of all coordinates: their
    derivatives by the others, 0, are filled in here.

    Parameters
    ----------
    formulation : Formulation
    spline : Quintic
    smoothing : Smoothing, optional
        Minimised besides, and no part of the costs.
    """

    def __init__(
        self,
        formulation: Formulation,
        spline: Quintic,
        smoothing: Smoothing | None = None,
    ) -> None:
        self._spline, self._costs = spline, formulation.costs
        self._bent = tuple(cost for cost in self._costs if not is_quadratic_form(cost))
        self._dof, self._follows = formulation.robot.dof, formulation.problem.follows
        self.quadratic = QuadraticForms(formulation, spline, smoothing)

    @property
    def is_quadratic(self) -> bool:
        """Whether all costs are."""
        return not self._bent

    def bent(self, motion: SampledMotion) -> Array:
        """Return the costs of each interval that are not quadratic, (N,)."""
        return integrals(self._spline, self._bent, motion.arm)

    def partials(self, motion: SampledMotion) -> Partials:
        """Return the derivatives of their integrands."""
        return summed([cost.gradient(motion.arm) for cost in self._bent])

    def bent_slopes(self, motion: SampledMotion, partials: Partials) -> Array:
        """Return their derivatives by y of the arm, (N, 6, n)."""
        return by_ends(self._spline, partials, motion.arm)

    def terms(self, samples: Samples) -> dict[str, float]:
        """Return the contribution of each cost to F, for the motion of the arm."""
        return {cost.name: float(samples.weights @ cost.value(samples)) for cost in self._costs}

    def add_curvature(
        self, matrix: NodeMatrix, by: EndChanges, motion: SampledMotion, partials: Partials
    ) -> None:
        """Add Γᵀ (∂²F) Γ, by the coordinates of all nodes; `partials` are those of `partials`."""
        self.quadratic.add_curvature(matrix, by)
        if self._bent:
            self._add_bending(matrix, by, motion.arm, partials)

    def _add_bending(
        self, matrix: NodeMatrix, by: EndChanges, samples: Samples, here: Partials
    ) -> None:
        """Add the contribution of costs that are not quadratic forms, with derivatives `here`.

        By differences along the self-motion, and by one joint's rate after the other.
        """
        n, weights = self._dof, np.array(samples.weights)
        along = _directions(self, by)
        own = along[:, :n]
        moved = _points(self, 0, along)
        changed = _changes(self, samples, here, [("q", own[:, :, x]) for x in range(own.shape[2])])
        if "q" in changed:
            turned = along @ (np.swapaxes(own, 1, 2) @ changed["q"])
            matrix.add_products(by, moved, _points(self, 0, turned), weights)
        for order, name in enumerate(NAMES[1:], 1):
            if name in changed:
                faster = _points(self, order, changed[name])
                matrix.add_products(by, faster, moved, 2.0 * weights)
        rates = [o for o, name in enumerate(NAMES) if o and getattr(here, name) is not None]
        units = np.broadcast_to(np.eye(n), (len(samples.t), n, n))
        for order in rates:
            axes = [(NAMES[order], axis) for axis in np.eye(n)]
            changed = _changes(self, samples, here, axes)
            for other in rates:
                if NAMES[other] in changed:
                    turned = np.swapaxes(changed[NAMES[other]], 1, 2)
                    pair = _points(self, other, units), _points(self, order, turned)
                    matrix.add_products(by, *pair, weights)


def _points(cost: NodeCost, order: int, forms: Array) -> Points:
    """Return linear forms (S, n, p) of a derivative at the samples."""
    table = np.ascontiguousarray(AT_GAUSS[order])
    return Points(table, cost._spline.rates[order], np.ascontiguousarray(forms))


def _directions(cost: NodeCost, by: EndChanges) -> Array:
    """Return orthonormal self-motion directions at the samples, (S, n, r).

    Interpolated between the nodes.
    """
    spline, (count, _, n, size) = cost._spline, by.nodes.shape
    each = by.nodes[:, 0, :, : size // 3]
    left, right = each[:-1, None], each[1:, None]
    share = GAUSS[:, None, None]
    found = left + share * (right - left)
    found[spline.gaps] = np.eye(n)[:, : size // 3]
    return orthonormal(found.reshape((count - 1) * len(GAUSS), n, -1))


def _changes(
    cost: NodeCost, samples: Samples, here: Partials, directions: Sequence[tuple[str, Array]]
) -> dict[str, Array]:
    """Return changes of non-quadratic costs' derivatives `here` in directions, (S, n, D) each.

    A direction is of q or one of its rates, (S, n) or (n,). Several are evaluated in one pass
    where there are few samples.
    """
    together = max(1, _TOGETHER // len(samples.t))
    found: dict[str, list[Array]] = {}
    for first in range(0, len(directions), together):
        for name, part in _changed(
            cost, samples, here, directions[first : first + together]
        ).items():
            found.setdefault(name, []).append(part)
    return {name: np.concatenate(parts, axis=2) for name, parts in found.items()}


def _changed(
    cost: NodeCost, samples: Samples, here: Partials, directions: Sequence[tuple[str, Array]]
) -> dict[str, Array]:
    """Return the result of `_changes`, all directions in one pass."""
    count, copies = len(samples.t), len(directions)
    flat = {name: np.tile(getattr(samples, name), (copies, 1)) for name in NAMES}
    for k, (name, direction) in enumerate(directions):
        flat[name][k * count : (k + 1) * count] += _NEAR * direction
    t, weights = (np.tile(values, copies) for values in (samples.t, samples.weights))
    sampling = Sampling(t, weights, np.arange(len(t)))
    shifted = LazySamples(cost._follows, sampling, **flat)
    there = summed([cost.gradient(shifted) for cost in cost._bent])
    parts = {}
    for name in NAMES:
        before, after = getattr(here, name), getattr(there, name)
        if before is not None and after is not None:
            change = (after.reshape(copies, count, -1) - before) / _NEAR
            parts[name] = np.moveaxis(change, 0, 2)
    return parts

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
from functools import cached_property

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.motion import Sampling
from selfmotion.planning.formulation import Formulation, SampledMotion
from selfmotion.planning.nodes.charts import orthonormal
from selfmotion.planning.nodes.node_matrix import EndChanges, NodeMatrix, Points
from selfmotion.planning.nodes.smoothness import Smoothing
from selfmotion.planning.nodes.spline import AT_GAUSS, GAUSS, WEIGHTS, Quintic
from selfmotion.problem.costs import Partials, PlacedLater, Samples

# Step of one-sided differences of costs' gradients [rad, m and their rates]: this matrix need not
# be exact.
_NEAR = 1e-6
# Derivatives of a sample, by order.
_NAMES = ("q", "qd", "qdd", "qddd")
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
        self._springs = formulation.springs
        self._bent = tuple(cost for cost in self._costs if not cost.is_quadratic)
        self._dof, self._follows = formulation.robot.dof, formulation.problem.follows
        self._follows_dof = formulation.follows.dof
        self._smoothing: tuple[Array, Array] | None = None
        if smoothing is not None:
            each = [self._stiffness(order, b) for order, b in smoothing.shares.items()]
            self._smoothing = np.sum(each, axis=0), smoothing.weight

    @cached_property
    def _joint_forms(self) -> Array:
        """Second derivatives of all that is quadratic in each coordinate, (N, n, 6, 6) by its y."""
        n, dof = self._dof, self._follows_dof
        found = np.zeros((self._spline.count, dof, 6, 6))
        for stiffness, weight in self._forms:
            if _is_diagonal(weight):
                found[:, :n] += np.diagonal(weight)[:, None, None] * stiffness[:, None]
        if self._springs is not None:
            found[:, n:] += self._springs[:, None, None] * self._stiffness(0)[:, None]
        return found

    @cached_property
    def _coupled_forms(self) -> list[tuple[Array, Array]]:
        """K and W of what is quadratic in several joints together."""
        return [
            (stiffness, np.array(weight, order="C"))
            for stiffness, weight in self._forms
            if not _is_diagonal(weight)
        ]

    @cached_property
    def _forms(self) -> list[tuple[Array, Array]]:
        """K and W of all that is quadratic in the arm's joints, see `_stiffness`."""
        found = [] if self._smoothing is None else [self._smoothing]
        for cost in (cost for cost in self._costs if cost.is_quadratic):
            for order, weight in cost.curvature(self._dof).items():
                found.append((self._stiffness(order), weight))
        return found

    def _stiffness(self, order: int, shares: Array | None = None) -> Array:
        """Return K of ½ Σ K_ab y_aᵀWy_b for the ends y of each interval, (N, 6, 6)."""
        table, scale = AT_GAUSS[order], self._spline.rates(2 * order) * self._spline.steps
        scale[self._spline.gaps] = 0.0
        if shares is None:
            return np.asarray(scale[:, None, None] * (table.T @ (WEIGHTS[:, None] * table)))
        weighted = (WEIGHTS * shares)[:, :, None] * table
        return np.asarray(scale[:, None, None] * (table.T @ weighted))

    def integrand(self, motion: SampledMotion) -> Array:
        """Return Σ G at the samples, (S,)."""
        found = np.sum([cost.value(motion.arm) for cost in self._costs], axis=0)
        if self._springs is not None:
            found = found + 0.5 * motion.tolerances.q**2 @ self._springs
        return np.asarray(found)

    def terms(self, samples: Samples) -> dict[str, float]:
        """Return the contribution of each cost to F, for the motion of the arm."""
        return {cost.name: float(samples.weights @ cost.value(samples)) for cost in self._costs}

    def roughness(self, ends: Array) -> float:
        """Return the contribution of the smoothing, for y (N, 6, n)."""
        if self._smoothing is None:
            return 0.0
        stiffness, weight = self._smoothing
        own = ends[:, :, : self._dof]
        return 0.5 * float(np.sum((stiffness @ own) * (own @ weight)))

    def partials(self, samples: Samples) -> tuple[Partials, ...]:
        """Return the derivatives of the integrand of each cost, for the motion of the arm."""
        return tuple(cost.gradient(samples) for cost in self._costs)

    def slopes(self, samples: Samples, ends: Array, partials: Sequence[Partials]) -> Array:
        """Return the derivatives of each interval's cost by y, (N, 6, n)."""
        together, spline = _summed(partials), self._spline
        weights = samples.weights.reshape(spline.count, -1, 1)
        found = np.zeros_like(ends)
        own = found[:, :, : self._dof]
        for order, name in enumerate(_NAMES):
            part = getattr(together, name)
            if part is not None:
                each = weights * spline.rates(order)[:, None, None]
                own += AT_GAUSS[order].T @ (each * part.reshape(*weights.shape[:2], -1))
        if self._smoothing is not None:
            stiffness, weight = self._smoothing
            own += stiffness @ (ends[:, :, : self._dof] @ weight)
        if self._springs is not None:
            found[:, :, self._dof :] += self._stiffness(0) @ (
                ends[:, :, self._dof :] * self._springs
            )
        return found

    def add_curvature(
        self, matrix: NodeMatrix, by: EndChanges, samples: Samples, partials: Sequence[Partials]
    ) -> None:
        """Add Γᵀ (∂²F) Γ, by the coordinates of all nodes."""
        matrix.add_joint_forms(by, self._joint_forms)
        for stiffness, weight in self._coupled_forms:
            matrix.add_form(by, stiffness, weight)
        if self._bent:
            self._add_bending(matrix, by, samples, _of_bent(self, partials))

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
        for order, name in enumerate(_NAMES[1:], 1):
            if name in changed:
                faster = _points(self, order, changed[name])
                matrix.add_products(by, faster, moved, 2.0 * weights)
        rates = [o for o, name in enumerate(_NAMES) if o and getattr(here, name) is not None]
        units = np.broadcast_to(np.eye(n), (len(samples.t), n, n))
        for order in rates:
            axes = [(_NAMES[order], axis) for axis in np.eye(n)]
            changed = _changes(self, samples, here, axes)
            for other in rates:
                if _NAMES[other] in changed:
                    turned = np.swapaxes(changed[_NAMES[other]], 1, 2)
                    pair = _points(self, other, units), _points(self, order, turned)
                    matrix.add_products(by, *pair, weights)


def _of_bent(cost: NodeCost, partials: Sequence[Partials]) -> Partials:
    """Return the summed derivatives of all costs that are not quadratic forms."""
    both = zip(cost._costs, partials, strict=True)
    return _summed([own for cost, own in both if not cost.is_quadratic])


def _points(cost: NodeCost, order: int, forms: Array) -> Points:
    """Return linear forms (S, n, p) of a derivative at the samples."""
    table = np.ascontiguousarray(AT_GAUSS[order])
    return Points(table, cost._spline.rates(order), np.ascontiguousarray(forms))


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
    flat = {name: np.tile(getattr(samples, name), (copies, 1)) for name in _NAMES}
    for k, (name, direction) in enumerate(directions):
        flat[name][k * count : (k + 1) * count] += _NEAR * direction
    t, weights = (np.tile(values, copies) for values in (samples.t, samples.weights))
    sampling = Sampling(t, weights, np.arange(len(t)))
    shifted = PlacedLater(cost._follows, sampling, **flat)
    there = _summed([cost.gradient(shifted) for cost in cost._bent])
    parts = {}
    for name in _NAMES:
        before, after = getattr(here, name), getattr(there, name)
        if before is not None and after is not None:
            change = (after.reshape(copies, count, -1) - before) / _NEAR
            parts[name] = np.moveaxis(change, 0, 2)
    return parts


def _is_diagonal(weight: Array) -> bool:
    return np.array_equal(weight, np.diag(np.diagonal(weight)))


def _summed(each: Sequence[Partials]) -> Partials:
    """Return the sum of derivatives."""
    parts = {}
    for name in (*_NAMES, "error"):
        own = [part for part in (getattr(one, name) for one in each) if part is not None]
        if own:
            parts[name] = own[0] if len(own) == 1 else np.sum(own, axis=0)
    return Partials(**parts)

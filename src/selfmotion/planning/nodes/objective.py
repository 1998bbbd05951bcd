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
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, kernel
from selfmotion.model.motion import Sampling
from selfmotion.planning.formulation import Formulation, SampledMotion
from selfmotion.planning.nodes.charts import orthonormal
from selfmotion.planning.nodes.node_matrix import EndChanges, NodeMatrix, Points
from selfmotion.planning.nodes.smoothness import Smoothing
from selfmotion.planning.nodes.spline import AT_GAUSS, GAUSS, WEIGHTS, Quintic
from selfmotion.problem.costs import Cost, Partials, PlacedLater, Samples, is_quadratic_form

# Step of one-sided differences of costs' gradients [rad, m and their rates]: this matrix need not
# be exact.
_NEAR = 1e-6
# Derivatives of a sample, by order.
_NAMES = ("q", "qd", "qdd", "qddd")
# Samples, or nodes, that are evaluated in one pass, of several directions.
_TOGETHER = 4096


class _Form(NamedTuple):
    """A quadratic form ½ Σ K_ab y_aᵀWy_b of the ends y of each interval.

    Attributes
    ----------
    stiffness : (N, 6, 6)
        K.
    weight : (n, n)
        W.
    is_smoothing : bool
        Whether it is none of a cost.
    """

    stiffness: Array
    weight: Array
    is_smoothing: bool = False

    @property
    def is_diagonal(self) -> bool:
        """Whether it couples no joints."""
        return np.array_equal(self.weight, np.diag(np.diagonal(self.weight)))


class Quadratic(NamedTuple):
    """What is quadratic in the ends y of each interval.

    Attributes
    ----------
    costs, smoothing : (N,)
        Values, by interval.
    slopes : (N, 6, n)
        Derivatives of their sum by y.
    """

    costs: Array
    smoothing: Array
    slopes: Array


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
        self._bent = tuple(cost for cost in self._costs if not is_quadratic_form(cost))
        self._dof, self._follows = formulation.robot.dof, formulation.problem.follows
        self._follows_dof = formulation.follows.dof
        self._smoothing: list[_Form] = []
        if smoothing is not None:
            each = [self._stiffness(order, b) for order, b in smoothing.shares.items()]
            self._smoothing = [_Form(np.sum(each, axis=0), smoothing.weight, True)]

    @cached_property
    def _forms(self) -> list[_Form]:
        """What is quadratic in the arm's joints, of costs."""
        return [
            _Form(self._stiffness(order), np.array(weight, order="C"))
            for cost in self._costs
            if is_quadratic_form(cost)
            for order, weight in cost.curvature(self._dof).items()
        ]

    @cached_property
    def _cost_forms(self) -> Array:
        """Second derivatives of costs that are quadratic in each coordinate, (N, n, 6, 6) by y."""
        found = self._of_each_joint(self._forms)
        if self._springs is not None:
            own = found[:, self._dof :]
            own += self._springs[:, None, None] * self._stiffness(0)[:, None]
        return found

    @cached_property
    def _smoothing_forms(self) -> Array:
        """The same of the smoothing."""
        return self._of_each_joint(self._smoothing)

    @cached_property
    def _joint_forms(self) -> Array:
        """The same of both."""
        return self._cost_forms + self._smoothing_forms

    @cached_property
    def _coupled(self) -> list[_Form]:
        """The forms of both that couple joints."""
        return [form for form in (*self._smoothing, *self._forms) if not form.is_diagonal]

    def _of_each_joint(self, forms: Sequence[_Form]) -> Array:
        """Return the sum of forms that couple no joints, (N, n, 6, 6)."""
        found = np.zeros((self._spline.count, self._follows_dof, 6, 6))
        for form in forms:
            if form.is_diagonal:
                weight = np.diagonal(form.weight)[:, None, None]
                found[:, : self._dof] += weight * form.stiffness[:, None]
        return found

    def _stiffness(self, order: int, shares: Array | None = None) -> Array:
        """Return K of ½ Σ K_ab y_aᵀWy_b for the ends y of each interval, (N, 6, 6)."""
        table, scale = AT_GAUSS[order], self._spline.rates[2 * order] * self._spline.steps
        scale[self._spline.gaps] = 0.0
        if shares is None:
            return np.asarray(scale[:, None, None] * (table.T @ (WEIGHTS[:, None] * table)))
        weighted = (WEIGHTS * shares)[:, :, None] * table
        return np.asarray(scale[:, None, None] * (table.T @ weighted))

    @cached_property
    def _at_origin(self) -> tuple[Array, Array]:
        """Value (N,) and derivatives by y (N, 6, n) of the quadratic costs where y = 0."""
        sampling, count = self._spline.sampling, self._spline.count
        values, slopes = np.zeros(count), np.zeros((count, 6, self._follows_dof))
        own = [cost for cost in self._costs if is_quadratic_form(cost)]
        if own:
            none = {name: np.zeros((len(sampling.t), self._dof)) for name in _NAMES}
            there = PlacedLater(self._follows, sampling, **none)
            values += self._integrals(own, there)
            partials = _summed([cost.gradient(there) for cost in own])
            slopes[:, :, : self._dof] = self._by_ends(partials, there)
        return values, slopes

    def quadratic(self, ends: Array) -> Quadratic:
        """Return what is quadratic in y (N, 6, n): costs, and smoothing."""
        values, linear = self._at_origin
        costs, smoothing, slopes = values.copy(), np.zeros(len(ends)), linear.copy()
        evaluate_forms(self._cost_forms, self._smoothing_forms, ends, costs, smoothing, slopes)
        arm, pushes = ends[:, :, : self._dof], slopes[:, :, : self._dof]
        for form in self._coupled:
            pushed = form.stiffness @ (arm @ form.weight)
            values = smoothing if form.is_smoothing else costs
            values += 0.5 * np.einsum("kaj,kaj->k", arm, pushed)
            pushes += pushed
        return Quadratic(costs, smoothing, slopes)

    @property
    def is_quadratic(self) -> bool:
        """Whether all costs are."""
        return not self._bent

    def bent(self, motion: SampledMotion) -> Array:
        """Return the costs of each interval that are not quadratic, (N,)."""
        return self._integrals(self._bent, motion.arm)

    def _integrals(self, costs: Sequence[Cost], samples: Samples) -> Array:
        """Return Σ costs of each interval, (N,)."""
        each, weights = np.sum([cost.value(samples) for cost in costs], axis=0), samples.weights
        # In gaps, a cost may be infinite.
        shares, counts = np.zeros_like(each), weights > 0.0
        shares[counts] = weights[counts] * each[counts]
        return np.asarray(shares.reshape(self._spline.count, -1).sum(axis=1))

    def terms(self, samples: Samples) -> dict[str, float]:
        """Return the contribution of each cost to F, for the motion of the arm."""
        return {cost.name: float(samples.weights @ cost.value(samples)) for cost in self._costs}

    def partials(self, motion: SampledMotion) -> Partials:
        """Return the derivatives of their integrands."""
        return _summed([cost.gradient(motion.arm) for cost in self._bent])

    def bent_slopes(self, motion: SampledMotion, partials: Partials) -> Array:
        """Return their derivatives by y of the arm, (N, 6, n)."""
        return self._by_ends(partials, motion.arm)

    def _by_ends(self, partials: Partials, samples: Samples) -> Array:
        """Return the derivatives of each interval's cost by y of the arm, (N, 6, n)."""
        spline = self._spline
        weights = samples.weights.reshape(spline.count, -1, 1)
        found = np.zeros((spline.count, 6, self._dof))
        for order, name in enumerate(_NAMES):
            part = getattr(partials, name)
            if part is not None:
                each = weights * spline.rates[order][:, None, None]
                found += AT_GAUSS[order].T @ (each * part.reshape(*weights.shape[:2], -1))
        return found

    def add_curvature(
        self, matrix: NodeMatrix, by: EndChanges, motion: SampledMotion, partials: Partials
    ) -> None:
        """Add Γᵀ (∂²F) Γ, by the coordinates of all nodes; `partials` are those of `partials`."""
        matrix.add_joint_forms(by, self._joint_forms)
        for form in self._coupled:
            matrix.add_form(by, form.stiffness, form.weight)
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


def _summed(each: Sequence[Partials]) -> Partials:
    """Return the sum of derivatives."""
    parts = {}
    for name in (*_NAMES, "error"):
        own = [part for part in (getattr(one, name) for one in each) if part is not None]
        if own:
            parts[name] = own[0] if len(own) == 1 else np.sum(own, axis=0)
    return Partials(**parts)


@kernel
def evaluate_forms(
    costs: Array,
    smoothing: Array,
    ends: Array,
    cost_values: Array,
    smoothing_values: Array,
    slopes: Array,
) -> None:
    """Add ½ yᵀKy + gᵀy to the values (N,) of intervals with y = `ends` (N, 6, n).

    K (N, n, 6, 6) of `costs` and of `smoothing`; `slopes` (N, 6, n) are g of the costs before, and
    g + Ky of both afterwards.
    """
    count, _, n = ends.shape
    for k in range(count):
        for j in range(n):
            for a in range(6):
                pushed, smoothed = 0.0, 0.0
                for b in range(6):
                    pushed += costs[k, j, a, b] * ends[k, b, j]
                    smoothed += smoothing[k, j, a, b] * ends[k, b, j]
                cost_values[k] += ends[k, a, j] * (slopes[k, a, j] + 0.5 * pushed)
                smoothing_values[k] += 0.5 * ends[k, a, j] * smoothed
                slopes[k, a, j] += pushed + smoothed

"""What is quadratic in a motion of nodes: costs of derivatives, springs, and the smoothing.

Of the ends y of each interval, see `Quintic`, it is a constant, a linear part and ½ uᵀKu, with the
same K for all motions on the same nodes. u is the Taylor polynomial of the left node, and what it
leaves of q, q̇ and q̈ at the right one: of a derivative, y would cancel the digits that say how the
curve bends on a short interval.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, kernel
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.nodes.node_matrix import EndChanges, NodeMatrix
from selfmotion.planning.nodes.smoothness import Smoothing
from selfmotion.planning.nodes.spline import AT_GAUSS, WEIGHTS, Quintic
from selfmotion.problem.costs import Cost, LazySamples, Partials, Samples, is_quadratic_form

# Derivatives of a sample, by order.
NAMES = ("q", "qd", "qdd", "qddd")
# u by y.
_BENT = np.eye(6)
_BENT[3:, :3] = -np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])


class _Form(NamedTuple):
    """A quadratic form ½ Σ K_ab u_aᵀWu_b of each interval.

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
    """What is quadratic, of one motion.

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


class QuadraticForms:
    """All that is quadratic in the motions on the same nodes.

    Costs are functions of the arm's joints, which are the first of all coordinates; springs are of
    the others.

    Parameters
    ----------
    formulation : Formulation
    spline : Quintic
    smoothing : Smoothing, optional
        Minimised besides, and no part of the costs.
    """

    def __init__(
        self, formulation: Formulation, spline: Quintic, smoothing: Smoothing | None
    ) -> None:
        self._spline, self._springs = spline, formulation.springs
        self._costs = [cost for cost in formulation.costs if is_quadratic_form(cost)]
        self._dof, self._follows = formulation.robot.dof, formulation.problem.follows
        self._size = formulation.follows.dof
        own = [
            _Form(_stiffness(spline, order), np.array(weight, order="C"))
            for cost in self._costs
            for order, weight in cost.curvature(self._dof).items()
        ]
        smooth = []
        if smoothing is not None:
            each = [_stiffness(spline, order, b) for order, b in smoothing.shares.items()]
            smooth = [_Form(np.sum(each, axis=0), smoothing.weight, True)]
        self._of_costs, self._of_smoothing = (self._each_joint(forms) for forms in (own, smooth))
        if self._springs is not None:
            springs = self._springs[:, None, None] * _stiffness(spline, 0)[:, None]
            self._of_costs[:, self._dof :] += springs
        self._coupled = [form for form in (*smooth, *own) if not form.is_diagonal]

    def _each_joint(self, forms: Sequence[_Form]) -> Array:
        """Return the sum of forms that couple no joints, (N, n, 6, 6) by u of each."""
        found = np.zeros((self._spline.count, self._size, 6, 6))
        for form in forms:
            if form.is_diagonal:
                weight = np.diagonal(form.weight)[:, None, None]
                found[:, : self._dof] += weight * form.stiffness[:, None]
        return found

    @cached_property
    def _curvature(self) -> tuple[Array, list[tuple[Array, Array]]]:
        """Second derivatives by y: of each joint (N, n, 6, 6), and K and W of coupled forms."""
        coupled = [(_by_ends(form.stiffness), form.weight) for form in self._coupled]
        return _by_ends(self._of_costs + self._of_smoothing), coupled

    @cached_property
    def _at_origin(self) -> tuple[Array, Array]:
        """Value (N,) and derivatives by y (N, 6, n) of the costs where y = 0."""
        spline = self._spline
        values, slopes = np.zeros(spline.count), np.zeros((spline.count, 6, self._size))
        if self._costs:
            sampling = spline.sampling
            none = {name: np.zeros((len(sampling.t), self._dof)) for name in NAMES}
            there = LazySamples(self._follows, sampling, **none)
            values += integrals(spline, self._costs, there)
            partials = summed([cost.gradient(there) for cost in self._costs])
            slopes[:, :, : self._dof] = by_ends(spline, partials, there)
        return values, slopes

    def at(self, ends: Array) -> Quadratic:
        """Return what is quadratic at y (N, 6, n)."""
        values, linear = self._at_origin
        costs, smoothing, slopes = values.copy(), np.zeros(len(ends)), linear.copy()
        evaluate_forms(self._of_costs, self._of_smoothing, ends, costs, smoothing, slopes)
        pushes = slopes[:, :, : self._dof]
        for form in self._coupled:
            arm = _BENT @ ends[:, :, : self._dof]
            pushed = form.stiffness @ (arm @ form.weight)
            values = smoothing if form.is_smoothing else costs
            values += 0.5 * np.einsum("kaj,kaj->k", arm, pushed)
            pushes += _BENT.T @ pushed
        return Quadratic(costs, smoothing, slopes)

    def add_curvature(self, matrix: NodeMatrix, by: EndChanges) -> None:
        """Add the second derivatives by the coordinates of all nodes."""
        forms, coupled = self._curvature
        matrix.add_joint_forms(by, forms)
        for stiffness, weight in coupled:
            matrix.add_form(by, stiffness, weight)


def _stiffness(spline: Quintic, order: int, shares: Array | None = None) -> Array:
    """Return K of ½ Σ K_ab u_aᵀWu_b of each interval, (N, 6, 6)."""
    table, scale = AT_GAUSS[order] @ np.linalg.inv(_BENT), spline.rates[2 * order] * spline.steps
    # A Taylor polynomial of lower degree has no such derivative.
    table[:, :order] = 0.0
    scale[spline.gaps] = 0.0
    if shares is None:
        return np.asarray(scale[:, None, None] * (table.T @ (WEIGHTS[:, None] * table)))
    weighted = (WEIGHTS * shares)[:, :, None] * table
    return np.asarray(scale[:, None, None] * (table.T @ weighted))


def _by_ends(forms: Array) -> Array:
    """Return second derivatives by y, for those by u, (…, 6, 6)."""
    return np.ascontiguousarray(_BENT.T @ forms @ _BENT)


def integrals(spline: Quintic, costs: Sequence[Cost], samples: Samples) -> Array:
    """Return the integral of the sum of costs over each interval, (N,)."""
    each, weights = np.sum([cost.value(samples) for cost in costs], axis=0), samples.weights
    # In gaps, a cost may be infinite.
    shares, counts = np.zeros_like(each), weights > 0.0
    shares[counts] = weights[counts] * each[counts]
    return np.asarray(shares.reshape(spline.count, -1).sum(axis=1))


def by_ends(spline: Quintic, partials: Partials, samples: Samples) -> Array:
    """Return the derivatives of such an integral by y of the arm, (N, 6, n)."""
    weights = samples.weights.reshape(spline.count, -1, 1)
    found = np.zeros((spline.count, 6, samples.q.shape[1]))
    for order, name in enumerate(NAMES):
        part = getattr(partials, name)
        if part is not None:
            each = weights * spline.rates[order][:, None, None]
            found += AT_GAUSS[order].T @ (each * part.reshape(*weights.shape[:2], -1))
    return found


def summed(each: Sequence[Partials]) -> Partials:
    """Return the sum of derivatives."""
    parts = {}
    for name in (*NAMES, "error"):
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
    """Add ½ uᵀKu + gᵀy to the values (N,) of intervals with y = `ends` (N, 6, n).

    K (N, n, 6, 6) of `costs` and of `smoothing`; `slopes` (N, 6, n) are g of the costs before, and
    the derivatives of both by y afterwards.
    """
    count, _, n = ends.shape
    u, pushes = np.empty(6), np.empty(6)
    for k in range(count):
        for j in range(n):
            for a in range(6):
                u[a] = ends[k, a, j]
                cost_values[k] += u[a] * slopes[k, a, j]
            u[3] = u[3] - u[0] - u[1] - 0.5 * u[2]
            u[4] = u[4] - u[1] - u[2]
            u[5] = u[5] - u[2]
            for a in range(6):
                pushed, smoothed = 0.0, 0.0
                for b in range(6):
                    pushed += costs[k, j, a, b] * u[b]
                    smoothed += smoothing[k, j, a, b] * u[b]
                cost_values[k] += 0.5 * u[a] * pushed
                smoothing_values[k] += 0.5 * u[a] * smoothed
                pushes[a] = pushed + smoothed
            pushes[0] -= pushes[3]
            pushes[1] -= pushes[3] + pushes[4]
            pushes[2] -= 0.5 * pushes[3] + pushes[4] + pushes[5]
            for a in range(6):
                slopes[k, a, j] += pushes[a]

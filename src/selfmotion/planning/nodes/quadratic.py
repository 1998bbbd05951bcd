"""What is quadratic in a motion of nodes: costs of derivatives, springs, and the smoothing.

Of the ends y of each interval, see `Quintic`, it is a constant, a linear part and ½ yᵀKy, with the
same K for all motions on the same nodes.
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
from selfmotion.problem.costs import Cost, Partials, PlacedLater, Samples, is_quadratic_form

# Derivatives of a sample, by order.
NAMES = ("q", "qd", "qdd", "qddd")


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
        """Return the sum of forms that couple no joints, (N, n, 6, 6) by y of each."""
        found = np.zeros((self._spline.count, self._size, 6, 6))
        for form in forms:
            if form.is_diagonal:
                weight = np.diagonal(form.weight)[:, None, None]
                found[:, : self._dof] += weight * form.stiffness[:, None]
        return found

    @cached_property
    def _of_both(self) -> Array:
        return self._of_costs + self._of_smoothing

    @cached_property
    def _at_origin(self) -> tuple[Array, Array]:
        """Value (N,) and derivatives by y (N, 6, n) of the costs where y = 0."""
        spline = self._spline
        values, slopes = np.zeros(spline.count), np.zeros((spline.count, 6, self._size))
        if self._costs:
            sampling = spline.sampling
            none = {name: np.zeros((len(sampling.t), self._dof)) for name in NAMES}
            there = PlacedLater(self._follows, sampling, **none)
            values += integrals(spline, self._costs, there)
            partials = summed([cost.gradient(there) for cost in self._costs])
            slopes[:, :, : self._dof] = by_ends(spline, partials, there)
        return values, slopes

    def at(self, ends: Array) -> Quadratic:
        """Return what is quadratic at y (N, 6, n)."""
        values, linear = self._at_origin
        costs, smoothing, slopes = values.copy(), np.zeros(len(ends)), linear.copy()
        evaluate_forms(self._of_costs, self._of_smoothing, ends, costs, smoothing, slopes)
        arm, pushes = ends[:, :, : self._dof], slopes[:, :, : self._dof]
        for form in self._coupled:
            pushed = form.stiffness @ (arm @ form.weight)
            values = smoothing if form.is_smoothing else costs
            values += 0.5 * np.einsum("kaj,kaj->k", arm, pushed)
            pushes += pushed
        return Quadratic(costs, smoothing, slopes)

    def add_curvature(self, matrix: NodeMatrix, by: EndChanges) -> None:
        """Add the second derivatives by the coordinates of all nodes."""
        matrix.add_joint_forms(by, self._of_both)
        for form in self._coupled:
            matrix.add_form(by, form.stiffness, form.weight)


def _stiffness(spline: Quintic, order: int, shares: Array | None = None) -> Array:
    """Return K of ½ Σ K_ab y_aᵀWy_b for the ends y of each interval, (N, 6, 6)."""
    table, scale = AT_GAUSS[order], spline.rates[2 * order] * spline.steps
    scale[spline.gaps] = 0.0
    if shares is None:
        return np.asarray(scale[:, None, None] * (table.T @ (WEIGHTS[:, None] * table)))
    weighted = (WEIGHTS * shares)[:, :, None] * table
    return np.asarray(scale[:, None, None] * (table.T @ weighted))


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

"""From the decision vector to the cost and its gradient: the only place with the chain rule."""

from collections.abc import Sequence

import numpy as np

from selfmotion.arrays import Array
from selfmotion.costs import Cost
from selfmotion.null_motion import NullMotionTable
from selfmotion.rollout import Rollout


class Objective:
    """F(x) = ∫ Σ G(q̇, q, t) dt along the motion that the coefficients x drive.

    Parameters
    ----------
    rollout : Rollout
        The engine; its grid is that of the null motion.
    null_motion : NullMotionTable
        x → ε at the stages.
    costs : sequence of Cost
    start : (n,)
        q(0).

    Attributes
    ----------
    evaluations, gradient_evaluations : int
        How often F and ∇F were computed.
    """

    def __init__(
        self,
        rollout: Rollout,
        null_motion: NullMotionTable,
        costs: Sequence[Cost],
        start: Array,
    ) -> None:
        self.rollout, self.null_motion = rollout, null_motion
        self._costs, self._start = tuple(costs), start
        self.evaluations = 0
        self.gradient_evaluations = 0
        self._at: Array | None = None
        self._terms: dict[str, float] = {}

    @property
    def size(self) -> int:
        """Number of decision variables."""
        return self.null_motion.size

    def value(self, x: Array) -> float:
        """Return F(x); infinite where the motion breaks down."""
        self._run(x)
        return self._total

    def gradient(self, x: Array) -> Array:
        """Return ∇F(x), (size,): exact for the discretised motion; NaN where it breaks down."""
        self._run(x)
        self.gradient_evaluations += 1
        if not np.isfinite(self._total):
            return np.full(self.size, np.nan)
        samples = self.rollout.samples()
        by_q, by_qd = np.zeros_like(samples.q), np.zeros_like(samples.qd)
        weights = samples.weights[:, None]
        nodes = self.rollout.grid.node_stages
        for cost in self._costs:
            partials = cost.gradient(samples)
            if partials.q is not None:
                by_q += weights * partials.q
            if partials.qd is not None:
                by_qd += weights * partials.qd
            for order, part in ((1, partials.qdd), (2, partials.qddd)):
                if part is not None:
                    by_qd[nodes] += self.rollout.grid.differentiation(order).T @ (weights * part)
        by_epsilon, _ = self.rollout.pullback(by_q, by_qd)
        return self.null_motion.pullback(by_epsilon)

    def slope(self, x: Array, direction: Array) -> float:
        """Return the derivative of F at x along `direction`."""
        return float(self.gradient(x) @ direction)

    def terms(self, x: Array) -> dict[str, float]:
        """Return what each cost contributes to F(x)."""
        self._run(x)
        return dict(self._terms)

    def metric(self, x: Array) -> Array:
        """Return the Gauss-Newton matrix of the quadratic costs at x, (size, size).

        ∫ Σ_k (∂q^(k)/∂x)ᵀ W_k (∂q^(k)/∂x) dt over the derivatives q^(k) of q that the costs weigh;
        without such a cost, that of ½ q̇ᵀq̇. Its inverse starts the quasi-Newton method.
        """
        self._run(x)
        n, grid = self.rollout.robot.dof, self.rollout.grid
        by_q, by_qd = self.rollout.sensitivities(self.null_motion.matrix())
        curvatures = [cost.curvature(n) for cost in self._costs]
        if not any(curvatures):
            curvatures = [{1: np.eye(n)}]
        metric = np.zeros((self.size, self.size))
        nodes = by_qd[grid.node_stages].reshape(len(grid.nodes), -1)
        for curvature in curvatures:
            for order, weight in curvature.items():
                tangent = by_q if order == 0 else by_qd
                if order > 1:
                    tangent = (grid.differentiation(order - 1) @ nodes).reshape(by_qd.shape)
                weighted = grid.weights[:, None, None] * (weight @ tangent)
                metric += tangent.reshape(-1, self.size).T @ weighted.reshape(-1, self.size)
        return metric

    @property
    def _total(self) -> float:
        total = sum(self._terms.values())
        return total if np.isfinite(total) else np.inf

    def _run(self, x: Array) -> None:
        """Make `x` the motion that the rollout holds."""
        if self._at is not None and np.array_equal(self._at, x):
            return
        self.evaluations += 1
        self._at = x.copy()
        names = [cost.name for cost in self._costs]
        if self.rollout.run(self._start, self.null_motion.epsilon(x)) is not None:
            self._terms = dict.fromkeys(names, np.inf)
            return
        samples = self.rollout.samples()
        self._terms = {
            cost.name: float(samples.weights @ cost.value(samples)) for cost in self._costs
        }


def inverse_metric(metric: Array, floor: float = 1e-4) -> Array:
    """Return the inverse of a positive semidefinite matrix.

    Directions without curvature (coefficients that do not act, as in the over-specified joint
    space) are given that of `floor` times the largest.
    """
    values, vectors = np.linalg.eigh(metric)
    values = np.maximum(values, floor * max(values[-1], np.finfo(float).tiny))
    return np.asarray((vectors / values) @ vectors.T)

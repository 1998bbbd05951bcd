"""Integrals of costs over a motion: their sum, its derivatives by samples, and its curvature."""

from collections.abc import Callable, Sequence

import numpy as np

from selfmotion.basics import Array, ProblemError
from selfmotion.costs import ERROR, Cost, Samples
from selfmotion.motion import Grid

# Samples whose tangents are weighed together.
_LOT = 4096


class CostIntegrals:
    """∫ Σ G dt over the motions on a grid.

    Parameters
    ----------
    costs : sequence of Cost
        The integrands G.
    grid : Grid
    """

    def __init__(self, costs: Sequence[Cost], grid: Grid) -> None:
        self._costs, self._grid = tuple(costs), grid
        self.names = tuple(cost.name for cost in costs)

    def values(self, samples: Samples) -> dict[str, float]:
        """Return the integral of each cost."""
        return {cost.name: float(samples.weights @ cost.value(samples)) for cost in self._costs}

    def cotangents(self, samples: Samples) -> tuple[Array, Array, Array]:
        """Return the derivatives of the sum with respect to q, q̇ and e at the stages.

        Raises
        ------
        ProblemError
            One of them is not finite.
        """
        sampling = self._grid.sampling
        by_q, by_qd = np.zeros_like(samples.q), np.zeros_like(samples.qd)
        by_error = np.zeros_like(samples.error)
        weights, nodes = samples.weights[:, None], sampling.nodes
        for cost in self._costs:
            partials = cost.gradient(samples)
            for total, part in (
                (by_q, partials.q),
                (by_qd, partials.qd),
                (by_error, partials.error),
            ):
                if part is not None:
                    self._require_finite(cost, "gradient", part)
                    total += weights * part
            for order, part in ((1, partials.qdd), (2, partials.qddd)):
                if part is not None:
                    self._require_finite(cost, "gradient", part)
                    by_qd[nodes] += sampling.differentiation(order).T @ (weights * part)
        return by_q, by_qd, by_error

    def require_finite(self, samples: Samples) -> None:
        """Raise ProblemError where a cost has no finite value; says when."""
        for cost in self._costs:
            self._require_finite(cost, "value", np.asarray(cost.value(samples)))

    def _require_finite(self, cost: Cost, which: str, table: Array) -> None:
        bad = ~np.isfinite(table)
        if bad.any():
            row = int(np.argmax(bad.reshape(len(bad), -1).any(axis=1)))
            raise ProblemError(
                f"cost '{cost.name}': its {which} is {table[row]} at "
                f"t = {self._grid.stage_times[row]:.6g} s, expected finite numbers; "
                f"selfmotion.testing.check_cost checks a cost"
            )

    def curvature(self, by_q: Array, by_qd: Array, by_error: Callable[[], Array]) -> Array:
        """Return ∫ Σ_k (∂q^(k)/∂x)ᵀ W_k (∂q^(k)/∂x) dt, (size, size).

        Over the derivatives q^(k) of q that the costs weigh (that of ½ q̇ᵀq̇ where none does), and
        likewise over the pose error.

        Parameters
        ----------
        by_q, by_qd : (S, n, size)
            ∂q/∂x and ∂q̇/∂x at the stages.
        by_error : callable
            Returns that of the pose error, (S, m, size); asked where a cost weighs it.
        """
        (stages, n, size), sampling = by_q.shape, self._grid.sampling
        curvatures = [cost.curvature(n) for cost in self._costs]
        if not any(curvatures):
            curvatures = [{1: np.eye(n)}]
        found = np.zeros((size, size))
        nodes = by_qd[sampling.nodes].reshape(len(sampling.nodes), -1)
        for curvature in curvatures:
            for order, weight in curvature.items():
                table = by_error() if order == ERROR else by_q if order == 0 else by_qd
                for first in range(0, stages, _LOT):
                    lot = slice(first, first + _LOT)
                    tangent = table[lot]
                    if order > 1:
                        operator = sampling.differentiation(order - 1)[lot]
                        tangent = (operator @ nodes).reshape(tangent.shape)
                    found += _weighted(tangent, weight, sampling.weights[lot])
        return found


def _weighted(tangent: Array, weight: Array, times: Array) -> Array:
    """Return Σ times tangentᵀ W tangent over samples, (size, size)."""
    flat = tangent.shape[0] * tangent.shape[1], tangent.shape[2]
    # Near singular poses tangents may be beyond all numbers: see `inverse_metric`.
    with np.errstate(over="ignore", invalid="ignore"):
        weighted = times[:, None, None] * (weight @ tangent)
        return np.asarray(tangent.reshape(flat).T @ weighted.reshape(flat))

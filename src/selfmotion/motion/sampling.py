"""When a motion is looked at, and how it is integrated and differentiated from there."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, read_only

_STENCIL = 5


@dataclass(frozen=True, eq=False)
class Sampling:
    """Sample times with their quadrature weights, and the nodes among them.

    Attributes
    ----------
    t : (S,)
        Times [s], not decreasing.
    weights : (S,)
        Quadrature weights [s]: ∫ G dt ≈ weights · G.
    nodes : (N + 1,)
        Indices of the samples that are nodes: there each time comes once, and between them the
        motion is smooth.
    """

    t: Array
    weights: Array
    nodes: npt.NDArray[np.intp]

    def __post_init__(self) -> None:
        # Costs are handed these times.
        object.__setattr__(self, "t", read_only(self.t))

    @classmethod
    def trapezoidal(cls, t: Array) -> "Sampling":
        """Return samples that are all nodes, joined by straight lines."""
        steps = np.diff(t)
        weights = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
        return cls(t, weights, np.arange(len(t)))

    @property
    def node_times(self) -> Array:
        """Times of the nodes [s], (N + 1,)."""
        return self.t[self.nodes]

    def differentiation(self, order: int) -> Any:
        """Return the sparse matrix (S, N + 1) from values at the nodes to a derivative at samples.

        Five-point finite differences (weights of B. Fornberg, Math. Comp. 51, 1988).

        Parameters
        ----------
        order : {1, 2}
            Of the derivative.
        """
        if order not in self._operators:
            self._operators[order] = _differentiation(self.node_times, self.t, order)
        return self._operators[order]

    def node_differentiation(self, order: int) -> Any:
        """Return the rows of `differentiation` for the nodes, sparse (N + 1, N + 1)."""
        if order not in self._at_nodes:
            self._at_nodes[order] = self.differentiation(order)[self.nodes]
        return self._at_nodes[order]

    @cached_property
    def _at_nodes(self) -> dict[int, Any]:
        return {}

    @cached_property
    def _operators(self) -> dict[int, Any]:
        return {}


def _differentiation(nodes: Array, times: Array, order: int) -> Any:
    from scipy.sparse import csr_array

    count = min(_STENCIL, len(nodes))
    nearest = np.searchsorted(nodes, times) - count // 2
    first = np.clip(nearest, 0, len(nodes) - count)
    columns = first[:, None] + np.arange(count)
    weights = _fornberg(nodes[columns] - times[:, None], order)
    rows = np.repeat(np.arange(len(times)), count)
    shape = (len(times), len(nodes))
    return csr_array((weights.ravel(), (rows, columns.ravel())), shape=shape)


def _fornberg(offsets: Array, order: int) -> Array:
    """Return weights (S, k) of the derivative at 0 from values at `offsets` (S, k).

    Exact for polynomials of degree < k: a small Vandermonde system, scaled against rounding.
    """
    scale = np.abs(offsets).max(axis=1, keepdims=True)
    powers = np.arange(offsets.shape[1])
    vandermonde = (offsets / scale)[:, None, :] ** powers[None, :, None]
    target = np.zeros((len(offsets), len(powers), 1))
    target[:, order, 0] = float(np.prod(np.arange(1, order + 1))) / scale[:, 0] ** order
    return np.asarray(np.linalg.solve(vandermonde, target)[:, :, 0])

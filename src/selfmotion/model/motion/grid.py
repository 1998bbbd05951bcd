"""Samples of a motion, and the grid of times on which it is integrated."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, read_only
from selfmotion.model.motion.differences import Differences

# Relative rounding allowance, so that an exact division into steps is not rounded up.
_ROUNDING = 1e-9


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
        Indices of the samples that are nodes. Node times are distinct; the motion is smooth
        between them.
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

        Five-point finite differences; see `Differences`.

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

    found = Differences(nodes, times)
    count, width = found.weights.shape[1:]
    columns = found.first[:, None] + np.arange(width)
    rows = np.repeat(np.arange(count), width)
    return csr_array(
        (found.weights[order].ravel(), (rows, columns.ravel())), shape=(count, len(nodes))
    )


@dataclass(frozen=True, eq=False)
class Grid:
    """Steps of the classical Runge-Kutta scheme, aligned with a path's knots.

    Stages come four to a step (start, middle, middle, end), then one for the end of the motion, so
    that S = 4N + 1 for N steps.

    Attributes
    ----------
    nodes : (N + 1,)
        Start and end times of the steps [s].
    """

    nodes: Array

    @classmethod
    def aligned(cls, knots: Array, steps: int) -> "Grid":
        """Return a grid of about `steps` steps of nearly equal length, with a node at each knot."""
        longest = (knots[-1] - knots[0]) / steps * (1.0 + _ROUNDING)
        parts = [
            np.linspace(left, right, int(np.ceil((right - left) / longest)), endpoint=False)
            for left, right in pairwise(knots)
        ]
        return cls(read_only(np.append(np.concatenate(parts), knots[-1])))

    def halved(self, where: npt.NDArray[np.bool_] | None = None) -> "Grid":
        """Return the grid with all steps halved, or those of the mask `where` (N,)."""
        middles = 0.5 * self.nodes[:-1] + 0.5 * self.nodes[1:]
        cut = middles if where is None else middles[where]
        return Grid(read_only(np.sort(np.concatenate([self.nodes, cut]))))

    @property
    def steps(self) -> int:
        """Number N of steps."""
        return len(self.nodes) - 1

    @cached_property
    def node_stages(self) -> npt.NDArray[np.intp]:
        """Indices of the stages that are nodes, (N + 1,)."""
        return np.arange(len(self.nodes)) * 4

    @cached_property
    def stage_times(self) -> Array:
        """Times of the stages [s], (S,)."""
        start, end = self.nodes[:-1], self.nodes[1:]
        middle = 0.5 * (start + end)
        return np.append(np.stack([start, middle, middle, end], axis=1).ravel(), self.nodes[-1])

    @property
    def stage_steps(self) -> Array:
        """Length of the step that each stage belongs to [s], (S,); 0 for the last."""
        return np.append(np.repeat(np.diff(self.nodes), 4), 0.0)

    @cached_property
    def sampling(self) -> Sampling:
        """The stages as samples of a motion."""
        return Sampling(self.stage_times, self.weights, self.node_stages)

    def derivative(self, values: Array) -> Array:
        """Return the derivative at the nodes of a function with these values (N + 1, n) there."""
        return Differences(self.nodes)(values)[0]

    @cached_property
    def weights(self) -> Array:
        """Weights (S,) that integrate a function of the stages over time [s].

        h/6 (1, 2, 2, 1) per step: the integral is one more state of the Runge-Kutta scheme and
        shares its fourth order.
        """
        steps = np.diff(self.nodes)[:, None] / 6.0
        return np.append((steps * np.array([1.0, 2.0, 2.0, 1.0])).ravel(), 0.0)

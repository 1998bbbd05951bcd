"""Limits on costs of a problem, relative to the best motion by all its costs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, ProblemError, as_number, shown
from selfmotion.model.motion import Grid
from selfmotion.model.path import Pace, Path, Retimed, times_when
from selfmotion.planning.result import Plan
from selfmotion.problem.costs import Cost, Samples, Scaled
from selfmotion.problem.problem import Problem

# Smallest number of steps for the evaluation of costs.
_STEPS = 300
# Size of a cost that counts as none.
_SMALLEST_COST = 1e-12


@dataclass(frozen=True, eq=False)
class CostLimits:
    """Limited costs of a problem, and by which factor they may exceed those of the best motion.

    The cost of a motion depends on its pace, and faster ones cost more by their joint speeds. So
    joint paths are compared: each at the time law of the problem's own path.

    Attributes
    ----------
    problem : Problem
    costs : tuple of Cost
        Limited costs of the problem.
    factors : tuple of float
        Largest multiples, at least 1; of a negative cost, the allowed increase is this minus 1
        times its size.
    """

    problem: Problem
    costs: tuple[Cost, ...]
    factors: tuple[float, ...]

    @classmethod
    def of(cls, problem: Problem, factors: Mapping[str, float]) -> CostLimits:
        """Return the limits of costs by their kind or name.

        Raises
        ------
        ProblemError
            The problem has no such cost, or a factor is below 1.
        """
        if not isinstance(factors, Mapping):
            raise ProblemError(f"keep is {shown(factors)}, expected a factor for each kind of cost")
        limited: list[Cost] = []
        limits: list[float] = []
        for key, factor in factors.items():
            costs = [cost for cost in problem.costs if key in (cost.kind, cost.name)]
            if not costs:
                known = ", ".join(dict.fromkeys(cost.kind for cost in problem.costs))
                raise ProblemError(f"keep: the problem has no cost {shown(key)}, but {known}")
            number = as_number(factor, f"keep: {key}", least=1.0)
            limited += costs
            limits += [number] * len(costs)
        return cls(problem, tuple(limited), tuple(limits))

    def values(self, plan: Plan) -> Array:
        """Return the costs of a plan's joint path at the time law of the problem's path, (K,).

        Parameters
        ----------
        plan : Plan
            Along the problem's path, or along a `Retimed` one of it.
        """
        motion, grid = plan.trajectory, Grid.aligned(self.problem.path.knots, _STEPS)
        added_paces = _paces(plan.path)[len(_paces(self.problem.path)) :]
        t = grid.nodes
        for pace in added_paces:
            t = times_when(pace, t, np.zeros(len(t)), np.full(len(t), pace.t[-1]))
        positions = motion(motion.t[0] + np.minimum(t, motion.duration))
        q, qd = _spline_samples(grid.nodes, positions, grid.stage_times)
        samples = Samples.along(self.problem.follows, grid.sampling, q, qd)
        return np.array([samples.weights @ cost.value(samples) for cost in self.costs])

    def bounds(self, best: Array) -> Array:
        """Return the limits of the costs, (K,), if the best motion by all costs has `best`."""
        return np.asarray(best + (np.array(self.factors) - 1.0) * np.abs(best))

    def weighted(self, values: Array, weight: float) -> tuple[Cost, ...]:
        """Return the costs scaled so that each of some values (K,) becomes a weight [s]."""
        sizes = np.maximum(np.abs(values), _SMALLEST_COST)
        pairs = zip(self.costs, sizes.tolist(), strict=True)
        return tuple(Scaled(cost, weight / size) for cost, size in pairs)


def _paces(path: Path) -> list[Pace]:
    """Return the paces of a path that is retimed, maybe again and again, the first one first."""
    return [*_paces(path.original), path.pace] if isinstance(path, Retimed) else []


def _spline_samples(nodes: Array, q: Array, t: Array) -> tuple[Array, Array]:
    """Return q and q̇ at times t (S,) of the cubic spline through q (N, n) at nodes (N,)."""
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(nodes, q)
    return np.asarray(spline(t)), np.asarray(spline(t, 1))

"""What a joint path costs at the time law of its path, which the fastest motion may not pass."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, ProblemError, as_number, shown
from selfmotion.costs import Cost, Samples, Scaled
from selfmotion.motion import Grid
from selfmotion.path import Pace, Path, Retimed, times_when
from selfmotion.problem import Problem
from selfmotion.result import Plan

# Steps at which costs are measured, at least.
_STEPS = 300


@dataclass(frozen=True, eq=False)
class KeptCosts:
    """Costs of a problem, and by which factor a motion may cost more than the best by all costs.

    What a motion costs depends on its pace, and all faster ones cost more by their joint speeds. So
    joint paths are compared: each costs what it does at the time law of the problem's own path.

    Attributes
    ----------
    problem : Problem
    costs : tuple of Cost
        Those of the problem's that are kept.
    factors : tuple of float
        How many times as much they may be, at least 1; of what is negative, by how many times its
        size less 1 it may rise.
    """

    problem: Problem
    costs: tuple[Cost, ...]
    factors: tuple[float, ...]

    @classmethod
    def of(cls, problem: Problem, keep: Mapping[str, float]) -> "KeptCosts":
        """Return those of kinds or names, ProblemError where the problem has no such cost."""
        if not isinstance(keep, Mapping):
            raise ProblemError(f"keep is {shown(keep)}, expected a factor for each kind of cost")
        costs, factors = [], []
        for key, factor in keep.items():
            found = [item for item in problem.costs if key in (item.kind, item.name)]
            if not found:
                known = ", ".join(dict.fromkeys(item.kind for item in problem.costs))
                raise ProblemError(f"keep: the problem has no cost {shown(key)}, but {known}")
            number = as_number(factor, f"keep: {key}", least=1.0)
            costs += found
            factors += [number] * len(found)
        return cls(problem, tuple(costs), tuple(factors))

    def values(self, plan: Plan) -> Array:
        """Return what the joint path of a plan costs at the time law of the problem's path, (K,).

        Parameters
        ----------
        plan : Plan
            Along the problem's path, or along a `Retimed` one of it.
        """
        motion, grid = plan.trajectory, Grid.aligned(self.problem.path.knots, _STEPS)
        paces = _paces(plan.path)
        t = grid.nodes
        for pace in paces[len(_paces(self.problem.path)) :]:
            t = times_when(pace, t, np.zeros(len(t)), np.full(len(t), pace.t[-1]))
        passed = motion(motion.t[0] + np.minimum(t, motion.duration))
        q, qd = _by(grid.nodes, passed, grid.stage_times)
        samples = Samples.along(self.problem.follows, grid.sampling, q, qd)
        return np.array([samples.weights @ cost.value(samples) for cost in self.costs])

    def bounds(self, best: Array) -> Array:
        """Return what costs may be, (K,), where the motion that is best by them costs `best`."""
        return np.asarray(best + (np.array(self.factors) - 1.0) * np.abs(best))

    def weighted(self, costs: Array, weight: float) -> tuple[Cost, ...]:
        """Return the costs so that each counts about as a weight [s], of what they are."""
        sizes = np.maximum(np.abs(costs), 1e-12)
        each = zip(self.costs, sizes.tolist(), strict=True)
        return tuple(Scaled(cost, weight / size) for cost, size in each)


def _paces(path: Path) -> list[Pace]:
    """Return the paces of a path that is retimed, maybe again and again, the first one first."""
    return [*_paces(path.original), path.pace] if isinstance(path, Retimed) else []


def _by(nodes: Array, q: Array, t: Array) -> tuple[Array, Array]:
    """Return a motion through q (N, n) at nodes (N,), and its velocities, at times t (S,)."""
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(nodes, q)
    return np.asarray(spline(t)), np.asarray(spline(t, 1))

"""Runs that several parts of the study share, cached, and their objectives."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.motion import Grid, PolynomialNullMotion
from selfmotion.paper.baselines import LagrangianOptimum, plan_by, start_of
from selfmotion.paper.study.published import (
    PublishedFunction,
    flops_per_rate,
    published_null_motion,
    published_optimizer,
)
from selfmotion.planning.formulation import on_path
from selfmotion.planning.optimise import LineSearch, Minimum, QuasiNewton, inverse_metric
from selfmotion.planning.paper import Objective
from selfmotion.planning.planner import plan
from selfmotion.planning.result import Plan
from selfmotion.planning.rollout import MinimumNormMotion
from selfmotion.problem.costs import Cost, InverseManipulability, JointVelocity
from selfmotion.problem.problem import Problem, sample_problem


@dataclass(frozen=True)
class Scale:
    """Size of the study.

    Attributes
    ----------
    name : str
        In the report's head.
    starts : int
        Random starts for local and global minima.
    chains : tuple of int
        Joints of the planar chains.
    published_mu : tuple of float
        μ for which the published scheme runs as well.
    deltas : tuple of float
        δ of the differences, smallest last.
    closed_paths : bool
        Whether the other works also run there and back, and on a Panda's circle.
    """

    name: str
    starts: int
    chains: tuple[int, ...]
    published_mu: tuple[float, ...]
    deltas: tuple[float, ...]
    closed_paths: bool

    @classmethod
    def full(cls) -> "Scale":
        """Return the whole study: minutes."""
        deltas = tuple(10.0**-k for k in range(2, 11))
        return cls("full", 64, tuple(range(3, 13)), (1.0, 50.0, 1000.0), deltas, True)

    @classmethod
    def reduced(cls) -> "Scale":
        """Return the size for tests: the same claims with less work."""
        return cls("reduced", 6, (3, 5, 8), (1.0,), (1e-2, 1e-4, 1e-9), False)


def bind(problem: Problem, steps: int = 64) -> Objective:
    """Return the objective of a problem on a grid of about `steps` Runge-Kutta steps."""
    grid = Grid.aligned(problem.path.knots, steps)
    formulation = on_path(problem)
    at_zero = MinimumNormMotion.on(formulation, start_of(problem), grid)
    return Objective.of(formulation, at_zero)


def optimum(
    problem: Problem,
    x0: Array | None = None,
    *,
    metric: bool = True,
    sigma: float = 0.9,
    tolerance: float = 1e-12,
    max_iterations: int = 200,
    unbounded: float = 1e8,
    steps: int = 64,
) -> tuple[Objective, Minimum]:
    """Minimise with exact gradients from `x0`, with H0 from the Gauss-Newton matrix or = I."""
    objective = bind(problem, steps)
    x = np.zeros(objective.size)
    # The matrix is that of the motion at x = 0, wherever the search starts.
    h = inverse_metric(objective.metric(x)) if metric else None
    optimizer = QuasiNewton(
        tolerance=tolerance,
        max_iterations=max_iterations,
        line_search=LineSearch(sigma=sigma),
        unbounded=unbounded,
        initial_metric="gauss-newton" if metric else "identity",
    )
    return objective, optimizer.minimize(objective, x if x0 is None else x0, h)


# Steps of the Runge-Kutta grid for costs in tables: right to seven digits.
FINE = 256


@dataclass(frozen=True, eq=False)
class PublishedRun:
    """The published scheme on one problem.

    Attributes
    ----------
    minimum : Minimum
    evaluations, jacobian_evaluations : int
        Including those of differences.
    flops : float
        Floating-point operations, by `flops_per_rate`.
    """

    problem: Problem
    minimum: Minimum
    evaluations: int
    jacobian_evaluations: int

    @property
    def flops(self) -> float:
        """Floating-point operations of the Jacobian evaluations, eq. 4 around them included."""
        problem = self.problem
        each = flops_per_rate(problem.robot.dof, problem.task.dimension, 3)
        return float(self.jacobian_evaluations * each)

    @property
    def iterations(self) -> int:
        """Iterations of the optimiser."""
        return len(self.minimum.history) - 1


@dataclass(frozen=True, eq=False)
class Result:
    """A motion of the sample problem, integrated finely.

    Attributes
    ----------
    terms : dict
        Contribution of each cost.
    smallest_w : float
        Smallest manipulability √det(JJᵀ) along the path [m²].
    t, q, qd : arrays
        At the nodes.
    """

    terms: dict[str, float]
    smallest_w: float
    t: Array
    q: Array
    qd: Array

    @property
    def cost(self) -> float:
        """F."""
        return sum(self.terms.values())


def finely(problem: Problem, x: Array) -> Result:
    """Return the motion of coefficients `x`, on a grid fine enough to be the truth."""
    objective = bind(problem, FINE)
    terms = objective.terms(x)
    samples = objective.rollout.samples()
    nodes = objective.rollout.grid.node_stages
    smallest = float(np.sqrt(max(samples.gram_determinant.min(), 0.0)))
    q, qd = samples.q[nodes].copy(), samples.qd[nodes].copy()
    return Result(terms, smallest, objective.rollout.grid.nodes, q, qd)


def run_published(problem: Problem, *, max_iterations: int = 60) -> PublishedRun:
    """Optimise from x = 0 by the scheme as published."""
    function = PublishedFunction(problem)
    optimizer = published_optimizer(max_iterations)
    minimum = optimizer.minimize(function, np.zeros(function.size))
    return PublishedRun(problem, minimum, function.evaluations, function.jacobian_evaluations)


class Context:
    """The sample problem and the runs on it that more than one part needs.

    Parameters
    ----------
    scale : Scale
    """

    def __init__(self, scale: Scale) -> None:
        self.scale = scale
        self.problem = sample_problem(null_motion=published_null_motion())
        self._published: dict[float, PublishedRun] = {}

    def with_costs(self, costs: Sequence[Cost], duration: float = 1.0) -> Problem:
        """Return the sample problem with other costs, or there and back."""
        base = sample_problem(duration=duration, null_motion=published_null_motion())
        return replace(base, costs=tuple(costs))

    def published(self, mu: float = 1.0) -> PublishedRun:
        """Return the published scheme's run on eq. 12 with that μ."""
        if mu not in self._published:
            costs = (JointVelocity(), InverseManipulability(mu))
            self._published[mu] = run_published(self.with_costs(costs))
        return self._published[mu]

    @cached_property
    def minimum_norm(self) -> Result:
        """The motion at x = 0."""
        return finely(self.problem, np.zeros(12))

    @cached_property
    def twelve(self) -> Minimum:
        """The optimum of the paper's 12 coefficients, by exact gradients."""
        return optimum(self.problem, sigma=0.1)[1]

    @cached_property
    def best(self) -> Result:
        """The motion of `twelve`."""
        return finely(self.problem, self.twelve.x)

    @cached_property
    def plan(self) -> Plan:
        """Our plan, 4 coefficients."""
        return plan(sample_problem())

    @cached_property
    def lagrangian(self) -> Plan:
        """The optimum over all joint motions, free end."""
        return plan_by(sample_problem(), LagrangianOptimum(self.plan))

    @cached_property
    def expansion(self) -> Result:
        """The optimum of a 32-term expansion of the null motion."""
        problem = sample_problem(null_motion=PolynomialNullMotion(31))
        return finely(problem, optimum(problem, steps=FINE)[1].x)

"""What the parts of the study share: objectives on a given grid, and sizes of the run."""

from dataclasses import dataclass

import numpy as np

from selfmotion.baselines import start_of
from selfmotion.basics import Array
from selfmotion.motion import Grid
from selfmotion.optimise import LineSearch, Minimum, QuasiNewton, inverse_metric
from selfmotion.paper import Objective, StillMotion
from selfmotion.problem import Problem


@dataclass(frozen=True)
class Scale:
    """How much of the study is run.

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
        """Return what the tests run: the same claims on less work."""
        return cls("reduced", 6, (3, 5, 8), (1.0,), (1e-2, 1e-4, 1e-9), False)


def bind(problem: Problem, steps: int = 64) -> Objective:
    """Return the objective of a problem on a grid of about `steps` Runge-Kutta steps."""
    grid = Grid.aligned(problem.path.knots, steps)
    return Objective.of(problem, StillMotion.on(problem, start_of(problem), grid))


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
    # The matrix is that of the motion at x = 0, wherever the search begins.
    h = inverse_metric(objective.metric(x)) if metric else None
    optimizer = QuasiNewton(
        tolerance=tolerance,
        max_iterations=max_iterations,
        line_search=LineSearch(sigma=sigma),
        unbounded=unbounded,
        initial_metric="gauss-newton" if metric else "identity",
    )
    return objective, optimizer.minimize(objective, x if x0 is None else x0, h)

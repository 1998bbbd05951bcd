"""The published method from one start, without the planner around it."""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array, Counts
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.optimise import Callback, Optimizer, QuasiNewton
from selfmotion.planning.paper import MethodInputs, PublishedMotion
from selfmotion.planning.rollout import MinimumNormMotion
from selfmotion.problem.constraints import BoundConstraint


def solve(
    formulation: Formulation,
    minimum_norm: MinimumNormMotion,
    *,
    free: bool = False,
    ends: Sequence[BoundConstraint] = (),
    optimizer: Optimizer | None = None,
    counts: Counts | None = None,
    most: int | None = None,
    callback: Callback | None = None,
    x0: Array | None = None,
) -> PublishedMotion:
    """Return the optimum around a motion at x = 0, on grids that are halved until it converges.

    At most `most` evaluations of F, from the decision vector `x0` where that is a motion; other
    arguments are those of `MethodInputs`.
    """
    counts = Counts() if counts is None else counts
    limit = None if most is None else counts.evaluations + most
    optimizer = QuasiNewton() if optimizer is None else optimizer
    method = MethodInputs(
        formulation, minimum_norm, free, tuple(ends), optimizer, counts, limit, callback
    )
    objective = method.on(minimum_norm.grid)
    x = np.zeros(objective.size)
    if x0 is not None and np.isfinite(objective.value(x0)):
        x = np.array(x0, dtype=np.float64)
    return PublishedMotion(method, objective, x).converged()

"""Which of many starts are worth a closer look: motions without self-motion, all at once."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from selfmotion.basics import Array
from selfmotion.costs import Samples
from selfmotion.engine import Conditions
from selfmotion.motion import Grid, Sampling
from selfmotion.planning.apart import Apart, unlike
from selfmotion.planning.settings import ONE_VALLEY
from selfmotion.problem import Problem
from selfmotion.search import carried


def most_promising(
    problem: Problem, starts: Sequence[Array], grid: Grid, apart: Apart
) -> list[Array]:
    """Return starts (n,), the best first, and those last that are near a better one.

    By what the motions cost that follow the path from them without self-motion, and by how much
    these violate: the start of one that is near a better one moves there by itself. Last of all
    come those from which the path cannot be followed like that.

    Parameters
    ----------
    problem : Problem
    starts : sequence of (n,)
    grid : Grid
        At whose nodes to look, few.
    apart : callable
        How far motions are from each other.
    """
    motions, arrived = carried(problem.follows, np.array(starts), grid.nodes)
    merits = np.full(len(starts), np.inf)
    twists = problem.follows.twists(grid.nodes)
    sampling = Sampling.trapezoidal(grid.nodes)
    for k in np.flatnonzero(arrived):
        merits[k] = _merit(problem, motions[k], twists, grid, sampling)
    order = np.argsort(merits, kind="stable")
    followed = order[arrived[order]]
    valleys, slopes = unlike(motions, followed, apart, ONE_VALLEY)
    return [starts[k] for k in (*valleys, *slopes, *order[~arrived[order]].tolist())]


def _merit(problem: Problem, q: Array, twists: Array, grid: Grid, sampling: Sampling) -> float:
    """Return what a motion q (N, n) along the path costs, and more where it violates something.

    `twists` (N, m) are those of the path at the grid's nodes, which are the samples.
    """
    still = Samples.along(problem.follows, sampling, q, np.zeros_like(q))
    J = still.task_jacobian
    gram = J @ J.transpose(0, 2, 1)
    try:
        qd = np.einsum("smn,sm->sn", J, np.linalg.solve(gram, twists[..., None])[..., 0])
    except np.linalg.LinAlgError:
        return np.inf
    samples = replace(still, qd=qd)
    costs = [float(sampling.weights @ cost.value(samples)) for cost in problem.all_costs]
    bound = problem.bind_constraints(q[0], q[-1], apart=False)
    violated = Conditions(bound, grid).penalty(samples)
    total = sum(costs)
    return total + max(abs(total), 1e-3) * violated

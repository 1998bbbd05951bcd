"""Which of many starts are worth a closer look: motions without self-motion, all at once."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.constraints import penalised
from selfmotion.costs import Samples
from selfmotion.motion import Sampling
from selfmotion.planning.apart import Apart, unlike
from selfmotion.planning.settings import ONE_VALLEY
from selfmotion.problem import Problem


def most_promising(
    problem: Problem,
    starts: Sequence[Array],
    motions: Array,
    arrived: Flags,
    t: Array,
    apart: Apart,
) -> list[int]:
    """Return numbers of starts, the best first, and those last that are near a better one.

    By what the motions cost that follow the path from them without self-motion, and by how much
    these violate: the start of one that is near a better one moves there by itself. Last of all
    come those from which the path cannot be followed like that.

    Parameters
    ----------
    problem : Problem
    starts : sequence of (n,)
    motions : (K, N, n)
        The motions from them, at few times t (N,) [s].
    arrived : (K,)
        Which of them follow the path to its end.
    apart : callable
        How far motions are from each other.
    """
    merits = np.full(len(starts), np.inf)
    twists = problem.follows.twists(t)
    sampling = Sampling.trapezoidal(t)
    for k in np.flatnonzero(arrived):
        merits[k] = _merit(problem, motions[k], twists, sampling)
    order = np.argsort(merits, kind="stable")
    followed = order[arrived[order]]
    valleys, slopes = unlike(motions, followed, apart, ONE_VALLEY)
    return [*valleys, *slopes, *order[~arrived[order]].tolist()]


def _merit(problem: Problem, q: Array, twists: Array, sampling: Sampling) -> float:
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
    return penalised(sum(costs), bound, samples)

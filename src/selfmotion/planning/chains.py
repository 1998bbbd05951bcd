"""Motions from the best chains of configurations over all self-motions.

The shortest chain is a motion of nodes at once, where length is all that is asked for.
"""

from collections.abc import Callable, Sequence

import numpy as np

from selfmotion.basics import Array, Flags, NoSequenceError, Progress
from selfmotion.constraints import BoundConstraint
from selfmotion.motion import Grid
from selfmotion.nodes import NodeGrid, NodeMotion
from selfmotion.optimise import Status
from selfmotion.planning.candidate import Candidate
from selfmotion.planning.effort import Effort
from selfmotion.planning.grids import is_on_nodes
from selfmotion.planning.planner import Planner
from selfmotion.planning.settings import CHAIN_ROUNDS, DEARER, DEARER_CHAIN, FINER_CHAIN
from selfmotion.planning.solutions import NodeSolution
from selfmotion.problem import Problem
from selfmotion.search import LAST_SMOOTHINGS, SequenceGuide, asks_length, shortest_along

# What a joint at rest takes of a velocity that is lacking, where the fastest takes 1; and where all
# are as slow as this [rad/s or m/s], none is.
_LEAST, _STILL = 1e-2, 1e-9
# Limits are looked at so often between two nodes.
_LOOKS = 16

_Searched = Callable[[Problem, np.random.Generator | int, Progress], list[SequenceGuide]]


def optimise_sequences(planner: Planner, searched: _Searched, *, chosen: bool) -> None:
    """Search, and optimise from the best sequences, one after another; note a search in vain.

    What is found is compared with what stands, and `chosen` only if it may be.
    """
    try:
        planner.sequences = searched(planner.problem, planner.search.rng, planner.progress)
    except NoSequenceError as error:
        planner.failure = error
        planner.notes.append(f"global search: {error}")
    begun: list[Candidate] = []
    for number, guide in enumerate(planner.sequences, 1):
        planner.progress("refining sequence", number, len(planner.sequences))
        candidate = planner.begin(guide.start, free=True, guide=guide)
        if candidate is None or (begun and _is_hopeless(planner, guide, candidate, begun[0])):
            continue
        found = along_chain(planner.problem, candidate.effort, guide, candidate.constraints)
        if found is not None:
            candidate.take(found)
        if begun and begun[0].is_of_chain and not candidate.is_of_chain:
            continue
        planner.polish(candidate, chosen=chosen)
        if planner.is_over:
            return
        begun = sorted([*begun, candidate], key=Candidate.score)
    if begun:
        planner.rival = begun[0]


def _is_hopeless(
    planner: Planner, guide: SequenceGuide, candidate: Candidate, best: Candidate
) -> bool:
    """Whether a sequence is much dearer than the best, and costs more than what there is.

    Optimising gains some percent on a sequence.
    """
    if best.violations:
        return False
    least = planner.sequences[0].sequence.cost
    share = DEARER_CHAIN if best.is_of_chain else DEARER
    dearer = guide.sequence.cost > least + (share - 1.0) * abs(least)
    return dearer and candidate.solution.merit() > best.score()[-1]


def along_chain(
    problem: Problem,
    effort: Effort,
    guide: SequenceGuide,
    constraints: Sequence[BoundConstraint],
) -> NodeSolution | None:
    """Return the motion through the shortest chain near a sequence; None where it will not do.

    Where length is all that is asked for, joints rest and start again all over the path: a motion
    of few nodes cannot, and Newton's method has no use for second derivatives of kinks. The chain
    is at its optimum already, so that it only needs velocities.
    """
    if not is_on_nodes(problem, effort) or not asks_length(problem):
        return None
    if any(item.equality for item in constraints):
        # The search's sequences know nothing of given ends.
        return None
    t, q = guide.sequence.t, guide.sequence.q
    finer = Grid.aligned(problem.knots, FINER_CHAIN * len(t))
    for number in range(CHAIN_ROUNDS):
        # A few nodes more change little.
        stages = LAST_SMOOTHINGS[2:] if number else LAST_SMOOTHINGS
        found = shortest_along(problem, t, q, finer.nodes, stages)
        if found is None:
            return None
        t, q = found
        grid = NodeGrid(problem, t, constraints, free=True, counts=effort.counts)
        motion = _through(grid, q)
        if motion is None:
            return None
        broken = motion.broken_between() | _beyond_limits(motion)
        if not broken.any():
            none = np.zeros(len(motion.h))
            return NodeSolution(motion, Status.PRECISION, none, is_chain=True)
        finer = Grid(t).halved(np.convolve(broken, np.ones(3), "same") > 0.0)
    return None


def _beyond_limits(motion: NodeMotion) -> Flags:
    """Return on which intervals a joint passes a limit, also for a moment, (N,)."""
    asked, t = motion.grid.problem.envelope, motion.grid.t
    looks = (t[:-1, None] + np.diff(t)[:, None] * np.arange(_LOOKS) / _LOOKS).ravel()
    q, qd = motion.trajectory(looks), motion.trajectory(looks, 1)
    beyond = (q < asked.lower) | (q > asked.upper) | (np.abs(qd) > asked.speed)
    return np.asarray(beyond.reshape(len(t) - 1, -1).any(axis=1))


def _through(grid: NodeGrid, q: Array) -> NodeMotion | None:
    """Return the motion through nodes q (K, n), with smooth velocities."""
    from scipy.interpolate import PchipInterpolator

    # Monotone cubics pass no limit that the nodes keep.
    near = PchipInterpolator(grid.t, q).derivative()(grid.t)
    motion = grid.near(q, near)
    return motion and grid.near(q, _resting(motion, near))


def _resting(motion: NodeMotion, near: Array) -> Array:
    """Return q̇ on the path that is nearest to another one, `near` (K, n), in what rests there.

    What this is off the path is left to the joints that move, so that others go on resting.
    """
    share = np.abs(near) / np.maximum(np.abs(near).max(axis=1, keepdims=True), _STILL)
    rows = motion.grid.problem.follows.jacobians(motion.place.q)
    lack = np.einsum("kmn,kn->km", rows, motion.place.qd - near)
    shared = np.maximum(share, _LEAST)[:, :, None] * rows.transpose(0, 2, 1)
    return np.asarray(near + (shared @ np.linalg.solve(rows @ shared, lack[:, :, None]))[:, :, 0])

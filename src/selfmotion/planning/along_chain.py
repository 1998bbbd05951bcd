"""The shortest chain of the search as a motion of nodes, where that keeps the conditions."""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.constraints import BoundConstraint
from selfmotion.motion import Grid
from selfmotion.nodes import NodeGrid, NodeMotion
from selfmotion.optimise import Status
from selfmotion.planning.effort import Effort
from selfmotion.planning.for_nodes import is_on_nodes
from selfmotion.planning.on_nodes import MotionOnNodes
from selfmotion.planning.settings import CHAIN_ROUNDS, FINER_CHAIN
from selfmotion.problem import Problem
from selfmotion.search import LAST_SMOOTHINGS, SequenceGuide, asks_length, shortest_along

# What a joint at rest takes of a velocity that is lacking, where the fastest takes 1; and where all
# are as slow as this [rad/s or m/s], none is.
_LEAST, _STILL = 1e-2, 1e-9
# Limits are looked at so often between two nodes.
_LOOKS = 16


def along_chain(
    problem: Problem,
    effort: Effort,
    guide: SequenceGuide,
    constraints: Sequence[BoundConstraint],
) -> MotionOnNodes | None:
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
            return MotionOnNodes(motion, Status.PRECISION, none, is_chain=True)
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

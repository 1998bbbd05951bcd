"""The nodes of a problem: which ones it has, at what times, and how many at most."""

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.motion import FreeNullMotion, Grid
from selfmotion.planning.nodes import NodeMotion, rest_times
from selfmotion.planning.planner.effort import Effort
from selfmotion.problem.problem import Problem

# Intervals of the first nodes, and so many for each time that the tool goes as far as the arm
# reaches.
_FIRST_INTERVALS = 16
# The way of each piece of the path is measured through so many points in all. A piece has as many
# intervals as its way is long, where it would else have so many times fewer.
_WAY_LOOKS, _SHORT_OF_NODES = 200, 4.0
# More of them where self-motions start and stop: this share of the duration from there, and so many
# times as far.
_STARTING, _FARTHER = 0.01, 3.0
# Nodes of Newton's method: at most so many for each stretch of the path on which it is smooth.
_MOST_NODES = 1024
# Steps of the rough motions.
_ROUGH_STEPS = 12
# Costs that differ by less than this share are worth the same, and a motion whose cost is known to
# this tells what its start is worth. What saves less than the second share saves nothing.
ABOUT_AS_GOOD, NOTHING = 1e-2, 1e-4
# Where a condition is not kept yet, each unit of it counts as so many times the cost.
UNKEPT = 10.0


def is_published(problem: Problem, effort: Effort) -> bool:
    """Whether the published method is asked for: by a null motion, an optimiser, or damping."""
    own = isinstance(problem.null_motion, FreeNullMotion) and effort.optimizer is None
    return not own or problem.damping is not None


def is_on_nodes(problem: Problem, effort: Effort) -> bool:
    """Whether a problem is optimised on nodes: by default, where there is a self-motion."""
    follows = problem.follows
    free = follows.redundancy == problem.robot.dof - follows.dimension > 0
    return free and not is_published(problem, effort)


def most_nodes(problem: Problem) -> int:
    """Return how many nodes are as many as a path may need: more, the longer it is."""
    return int(_MOST_NODES * (len(problem.knots) + problem.way_in_reaches))


def first_nodes(problem: Problem) -> Array:
    """Return the times of the nodes to begin with, (N + 1,)."""
    steps = int(np.ceil(_FIRST_INTERVALS * max(1.0, problem.way_in_reaches)))
    t = _with_short_pieces(problem, Grid.aligned(problem.knots, steps).nodes, steps)
    return with_starts(problem, t, 1.0)


def with_starts(problem: Problem, t: Array, quick: float) -> Array:
    """Return times of nodes with more of them where self-motions start and stop.

    Where the arm rests they do so in the share `quick` of the usual time, and in that where a joint
    begins or ends to be held.
    """
    duration = problem.path.duration
    for times, share in ((rest_times(problem), quick), (problem.follows.edges, 1.0)):
        least = share * _STARTING * duration
        farther = np.arange(2 + int(np.ceil(np.log(1.0 / share) / np.log(_FARTHER))))
        away = least * _FARTHER**farther
        near = np.asarray(times)[:, None] + np.concatenate([-away[::-1], away])
        inside = near[(near > 0.0) & (near < duration)]
        apart = np.abs(inside[:, None] - t).min(axis=1, initial=np.inf) > 0.5 * least
        t = np.sort(np.concatenate([t, inside[apart]]))
    return t


def _with_short_pieces(problem: Problem, t: Array, steps: int) -> Array:
    """Return times of nodes (N + 1,) with more where the tool goes a long way in little time.

    A motion beside a long wait gets nodes by its way, where these are many times as many as its
    time gives it. As ways count what the tool moves, in reaches of the arm, and what it turns.
    """
    knots, follows = np.asarray(problem.knots), problem.follows
    looks = Grid.aligned(knots, _WAY_LOOKS).nodes
    reach = problem.robot.reach if np.isfinite(problem.robot.reach) else 1.0
    counts = np.where(follows.linear > 0.0, 1.0 / reach, 1.0)
    speeds = np.linalg.norm(follows.twists(0.5 * (looks[:-1] + looks[1:])) * counts, axis=1)
    way = np.append(0.0, np.cumsum(speeds * np.diff(looks)))
    ways = np.diff(way[np.searchsorted(looks, knots)])
    wanted = steps * ways / max(float(way[-1]), np.finfo(float).tiny)
    has = np.diff(np.searchsorted(t, knots))
    few = wanted > _SHORT_OF_NODES * has
    more = [
        np.linspace(knots[k], knots[k + 1], int(np.ceil(wanted[k])), endpoint=False)
        for k in np.flatnonzero(few)
    ]
    if not more:
        return t
    return np.union1d(t, np.concatenate(more))


def rough_grid(problem: Problem) -> Grid:
    """Return the grid of rough motions."""
    # A path of many waypoints is crossed in strides: what is rough needs not stop at each.
    knots = problem.knots if len(problem.knots) <= _ROUGH_STEPS else problem.knots[[0, -1]]
    return Grid.aligned(knots, _ROUGH_STEPS)


def resolves(motion: NodeMotion) -> bool:
    """Whether a motion costs about the same on twice as many nodes."""
    finer = motion.on(motion.grid.on(Grid(motion.grid.t).halved().nodes))
    return finer is not None and abs(finer.cost - motion.cost) <= ABOUT_AS_GOOD * abs(finer.cost)

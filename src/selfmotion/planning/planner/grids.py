"""Nodes of a formulation: their times, and their largest number."""

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.follow import linear_rows, window_edges
from selfmotion.model.motion import Grid
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.nodes import NodeMotion, on_grid, rest_times
from selfmotion.planning.planner.effort import Effort

# Intervals of the first nodes for each reach of the arm that the tool moves, and at least.
_FIRST_INTERVALS = 16
# Samples of the path for the lengths of its segments.
_LENGTH_SAMPLES = 200
# A segment gets intervals in proportion to its length if its share by time is this many times less.
_SHORT_OF_NODES = 4.0
# Additional nodes where self-motions start and stop: at this share of the duration from there …
_STARTING = 0.01
# … and at this multiple.
_FARTHER = 3.0
# Largest number of nodes for each smooth segment of the path.
_MAX_NODES = 1024
# Steps of the rough motions.
_ROUGH_STEPS = 12
# Relative difference of costs that count as equal.
ABOUT_AS_GOOD = 1e-2
# Relative gain that counts as none.
NOTHING = 1e-4
# Penalty of a unit of violation, in multiples of the cost.
UNKEPT = 10.0


def is_on_nodes(formulation: Formulation, effort: Effort) -> bool:
    """Whether a formulation is optimised on nodes: by default, if it has a self-motion."""
    follows = formulation.follows
    free = follows.redundancy == follows.dof - follows.dimension > 0
    return free and effort.keeps_conditions


def most_nodes(formulation: Formulation) -> int:
    """Return the largest number of nodes of a path, by its length."""
    return int(_MAX_NODES * (len(formulation.knots) + formulation.length_in_reaches))


def first_nodes(formulation: Formulation) -> Array:
    """Return the times of the first nodes, (N + 1,)."""
    steps = int(np.ceil(_FIRST_INTERVALS * max(1.0, formulation.length_in_reaches)))
    t = _with_short_segments(formulation, Grid.aligned(formulation.knots, steps).nodes, steps)
    return with_starts(formulation, t, 1.0)


def with_starts(formulation: Formulation, t: Array, quick: float) -> Array:
    """Return times of nodes with more of them where self-motions start and stop.

    In the share `quick` of the usual time where the arm rests, and in the usual one where a joint
    starts or ends to be held.
    """
    duration = formulation.path.duration
    for times, share in (
        (rest_times(formulation), quick),
        (window_edges(formulation.follows), 1.0),
    ):
        least = share * _STARTING * duration
        farther = np.arange(2 + int(np.ceil(np.log(1.0 / share) / np.log(_FARTHER))))
        away = least * _FARTHER**farther
        near = np.asarray(times)[:, None] + np.concatenate([-away[::-1], away])
        inside = near[(near > 0.0) & (near < duration)]
        spacing = np.abs(inside[:, None] - t).min(axis=1, initial=np.inf) > 0.5 * least
        t = np.sort(np.concatenate([t, inside[spacing]]))
    return t


def _with_short_segments(formulation: Formulation, t: Array, steps: int) -> Array:
    """Return times of nodes (N + 1,) with more where the tool moves far in little time.

    A motion next to a long wait gets nodes by its length, if these are many times those by its
    time. Lengths are those of translation, in reaches of the arm, and of rotation.
    """
    knots, follows = np.asarray(formulation.knots), formulation.follows
    samples = Grid.aligned(knots, _LENGTH_SAMPLES).nodes
    reach = formulation.robot.reach if np.isfinite(formulation.robot.reach) else 1.0
    counts = np.where(linear_rows(follows) > 0.0, 1.0 / reach, 1.0)
    speeds = np.linalg.norm(follows.twists(0.5 * (samples[:-1] + samples[1:])) * counts, axis=1)
    length_at = np.append(0.0, np.cumsum(speeds * np.diff(samples)))
    lengths = np.diff(length_at[np.searchsorted(samples, knots)])
    wanted = steps * lengths / max(float(length_at[-1]), np.finfo(float).tiny)
    has = np.diff(np.searchsorted(t, knots))
    few = wanted > _SHORT_OF_NODES * has
    more = [
        np.linspace(knots[k], knots[k + 1], int(np.ceil(wanted[k])), endpoint=False)
        for k in np.flatnonzero(few)
    ]
    if not more:
        return t
    return np.union1d(t, np.concatenate(more))


def rough_grid(formulation: Formulation) -> Grid:
    """Return the grid of rough motions."""
    # Paths of many waypoints are crossed in strides: a rough motion need not stop at each.
    knots = (
        formulation.knots if len(formulation.knots) <= _ROUGH_STEPS else formulation.knots[[0, -1]]
    )
    return Grid.aligned(knots, _ROUGH_STEPS)


def resolves(motion: NodeMotion) -> bool:
    """Whether a motion costs about the same on twice as many nodes."""
    finer = on_grid(motion, motion.grid.on(Grid(motion.grid.t).halved().nodes))
    return finer is not None and abs(finer.cost - motion.cost) <= ABOUT_AS_GOOD * abs(finer.cost)

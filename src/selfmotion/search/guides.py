"""Motions worth starting from, found by the global search over self-motions."""

import itertools

import numpy as np

from selfmotion.basics import Array, Progress
from selfmotion.path import Path, Waypoints
from selfmotion.plans import Problem
from selfmotion.search.sequences import Sequence, best_sequences

# Sequences refined; the shortest among the samples is not always that of the best motion.
_COUNT = 4
# A search at fewer times than these would not follow the path, at more it would only take longer;
# in between, the path's own waypoints are taken.
_FEWEST, _MOST = 150, 400
# What the sequences keep beyond the clearance asked for, since they are only checked at waypoints.
_MARGIN = 5e-4
# The jagged chain of samples is smoothed by a spline with this many waypoints per interval.
_SMOOTHING = 5


class SequenceGuide:
    """A sequence as a smooth motion: what `Session` takes as x = 0.

    Attributes
    ----------
    sequence : Sequence
    start : (n,)
        Its first configuration.
    """

    def __init__(self, sequence: Sequence) -> None:
        from scipy.interpolate import make_lsq_spline

        t, q = sequence.t, sequence.q
        inner = np.linspace(t[0], t[-1], max(len(t) // _SMOOTHING, 2))
        knots = np.concatenate([[t[0]] * 3, inner, [t[-1]] * 3])
        self._rate = make_lsq_spline(t, q, knots).derivative()
        self.sequence = sequence
        self.start: Array = q[0]

    def __call__(self, t: Array) -> Array:
        """Return q̇ at times `t` (S,), (S, n)."""
        return np.asarray(self._rate(t))


def guides(
    problem: Problem, rng: np.random.Generator | int | None, progress: Progress
) -> list[SequenceGuide]:
    """Return guides from the best sequences over the self-motions of redundancy 1, shortest first.

    Raises
    ------
    NoSequenceError
        No chain of configurations follows the path; says where it ends and why.
    """
    robot, path, asked = problem.robot, problem.path, problem.envelope
    t = search_times(path)
    step = np.minimum(asked.speed * np.diff(t)[:, None], np.pi)
    sequences = best_sequences(
        robot,
        path,
        problem.task,
        t,
        lower=asked.lower,
        upper=asked.upper,
        largest_step=step,
        bodies=[(model, distance + _MARGIN) for model, distance in asked.bodies],
        count=_COUNT,
        rng=0 if rng is None else rng,
        progress=progress,
    )
    return [SequenceGuide(sequence) for sequence in sequences]


def search_times(path: Path) -> Array:
    """Return the times (W,) [s] at which configurations are searched for.

    The path's waypoints where it has some: without those that follow too soon upon another one,
    and with more between those that are far apart.
    """
    own = path.waypoint_times if isinstance(path, Waypoints) else np.array([0.0, path.duration])
    shortest, longest = path.duration / _MOST, path.duration / _FEWEST
    kept = [0.0]
    for time in own[1:-1]:
        if time - kept[-1] >= shortest and path.duration - time >= shortest:
            kept.append(float(time))
    kept.append(path.duration)
    pieces = [
        np.linspace(first, last, int(np.ceil((last - first) / longest)), endpoint=False)
        for first, last in itertools.pairwise(kept)
    ]
    return np.concatenate([*pieces, kept[-1:]])

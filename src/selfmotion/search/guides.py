"""Motions worth starting from, found by the global search over self-motions."""

import itertools
from typing import Any

import numpy as np

from selfmotion.basics import Array, Progress
from selfmotion.costs import PathLength
from selfmotion.path import Path
from selfmotion.problem import Problem
from selfmotion.search.measures import measure_of
from selfmotion.search.sampled import sampled_sequences
from selfmotion.search.sequences import Sequence, best_sequences
from selfmotion.search.settings import (
    FEWEST,
    FEWEST_OF_CURVES,
    MARGIN,
    MOST,
    PATH_LOOKS,
    REFINED,
    SMOOTHING,
    STRIDE,
    TURN,
)
from selfmotion.task import log3


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
        # Where samples are dense in time, so are knots.
        inner = np.append(t[:-SMOOTHING:SMOOTHING], t[-1])
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
    """Return guides from the best sequences over the self-motions, by the problem's own costs.

    Raises
    ------
    NoSequenceError
        No chain of configurations follows the path; says where it ends and why.
    """
    follows, asked = problem.follows, problem.envelope
    t = waypoint_times(problem)
    step = np.minimum(asked.speed * np.diff(t)[:, None], np.pi)
    options: dict[str, Any] = {
        "lower": asked.lower,
        "upper": asked.upper,
        "largest_step": step,
        "bodies": [(model, distance + MARGIN) for model, distance in asked.bodies],
        "count": REFINED,
        "measure": measure_of(problem.follows, problem.costs, t, _weights(problem)),
        "rng": 0 if rng is None else rng,
        "progress": progress,
    }
    if has_curves(problem):
        sequences = best_sequences(follows, t, **options)
    else:
        weights = _weights(problem)
        sequences = sampled_sequences(follows, t, weights=weights, **options)
    return [SequenceGuide(sequence) for sequence in sequences]


def has_curves(problem: Problem) -> bool:
    """Whether the self-motions of a problem are curves."""
    return problem.follows.redundancy == 1


def waypoint_times(problem: Problem) -> Array:
    """Return times (W,) [s] at which to search for a problem's configurations."""
    return search_times(problem.path, FEWEST_OF_CURVES if has_curves(problem) else FEWEST)


def search_times(path: Path, fewest: int) -> Array:
    """Return times (W,) [s] at which to search for configurations, as the tool moves on."""
    t = np.linspace(0.0, path.duration, PATH_LOOKS)
    tool = path.samples(t)
    moved = np.linalg.norm(np.diff(tool.translation, axis=0), axis=1) / STRIDE
    turned = np.array([np.linalg.norm(log3(a.T @ b)) for a, b in itertools.pairwise(tool.rotation)])
    travel = np.concatenate([[0.0], np.cumsum(moved + turned / TURN)])
    # Where the tool stands still, time counts, so that there is always one time after another.
    count = int(np.clip(np.ceil(travel[-1]), fewest, MOST))
    travel += t * (1e-3 * count / path.duration)
    times = np.interp(np.linspace(0.0, travel[-1], count + 1), travel, t)
    times[-1] = path.duration
    return np.asarray(times)


def _weights(problem: Problem) -> Array:
    """Return what a unit of each joint counts, (n,): as the path's length does, if it is a cost."""
    for cost in problem.costs:
        if isinstance(cost, PathLength) and cost.joint_weights is not None:
            return np.asarray(cost.joint_weights, dtype=np.float64)
    return problem.robot.joint_weights

"""How far the tool is off its path at any time: a bound, not only samples.

Between the trajectory's samples, the path's own marks and the ends of relaxed windows, the
deviation of the tool from the path is smooth. On each such interval it is measured at 2k + 1
points; the polynomial through every other of them predicts the rest, and the largest miss r of
these predictions bounds how far the polynomial through all points is off between them (its own
error is smaller by the order of two further halvings). The bound is the largest value of that
polynomial at 33 points, plus what it may rise by between these, plus r. Intervals on which it does
not decide are halved.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, ProblemError
from selfmotion.certificate.deviation import deviation_from, deviation_size, excess
from selfmotion.certificate.findings import Extreme, Tolerance
from selfmotion.certificate.interpolation import SAG, stencil
from selfmotion.motion import Trajectory
from selfmotion.path import Path
from selfmotion.robot import RobotModel
from selfmotion.task import Relaxation, Task

# Points per interval, where there are many intervals and where not.
_FEW, _MANY, _CROWD = 5, 9, 4096
# No joint moves more than this [rad or m] in one interval: the deviation is smooth on its scale.
_TRAVEL = 0.2
# Where joints turn farther from one sample to the next [rad or m], the path is not looked for.
_WILD = 200.0
# An interval is halved this many times before it counts as undecided.
_DEPTH = 12
# Marks nearer to each other than this share of the duration are one.
_SAME = 1e-12


@dataclass(frozen=True, eq=False)
class PathCheck:
    """What is known of a motion's errors.

    Attributes
    ----------
    position, rotation : Extreme
        Bounds of the errors beyond what is relaxed [m], [rad], and about when they are largest.
    deviations : tuple of Extreme
        Bounds of the deviation of each relaxation's rows.
    undecided : tuple of (float, float)
        Intervals [s] on which the measurements do not settle.
    samples : int
        How many poses were looked at.
    """

    position: Extreme
    rotation: Extreme
    deviations: tuple[Extreme, ...]
    undecided: tuple[tuple[float, float], ...]
    samples: int


class _Bounds(NamedTuple):
    """For I intervals: bounds of 2 + R quantities, about when, and the errors measured."""

    values: Array
    times: Array
    measured: Array


def bound_errors(
    robot: RobotModel,
    path: Path,
    task: Task,
    trajectory: Trajectory,
    tolerance: Tolerance,
    relaxations: Sequence[Relaxation],
) -> PathCheck:
    """Bound the errors of a motion; parameters as in `certify`."""
    _check_times(path, trajectory)
    allowed = np.array([tolerance.position, tolerance.rotation])
    edges = _edges(path, trajectory, relaxations)
    pending = np.stack([edges[:-1], edges[1:]], axis=1)
    count = _MANY if len(pending) <= _CROWD else _FEW
    width = 2 + len(relaxations)
    worst = [Extreme(0.0, float(edges[0]), "")] * width
    samples = 0
    for depth in range(_DEPTH + 1):
        found = _bounds(robot, path, task, trajectory, relaxations, pending, count)
        samples += len(pending) * (count - 1)
        # Written so that NaN settles nothing and is no small error either.
        kept = np.asarray(found.values[:, :2] <= allowed).all(axis=1)
        broken = ~np.asarray(found.measured <= allowed).all(axis=1)
        unsettled = ~(kept | broken)
        done = ~unsettled if depth < _DEPTH else np.ones(len(pending), dtype=bool)
        worst = [
            _larger(one, found.values[done, k], found.times[done, k]) for k, one in enumerate(worst)
        ]
        if depth == _DEPTH or not unsettled.any():
            break
        middle = pending[unsettled].mean(axis=1)
        halves = [pending[unsettled, 0], middle, middle, pending[unsettled, 1]]
        pending = np.stack(halves, axis=1).reshape(-1, 2)
    gaps = tuple((float(a), float(b)) for a, b in [*pending[unsettled], *_wild(trajectory)])
    names = (robot.tool, robot.tool, *(item.name for item in relaxations))
    extremes = tuple(replace(one, name=name) for one, name in zip(worst, names, strict=True))
    return PathCheck(extremes[0], extremes[1], extremes[2:], gaps, samples + 1)


def errors_between(
    robot: RobotModel,
    path: Path,
    task: Task,
    trajectory: Trajectory,
    relaxations: Sequence[Relaxation],
) -> Array:
    """Return the errors in the middle between samples, (N, 2) [m, rad]: for planners, no proof."""
    t = 0.5 * (trajectory.t[:-1] + trajectory.t[1:])
    in_tool_axes = any(item.in_tool_axes for item in relaxations)
    miss = deviation_from(robot, path, task, t, trajectory(t), in_tool_axes)
    return np.asarray(_quantities(miss[:, None], t[:, None], path.duration, relaxations)[:, 0, :2])


def _check_times(path: Path, trajectory: Trajectory) -> None:
    """Refuse a motion that begins before or after its path: a part of one would not be judged."""
    first = float(trajectory.t[0])
    if not abs(first) <= 1e-9 * path.duration:
        raise ProblemError(
            f"the motion begins at t = {first:.6g} s, its path at 0: take {first:.6g} s from its "
            f"times"
        )


def _wild(trajectory: Trajectory) -> Array:
    """Return the intervals (K, 2) on which some joint turns many times, which no arm does."""
    rows = np.flatnonzero(_travel(trajectory, trajectory.t) > _WILD)
    return np.stack([trajectory.t[rows], trajectory.t[rows + 1]], axis=1)


def _travel(trajectory: Trajectory, marks: Array) -> Array:
    """Return how far joints go at most between marks (M,), about, (M - 1,) [rad or m]."""
    lengths = np.diff(marks)
    inner = marks[:-1, None] + lengths[:, None] * np.linspace(0.0, 1.0, 5)
    speeds = np.abs(trajectory(np.minimum(inner.ravel(), marks[-1]), order=1)).max(axis=1)
    return np.asarray(lengths * speeds.reshape(inner.shape).max(axis=1))


def _larger(worst: Extreme, values: Array, times: Array) -> Extreme:
    """Return the worst of an extreme and values (I,) at times (I,); NaN is worse than any."""
    if not len(values):
        return worst
    k = int(np.argmax(np.where(np.isnan(values), np.inf, values)))
    if np.isnan(worst.value) or values[k] <= worst.value:
        return worst
    return Extreme(float(values[k]), float(times[k]), worst.name)


def _edges(path: Path, trajectory: Trajectory, relaxations: Sequence[Relaxation]) -> Array:
    """Return the times between which the deviation is smooth, no joint moving far, (E,)."""
    end = min(float(trajectory.t[-1]), path.duration)
    start = max(float(trajectory.t[0]), 0.0)
    windows = [time for item in relaxations for time in item.window(path.duration)]
    marks = np.concatenate([trajectory.t, path.marks, windows])
    marks = np.unique(np.clip(marks, start, end))
    gaps = np.diff(marks)
    kept = np.append(True, gaps > _SAME * path.duration)
    marks = marks[kept]
    marks[-1] = end
    travel = _travel(trajectory, marks)
    # What is wild is not settled however finely it is cut.
    travel = np.where(travel <= _WILD, travel, 0.0)
    pieces = np.maximum(np.ceil(travel / _TRAVEL), 1.0).astype(int)
    fine = [
        first + (last - first) * np.arange(number) / number
        for first, last, number in zip(marks[:-1], marks[1:], pieces, strict=True)
        if number > 1
    ]
    return np.unique(np.concatenate([marks, *fine]))


def _bounds(
    robot: RobotModel,
    path: Path,
    task: Task,
    trajectory: Trajectory,
    relaxations: Sequence[Relaxation],
    intervals: Array,
    count: int,
) -> _Bounds:
    """Measure intervals (I, 2) at `count` points each."""
    shares, predict, dense_shares, dense = stencil(count)
    starts, lengths = intervals[:, :1], np.diff(intervals, axis=1)
    t = starts + lengths * shares
    in_tool_axes = any(item.in_tool_axes for item in relaxations)
    q = trajectory(np.minimum(t, intervals[:, 1:]).ravel())
    miss = deviation_from(robot, path, task, t.ravel(), q, in_tool_axes)
    miss = miss.reshape(len(intervals), count, 6)
    left = np.abs(miss[:, 1::2] - np.einsum("ab,ibk->iak", predict, miss[:, ::2]))
    between = np.einsum("ab,ibk->iak", dense, miss)
    rest = _largest(left) + SAG * _largest(np.diff(between, 2, axis=1))
    times = starts + lengths * dense_shares
    values = _quantities(between, times, path.duration, relaxations)
    measured = _quantities(miss, t, path.duration, relaxations)[:, :, :2].max(axis=1)
    which = np.argmax(np.where(np.isnan(values), np.inf, values), axis=1)
    rows = np.arange(len(intervals))[:, None]
    angular = [0, 1, *(int(item.angular) for item in relaxations)]
    bounds = values[rows, which, np.arange(values.shape[2])] + rest[:, angular]
    return _Bounds(bounds, times[rows, which], measured)


def _quantities(miss: Array, t: Array, duration: float, relaxations: Sequence[Relaxation]) -> Array:
    """Return for deviations (I, P, 6) the errors beyond relaxations, and what these take."""
    flat, times = miss.reshape(-1, 6), t.ravel()
    beyond = excess(relaxations, duration, times, flat)
    columns = [_length(beyond[:, :3]), _length(beyond[:, 3:])]
    columns += [deviation_size(item, duration, times, flat) for item in relaxations]
    return np.stack(columns, axis=1).reshape(*t.shape, -1)


def _largest(parts: Array) -> Array:
    """Return the largest lengths of translations and rotations (I, P, 6), (I, 2)."""
    both = np.stack([_length(parts[:, :, :3]), _length(parts[:, :, 3:])], axis=2)
    return np.asarray(both.max(axis=1))


def _length(rows: Array) -> Array:
    return np.asarray(np.linalg.norm(rows, axis=-1))

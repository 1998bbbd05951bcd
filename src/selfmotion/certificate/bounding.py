"""Proved bounds of functions of a motion at all times: one loop, each bound a theorem.

On an interval |t - m| ≤ h on which the motion is smooth, a function f with values in a normed space
is evaluated at K Chebyshev nodes. The interpolating polynomial p differs from it by at most

    |f - p| ≤ sup |∂ᴷf/∂uᴷ| / K! / 2^(K-1),    u = (t - m) / h

(P. J. Davis, Interpolation and Approximation, 1963, th. 3.1.1), and the K-th derivative is bounded
by the majorant series of f. Between two of the points u_i at which p is evaluated, δ apart, p
leaves its chord by at most δ²/8 sup|p''|, and |p''| ≤ Σ |a_k| k²(k² - 1)/3 for p = Σ a_k T_k (V. A.
Markov). A convex size of f that grows no faster than |f| is then at most its largest value at the
u_i plus both. Intervals on which this does not decide are halved. Rounding is not bounded: it is
some 1e-15 of the size of the values.

A function without a majorant is bounded as measured: by the last two coefficients a_k in place of
the first bound. That is no proof.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, Flags, Ints, Progress, series, silent
from selfmotion.model.motion import Trajectory
from selfmotion.model.path import Path, PathSeries, path_series
from selfmotion.model.robot import ChainSeries, RobotModel

# Nodes of an interval are multiples of this: few numbers, of which each takes a pass of its own.
_NODES_STEP = 3
# Fewer intervals than these take the next larger number of nodes: a pass takes longer.
_FEW = 16
# Nodes of an interval without a majorant.
_MEASURED = 9
# Points of an interval at which polynomials are evaluated.
_PLACES = 33
# Intervals in one chunk, which bounds memory.
_CHUNK = 2048
# Largest number of halvings of an interval.
_DEPTH = 16
# Largest number of intervals in work per chunk, in multiples of its own …
_TIMES = 32
# … or this many, whichever is more.
_MIN_CHUNK = 4096


class MotionSegments:
    """The motion of an arm on I intervals, none of which contains a sample.

    Parameters
    ----------
    robot : RobotModel
    trajectory : Trajectory
    intervals : (I, 2)
        Beginnings and ends [s].
    """

    def __init__(self, robot: RobotModel, trajectory: Trajectory, intervals: Array) -> None:
        self.robot, self.trajectory, self.intervals = robot, trajectory, intervals
        self.middle = 0.5 * (intervals[:, 0] + intervals[:, 1])
        self.half = 0.5 * (intervals[:, 1] - intervals[:, 0])
        # By the identity of paths, which need not be hashable.
        self._path_series: dict[int, PathSeries | None] = {}

    @cached_property
    def _joints(self) -> Array:
        return self.trajectory.polynomials(self.middle, self.half)

    def chain(self) -> ChainSeries:
        """Return the majorants of the chain's motion."""
        joints = series.of_polynomial(self._joints).transpose(2, 0, 1)
        return ChainSeries(self.robot, joints, self.half)

    def path_series(self, path: Path) -> PathSeries | None:
        """Return the series of a path on all intervals, which is made once; None for unknown."""
        if id(path) not in self._path_series:
            self._path_series[id(path)] = path_series(path, self.middle, self.half)
        return self._path_series[id(path)]

    def some(self, rows: Ints) -> "MotionSegments":
        """Return some of the intervals, with what is known of them."""
        found = MotionSegments(self.robot, self.trajectory, self.intervals[rows])
        for key, known in self._path_series.items():
            found._path_series[key] = known and PathSeries(*(item[:, rows] for item in known))
        return found

    def times(self, u: Array) -> Array:
        """Return the times of places u (P,) of each interval, -1 to 1, (I, P)."""
        inner = self.middle[:, None] + self.half[:, None] * u
        # Rounding may put the last one after the end.
        return np.clip(inner, self.intervals[:, :1], self.intervals[:, 1:])

    def motion(self, u: Array, order: int = 0) -> Array:
        """Return q (`order` 0), q̇, q̈ or the jerk at places u (P,) of all intervals, (I · P, n)."""
        powers = np.vander(u, len(self._joints), increasing=True)
        table, scale = self._joints, np.ones(len(self.half))
        for _ in range(order):
            table = table[1:] * np.arange(1.0, len(table))[:, None, None]
            scale = scale * self.half
        found = np.einsum("pk,kin->ipn", powers[:, : len(table)], table)
        found /= scale[:, None, None]
        return np.ascontiguousarray(found.reshape(-1, found.shape[2]))


class BoundedFunction(ABC):
    """A function of a motion: vectors in blocks, and sizes of them.

    Attributes
    ----------
    blocks : (B,)
        Index of each block's first component, of C.
    of : (G,)
        Which block's errors each size inherits.
    allowed : (G,)
        Allowed sizes; inf for any.
    wanted : (B,)
        How well the blocks are to be interpolated at least.
    """

    blocks: Ints
    of: Ints
    allowed: Array
    wanted: Array

    @abstractmethod
    def series(self, segments: MotionSegments) -> Array | None:
        """Return the blocks' majorants (B, K + 1, I); None where they are not known."""

    @abstractmethod
    def values(self, segments: MotionSegments, u: Array) -> Array:
        """Return the components at places u (P,) of the intervals, (I, P, C)."""

    @abstractmethod
    def sizes(self, values: Array, segments: MotionSegments) -> Array:
        """Return the sizes of components (I, P, C), (I, P, G): convex, growing no faster."""


@dataclass(frozen=True, eq=False)
class Bounds:
    """Bounds of a function on a whole motion.

    Attributes
    ----------
    values, times : (G,)
        Bounds of the sizes, and about when [s]; they hold but on the intervals that are undecided.
    undecided : tuple of (float, float)
        Intervals [s].
    proved : bool
        Whether the bounds are theorems everywhere.
    samples : int
        Number of times at which it was evaluated.
    """

    values: Array
    times: Array
    undecided: tuple[tuple[float, float], ...]
    proved: bool
    samples: int


class _Found(NamedTuple):
    """For I intervals: bounds, about when, sizes measured, (I, G); proved, and samples."""

    values: Array
    times: Array
    measured: Array
    proved: bool
    samples: int


def bounded(
    function: BoundedFunction,
    robot: RobotModel,
    trajectory: Trajectory,
    edges: Array,
    progress: Progress = silent,
) -> Bounds:
    """Bound a function of a motion between all edges (E,) [s], which contain the samples.

    A long motion is bounded in chunks, to bound memory; `progress` is called with ``("checking",
    chunk, chunks)``.
    """
    values, times = np.zeros(len(function.of)), np.full(len(function.of), edges[0])
    undecided: list[tuple[float, float]] = []
    proved, samples = True, 0
    for left, found in _decided(function, robot, trajectory, edges, progress):
        proved, samples = proved and found.proved, samples + found.samples
        for size in range(len(values)) if len(found.values) else ():
            # Written so that NaN is worse than any.
            worst = int(np.argmax(np.where(np.isnan(found.values), np.inf, found.values)[:, size]))
            value = found.values[worst, size]
            if not (np.isnan(values[size]) or value <= values[size]):
                values[size], times[size] = value, found.times[worst, size]
        undecided += [(float(a), float(b)) for a, b in left]
    return Bounds(values, times, tuple(undecided), proved, samples + 1)


def _decided(
    function: BoundedFunction,
    robot: RobotModel,
    trajectory: Trajectory,
    edges: Array,
    progress: Progress,
) -> Iterator[tuple[Array, _Found]]:
    """Yield by chunks the undecided intervals (I, 2), and the bounds of all others."""
    chunks = range(0, len(edges) - 1, _CHUNK)
    for number, first in enumerate(chunks, 1):
        if len(chunks) > 1:
            progress("checking", number, len(chunks))
        part = edges[first : first + _CHUNK + 1]
        pending = np.stack([part[:-1], part[1:]], axis=1)
        most = max(_MIN_CHUNK, _TIMES * len(pending))
        for depth in range(_DEPTH + 1):
            found = _measured(function, MotionSegments(robot, trajectory, pending))
            # Written so that NaN settles nothing and is no small error either.
            satisfied = np.asarray(found.values <= function.allowed).all(axis=1)
            broken = ~np.asarray(found.measured <= function.allowed).all(axis=1)
            decided = satisfied | broken
            left = np.flatnonzero(~decided)
            last = depth == _DEPTH or len(left) > most
            said = np.arange(len(pending)) if last else np.flatnonzero(decided)
            # Without a bound, the samples: violated, or undecided.
            values = np.where(np.isfinite(found.values), found.values, found.measured)
            yield (
                pending[left if last else left[:0]],
                found._replace(values=values[said], times=found.times[said]),
            )
            if last or not len(left):
                break
            pending = halves(pending[left])


def _measured(function: BoundedFunction, segments: MotionSegments) -> _Found:
    """Bound all sizes on the given intervals."""
    count = len(segments.middle)
    # Overflow counts as no bound: the interval is halved.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        known = function.series(segments)
    sizes = len(function.of)
    values, times, measured = (np.empty((count, sizes)) for _ in range(3))
    nodes = np.full(count, _MEASURED)
    rest = np.full((len(function.blocks), count), np.nan)
    if known is not None:
        nodes, rest = _nodes(known, function)
    samples = 0
    for number in np.unique(nodes):
        rows = np.flatnonzero(nodes == number)
        some = segments.some(rows) if len(rows) < count else segments
        found = _interpolated(function, some, int(number), rest[:, rows])
        values[rows], times[rows], measured[rows] = found
        samples += len(rows) * int(number)
    return _Found(values, times, measured, known is not None, samples)


def _nodes(known: Array, function: BoundedFunction) -> tuple[Ints, Array]:
    """Return the number of nodes of each interval (I,), and interpolation errors (B, I)."""
    powers = np.arange(_NODES_STEP, series.ORDER + 1, _NODES_STEP)
    errors = known[:, powers] / 2.0 ** (powers - 1.0)[:, None]
    good = (errors <= function.wanted[:, None, None]).all(axis=0)
    limits = np.full(len(function.blocks), np.inf)
    np.minimum.at(limits, function.of, function.allowed)
    usable = (errors[:, -1] <= 0.5 * limits[:, None]).all(axis=0)
    enough = good.any(axis=0)
    which = np.where(enough, np.argmax(good, axis=0), np.where(usable, len(powers) - 1, 0))
    which = _with_others(which, np.asarray(enough))
    rest = np.take_along_axis(errors, which[None, None], axis=1)[:, 0]
    return powers[which], np.where(enough | usable, rest, np.inf)


def _with_others(which: Ints, enough: Flags) -> Ints:
    """Return the index of each interval's number of nodes; a few of one go with those of more."""
    counts = np.bincount(which[enough], minlength=1)
    for number in range(len(counts) - 1):
        if 0 < counts[number] < _FEW:
            larger = number + 1 + int(np.argmax(counts[number + 1 :] > 0))
            which = np.where(enough & (which == number), larger, which)
            counts[larger] += counts[number]
    return which


def _interpolated(
    function: BoundedFunction, segments: MotionSegments, count: int, rest: Array
) -> tuple[Array, Array, Array]:
    """Return bounds, about when, and measured sizes (I, G) by polynomials through nodes."""
    u, places, into, between, bends = _matrices(count)
    values = function.values(segments, u)
    coefficients = _times(into, values)
    lengths = _lengths(coefficients, function.blocks)
    if np.isnan(rest).all():
        rest = 2.0 * lengths[:, -2:].sum(axis=1).T
    left = rest.T + bends @ lengths
    dense = function.sizes(_times(between, coefficients), segments)
    measured = function.sizes(values, segments).max(axis=1)
    which = np.argmax(np.where(np.isnan(dense), np.inf, dense), axis=1)
    times = segments.times(places)
    rows = np.arange(len(times))[:, None]
    bounds = dense[rows, which, np.arange(dense.shape[2])] + left[:, function.of]
    return bounds, times[rows, which], measured


def _times(matrix: Array, values: Array) -> Array:
    """Return the product of a matrix (L, K) with values (I, K, C) of intervals, (I, L, C)."""
    count, nodes, components = values.shape
    columns = values.transpose(1, 0, 2).reshape(nodes, -1)
    return (matrix @ columns).reshape(-1, count, components).transpose(1, 0, 2)


def _lengths(vectors: Array, blocks: Ints) -> Array:
    """Return the lengths of blocks of components (I, K, C), (I, K, B)."""
    return np.asarray(np.sqrt(np.add.reduceat(vectors**2, blocks, axis=2)))


@cache
def _matrices(count: int) -> tuple[Array, Array, Array, Array, Array]:
    """Return nodes; places; from values to Chebyshev coefficients; to the places; their sag."""
    u = np.polynomial.chebyshev.chebpts1(count)
    places = np.linspace(-1.0, 1.0, _PLACES)
    into = np.linalg.inv(np.polynomial.chebyshev.chebvander(u, count - 1))
    between = np.polynomial.chebyshev.chebvander(places, count - 1)
    k = np.arange(float(count))
    bends = (2.0 / (_PLACES - 1)) ** 2 / 24.0 * k**2 * (k**2 - 1.0)
    return np.asarray(u), places, np.asarray(into), np.asarray(between), bends


def halves(intervals: Array) -> Array:
    """Return both halves of each interval (I, 2), (2 I, 2)."""
    middle = intervals.mean(axis=1)
    both = np.stack([intervals[:, 0], middle, middle, intervals[:, 1]], axis=1)
    return both.reshape(-1, 2)

"""Prescribed feeds, and the feeds that a motion reaches."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, Flags, series
from selfmotion.certificate.bounding import BoundedFunction, Bounds, MotionSegments, bounded
from selfmotion.certificate.path_error import jacobians, smooth_between
from selfmotion.certificate.requirement import Finding, FinishedMotion, Requirement
from selfmotion.model.follow import BoundTaskFrame
from selfmotion.model.path import FeedPossible, FeedProfile, Path, path_series

# Relative accuracy of the interpolation of speed margins.
_FINE = 1e-3
# Shorter windows of a feed, as a share of the duration, are ignored.
_INSTANT = 1e-9
# Smallest speed margin of a path [m/s].
_TINY = 1e-12


@dataclass(frozen=True, eq=False)
class FeedReached(Requirement):
    """The tool keeps a feed in its windows: at all times, and not only at nodes.

    First the path itself is judged at that feed: its own speed |v_d| is bounded between its nodes,
    from below where the feed counts, from above everywhere (`_Pace`). Then the tool: with v and v_d
    the velocities of tool and path, the tool's speed along the path is |v_d| + f/|v_d| with f = (v
    - v_d)·v_d: it keeps the feed where |f| is at most |v_d| times the path's speed margin.

    Attributes
    ----------
    found : FeedProfile
        The feed that the path itself keeps.
    follow : BoundTaskFrame
        The tip on that path.
    """

    found: FeedProfile
    follow: BoundTaskFrame
    name: str = "feed"

    @property
    @override
    def remarks(self) -> tuple[str, ...]:
        """Whether it is no proof."""
        unknown = any(
            path_series(path, np.array([0.5 * path.duration]), np.array([1e-3 * path.duration]))
            is None
            for path in (self.follow.path, self.found.path)
        )
        return ("feed: checked at samples only",) if unknown else ()

    @override
    def judge(self, motion: FinishedMotion) -> Finding:
        """Return the slowest speed where the feed counts."""
        found, allowed = self.found, (1.0 - self.found.within) * self.found.asked
        if not found.kept:
            text = FeedPossible(found).text(self.follow.path)
            return self._found(found.time, allowed, False, text)
        text = f"{self._named(found.time)} is reached up to {found.reached:.4g} m/s"
        pace = self._pace(motion)
        if pace.off is not None:
            return self._found(pace.off, allowed, False, self._lost(pace.off))
        for speeds in self._speeds(motion, pace):
            if _is_off(speeds):
                return self._found(*self._off(speeds, pace, allowed))
        return self._found(found.time, allowed, True, text)

    def _found(self, time: float, allowed: float, kept: bool, text: str) -> Finding:
        slowest = self.found.slowest
        return Finding(
            self.name, "path", time, slowest, allowed, kept, text, at_least=True, unit="m/s"
        )

    def _pace(self, motion: FinishedMotion) -> "_OwnPace":
        """Return bounds of the path's own speed, at all times."""
        found = self.found
        intervals, counts = found.pieces
        low, high = ((1.0 + side * found.within) * found.asked for side in (-1.0, 1.0))
        slowest, fastest = found.asked, 0.0
        for first, last, is_counted in _runs(intervals, counts):
            within = _Pace(found.path, low if is_counted else -high, high)
            start, end = intervals[first, 0], intervals[last, 1]
            marks = np.asarray(found.path.marks)
            inside = (marks > start) & (marks < end)
            edges = np.concatenate([[start], marks[inside], [end]])
            known = bounded(within, motion.robot, motion.trajectory, edges)
            # A motion may be so near to its limit that halving does not decide.
            if _is_off(known):
                own = known.undecided[0][0] if known.undecided else float(known.times[0])
                return _OwnPace(0.0, self._when(own))
            speeds = within.speeds(float(known.values[0]))
            slowest = min(slowest, speeds[0]) if is_counted else slowest
            fastest = max(fastest, speeds[1])
        return _OwnPace(max(min(high - fastest, slowest - low), 0.0), None, slowest)

    def _when(self, own: float) -> float:
        """Return when a time of the path at the feed is passed on the one that is followed [s]."""
        order = np.argsort(self.found.path_times)
        return float(np.interp(own, self.found.path_times[order], self.found.t[order]))

    def _lost(self, time: float) -> str:
        return (
            f"{self._named(time)} is kept by the path where it was laid out, but not in between: "
            f"near t = {time:.3f} s its own speed changes too fast for that; take a smoother path "
            f"there (more even distances or times of its rows, a rounded corner)"
        )

    def _speeds(self, motion: FinishedMotion, pace: "_OwnPace") -> Iterator[Bounds]:
        """Yield bounds of the tool's speed, by window of the feed."""
        edges = smooth_between(self.follow.path, motion.trajectory)
        along = _Along(self.follow, pace)
        for window in self.found.during:
            if window[1] - window[0] <= _INSTANT * self.follow.path.duration:
                continue
            # Where feeds change the path has marks: the nearest edges, up to rounding.
            first, last = (int(np.argmin(np.abs(edges - time))) for time in window)
            first = min(first, len(edges) - 2)
            part = edges[first : max(last, first + 1) + 1]
            yield bounded(along, motion.robot, motion.trajectory, part)

    def _off(
        self, speeds: Bounds, pace: "_OwnPace", allowed: float
    ) -> tuple[float, float, bool, str]:
        """Return the time at which the tool leaves the path's speed, and a message."""
        time = speeds.undecided[0][0] if speeds.undecided else float(speeds.times[0])
        by = f"by {speeds.values[0] * pace.left_over:.2g} m/s " if not speeds.undecided else ""
        text = (
            f"{self._named(time)} is kept by the path, but not by '{self.follow.chain.tip_name}', "
            f"which moves along it faster or slower {by}at t = {time:.3f} s, where "
            f"{pace.left_over:.2g} m/s are left: keep it nearer to the path (fewer relaxed rows, "
            f"more samples or targets), or allow the feed more (within=)"
        )
        return time, allowed, False, text

    def _named(self, time: float) -> str:
        return self.found.named(time, self.follow.path.duration)


class _OwnPace(NamedTuple):
    """Speed margin of a path at a feed [m/s], time of its own violation [s], its slowest speed."""

    left_over: float
    off: float | None
    slowest: float = 0.0


def _runs(intervals: Array, counts: Flags) -> Iterator[tuple[int, int, bool]]:
    """Yield the first and last of intervals (I, 2) in a row that count, or do not."""
    if not len(intervals):
        return
    offset = intervals[1:, 0] != intervals[:-1, 1]
    cuts = np.flatnonzero(offset | (counts[1:] != counts[:-1])) + 1
    for first, after in pairwise([0, *cuts.tolist(), len(intervals)]):
        yield first, after - 1, bool(counts[first])


def _is_off(speeds: Bounds) -> bool:
    """Return whether a tool's speed exceeds, or may exceed, the margin."""
    # Written so that NaN is.
    return bool(speeds.undecided or not speeds.values[0] <= 1.0)


class _Pace(BoundedFunction):
    """(|v_d|² - m) / r: at most 1 in size where low ≤ |v_d| ≤ high.

    With m and r the mean and half the difference of the squares of both. A negative `low` is none:
    then it is |v_d|² / high².

    Parameters
    ----------
    path : Path
        At the feed.
    low, high : float
        [m/s].
    """

    def __init__(self, path: Path, low: float, high: float) -> None:
        self._path = path
        least = low * abs(low)
        self._mean, self._half = 0.5 * (high**2 + least), 0.5 * (high**2 - least)
        self.blocks = self.of = np.zeros(1, dtype=np.intp)
        self.allowed, self.wanted = np.ones(1), np.full(1, _FINE)

    def speeds(self, size: float) -> tuple[float, float]:
        """Return the least and the largest speed of a size [m/s]."""
        least, most = (self._mean + side * size * self._half for side in (-1.0, 1.0))
        return float(np.sqrt(max(least, 0.0))), float(np.sqrt(most))

    @override
    def series(self, segments: MotionSegments) -> Array | None:
        path = segments.path_series(self._path)
        if path is None:
            return None
        speed = series.derivative(path.translation, segments.half)
        squared = series.product(speed, speed)
        squared[0] += self._mean
        return np.asarray(squared[None] / self._half)

    @override
    def values(self, segments: MotionSegments, u: Array) -> Array:
        twists = self._path.samples(segments.times(u).ravel()).twist[:, :3]
        squares = np.einsum("kc,kc->k", twists, twists)
        found = (squares - self._mean) / self._half
        return np.asarray(found.reshape(len(segments.middle), len(u), 1))

    @override
    def sizes(self, values: Array, segments: MotionSegments) -> Array:
        return np.abs(values)


class _Along(BoundedFunction):
    """(v - v_d)·v_d, as a share of its bound: |v_d| times the path's speed margin.

    |v_d| is bounded from below on each interval: its value in the middle, minus the variation that
    its majorant allows.
    """

    def __init__(self, follow: BoundTaskFrame, pace: _OwnPace) -> None:
        self._follow, self._pace = follow, pace
        self.blocks = self.of = np.zeros(1, dtype=np.intp)
        self.allowed, self.wanted = np.ones(1), np.full(1, _FINE)

    def _room(self, segments: MotionSegments) -> Array:
        """Return the bounds of (v - v_d)·v_d on intervals, (I,) [m²/s²]."""
        slowest = np.full(len(segments.middle), self._pace.slowest)
        path = segments.path_series(self._follow.path)
        if path is not None:
            speed = series.derivative(path.translation, segments.half)
            middle = self._follow.path.samples(segments.middle).twist[:, :3]
            least = np.linalg.norm(middle, axis=1) - speed[1:].sum(axis=0)
            slowest = np.fmax(slowest, least)
        return np.asarray(slowest * max(self._pace.left_over, _TINY))

    @override
    def series(self, segments: MotionSegments) -> Array | None:
        path = segments.path_series(self._follow.path)
        if path is None:
            return None
        place, _ = segments.chain().relative(self._follow.chain)
        speed = series.derivative(path.translation, segments.half)
        offset = series.derivative(place, segments.half) + speed
        return np.asarray(series.product(offset, speed)[None] / self._room(segments))

    @override
    def values(self, segments: MotionSegments, u: Array) -> Array:
        target = self._follow.path.samples(segments.times(u).ravel()).twist[:, :3]
        moved, _ = jacobians(self._follow.chain, segments.motion(u))
        speed = np.einsum("kcn,kn->kc", moved[:, :3], segments.motion(u, 1))
        along = np.einsum("kc,kc->k", speed - target, target)
        shape = len(segments.middle), len(u), 1
        return np.asarray(along.reshape(shape) / self._room(segments)[:, None, None])

    @override
    def sizes(self, values: Array, segments: MotionSegments) -> Array:
        return np.abs(values)


# Remedy in findings of rates; a feed leaves no duration to choose.
_LONGER = re.compile(r": give it ([0-9.e+-]+|inf) times the duration")


def with_feeds(
    said: Sequence[str], feeds: Sequence[FeedReached], findings: Sequence[Finding]
) -> tuple[str, ...]:
    """Return findings of an arm that is too slow, of motions at feeds in terms of these.

    The first of it says which feed the arm can keep, where that is known.
    """
    if not feeds:
        return tuple(said)
    possible = possible_feed(feeds, findings)
    if not possible:
        return tuple(_LONGER.sub(r": run it \1 times slower", text) for text in said)
    texts = [_LONGER.sub("", text) for text in said]
    return (f"{texts[0]}: {possible}", *texts[1:])


def possible_feed(feeds: Sequence[FeedReached], findings: Sequence[Finding]) -> str:
    """Return the feeds that an arm could reach that is too slow for the prescribed ones.

    Empty without a prescribed feed, with other violations, or where the path itself does not keep a
    feed.
    """
    broken = [item for item in findings if not item.satisfied]
    factor = max((item.factor for item in broken), default=1.0)
    kept = all(item.found.kept for item in feeds)
    if not (feeds and kept and 1.0 < factor < np.inf and all(item.of_pace for item in broken)):
        return ""
    asked = sorted({item.found.asked for item in feeds})
    feed = _rounded_down(asked[-1] / factor)
    slower = asked[-1] / feed
    slowest = f"feeds of {asked[0] / slower:.3g} to" if len(asked) > 1 else "a feed of"
    return (
        f"the arm keeps its limits {_rounded_up(slower)} times slower, at {slowest} {feed:g} m/s "
        f"(accelerations of the path {slower**2:.3g} times smaller, its smoothing {slower:.3g} "
        f"times longer)"
    )


def _rounded_up(factor: float) -> str:
    """Return a number of four digits that is no smaller."""
    return f"{np.ceil(1e3 * factor) / 1e3:.3f}"


def _rounded_down(speed: float) -> float:
    """Return a number of two digits that is no larger."""
    digits = f"{speed:.1e}"
    least = float(digits)
    if least <= speed:
        return least
    head, power = digits.split("e")
    return float(f"{float(head) - 0.1:.1f}e{power}")

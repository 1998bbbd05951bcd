"""The feed that was asked for, and the one that is reached."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, series
from selfmotion.certificate.bounding import Bounded, Bounds, Stretch, bounded
from selfmotion.certificate.deviation import jacobians
from selfmotion.certificate.findings import Finding
from selfmotion.certificate.path_error import smooth_between
from selfmotion.certificate.requirement import FinishedMotion, Requirement
from selfmotion.follow import BoundFollow
from selfmotion.path import FeedKept, path_series

# Shares of the room that is left are interpolated this well at least.
_FINE = 1e-3
# Times that are told are alike up to this [s].
_SAME = 1e-3
# A feed that is asked for no longer than this, as a share of the duration, is asked for nowhere.
_INSTANT = 1e-9


@dataclass(frozen=True, eq=False)
class FeedReached(Requirement):
    """The tool keeps a feed while it is asked for, as the path does but for what that leaves.

    With v and v_d the velocities of tool and path, the tool's speed along the path is
    |v_d| + f/|v_d| with f = (v - v_d)·v_d: it keeps the feed where the path does and |f| is at most
    |v_d| times what is left over.

    Attributes
    ----------
    found : FeedKept
        What the path makes of it.
    follow : BoundFollow
        The tip on that path.
    """

    found: FeedKept
    follow: BoundFollow
    name: str = "feed"

    @property
    def remarks(self) -> tuple[str, ...]:
        """See `Requirement.remarks`: whether it is no proof."""
        path = self.follow.path
        known = path_series(path, np.array([0.5 * path.duration]), np.array([1e-3 * path.duration]))
        return () if known else ("feed: judged as measured between marks of the path",)

    def judge(self, motion: FinishedMotion) -> Finding:
        """See `Requirement.judge`: the slowest speed where the feed counts."""
        found, allowed = self.found, (1.0 - self.found.within) * self.found.asked
        text = f"{self._named(found.time)} is reached up to {found.reached:.4g} m/s"
        if found.kept:
            off = next(filter(_is_off, self._speeds(motion)), None)
            if off is not None:
                time, text = self._off(off)
                return self._found(time, allowed, False, text)
        else:
            slow = f"for {found.slower:.3g} s, " if found.slower else ""
            text = (
                f"{text}, but {slow}at t = {found.time:.3f} s it is {found.slowest:.4g} m/s, held "
                f"by {found.held_by}: ask for {_reached(found):g} m/s, or allow it "
                f"more (within=)"
            )
        return self._found(found.time, allowed, found.kept, text)

    def _found(self, time: float, allowed: float, kept: bool, text: str) -> Finding:
        slowest = self.found.slowest
        return Finding(self.name, "path", time, slowest, allowed, kept, text, at_least=True)

    def _speeds(self, motion: FinishedMotion) -> Iterator[Bounds]:
        """Yield what is known of the tool's speed each time that the feed is asked for."""
        edges = smooth_between(self.follow.path, motion.trajectory)
        along = _Along(self.follow, self.found)
        for window in self.found.during:
            if window[1] - window[0] <= _INSTANT * self.follow.path.duration:
                continue
            # Where feeds change the path has marks: rounding apart these are the nearest edges.
            first, last = (int(np.argmin(np.abs(edges - time))) for time in window)
            first = min(first, len(edges) - 2)
            part = edges[first : max(last, first + 1) + 1]
            yield bounded(along, motion.robot, motion.trajectory, part)

    def _off(self, speeds: Bounds) -> tuple[float, str]:
        """Return when the tool leaves the path's pace, and what is said of it."""
        found = self.found
        time = speeds.undecided[0][0] if speeds.undecided else float(speeds.times[0])
        room = found.slowest * found.left_over / found.asked
        apart = f"by {speeds.values[0] * room:.2g} m/s " if not speeds.undecided else ""
        return time, (
            f"{self._named(time)} is kept by the path, but not by '{self.follow.chain.tip_name}', "
            f"which moves along it faster or slower {apart}at t = {time:.3f} s, where "
            f"{room:.2g} m/s are left: keep it nearer to the path (fewer relaxed rows, more "
            f"samples or targets), or allow the feed more (within=)"
        )

    def _named(self, time: float) -> str:
        """Return the feed in words, and from when to when it is asked for near a time."""
        during = self.found.during
        first, last = during[int(np.argmin(np.abs(during - time).min(axis=1)))]
        ends = 0.0, self.follow.path.duration
        whole = len(during) == 1 and np.allclose((first, last), ends, rtol=0.0, atol=_SAME)
        stretch = "" if whole else f" from t = {first:.3f} to {last:.3f} s"
        return f"the feed of {self.found.asked:g} m/s{stretch}"


def _is_off(speeds: Bounds) -> bool:
    """Return whether a tool is, or may be, faster or slower than is left."""
    # Written so that NaN is.
    return bool(speeds.undecided or not speeds.values[0] <= 1.0)


class _Along(Bounded):
    """(v - v_d)·v_d, as a share of what it may be: what the path leaves over."""

    def __init__(self, follow: BoundFollow, found: FeedKept) -> None:
        self._follow, self._room = follow, found.slowest * found.left_over
        self.blocks = self.of = np.zeros(1, dtype=np.intp)
        self.allowed, self.wanted = np.ones(1), np.full(1, _FINE)

    def series(self, stretch: Stretch) -> Array | None:
        """See `Bounded.series`."""
        path = path_series(self._follow.path, stretch.middle, stretch.half)
        if path is None:
            return None
        place, _ = stretch.chain().relative(self._follow.chain)
        speed = series.derivative(path.translation, stretch.half)
        apart = series.derivative(place, stretch.half) + speed
        return np.asarray(series.product(apart, speed)[None] / self._room)

    def values(self, stretch: Stretch, u: Array) -> Array:
        """See `Bounded.values`."""
        target = self._follow.path.samples(stretch.times(u).ravel()).twist[:, :3]
        moved, _ = jacobians(self._follow.chain, stretch.motion(u))
        speed = np.einsum("kcn,kn->kc", moved[:, :3], stretch.motion(u, 1))
        along = np.einsum("kc,kc->k", speed - target, target)
        return np.asarray(along.reshape(len(stretch.middle), len(u), 1) / self._room)

    def sizes(self, values: Array, stretch: Stretch) -> Array:
        """See `Bounded.sizes`."""
        return np.abs(values)


def possible_feeds(feeds: Sequence[FeedReached], findings: Sequence[Finding]) -> tuple[str, ...]:
    """Return which feeds a motion could have whose arm is too slow for those that were asked for.

    Nothing where something else is wrong, too, but feeds that the path itself does not keep; or no
    feed was asked for.
    """
    unkept = [item for item in feeds if not item.found.kept]
    # Those of the feeds are the last.
    by_path = [*[False] * (len(findings) - len(feeds)), *(not item.found.kept for item in feeds)]
    pairs = zip(findings, by_path, strict=True)
    broken = [item for item, of_path in pairs if not (item.kept or of_path)]
    factor = max((item.factor for item in broken), default=1.0)
    if not (feeds and 1.0 < factor < np.inf and all(item.of_pace for item in broken)):
        return ()
    asked = sorted({_reached(item.found) for item in feeds})
    feed = _rounded_down(asked[-1] / factor)
    slower = asked[-1] / feed
    slowest = f"feeds of {asked[0] / slower:.3g} to" if len(asked) > 1 else "a feed of"
    first = f"ask for {', '.join(f'{each:g}' for each in asked)} m/s, then " if unkept else ""
    return (
        f"the arm keeps its limits at {slowest} {feed:g} m/s, accelerations of the path "
        f"being {slower**2:.3g} times smaller and its smoothing {slower:.3g} times longer: "
        f"{first}Feed.slower({_rounded_up(slower)})",
    )


def _reached(found: FeedKept) -> float:
    """Return the feed that a path keeps, or that it would if it was asked for [m/s]."""
    return found.asked if found.kept else _rounded_down(found.slowest)


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

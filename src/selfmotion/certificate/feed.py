"""The feed that was asked for, and the one that is reached."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, series
from selfmotion.certificate.bounding import Bounded, Stretch, bounded
from selfmotion.certificate.deviation import jacobians
from selfmotion.certificate.findings import Finding
from selfmotion.certificate.path_error import smooth_between
from selfmotion.certificate.requirement import FinishedMotion, Requirement
from selfmotion.follow import BoundFollow
from selfmotion.path import FeedKept, path_series

# Shares of the room that is left are interpolated this well at least.
_FINE = 1e-3


@dataclass(frozen=True, eq=False)
class FeedReached(Requirement):
    """The tool keeps its feed, as the path does but for what the path leaves over.

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
        text = f"the feed of {found.asked:g} m/s is reached up to {found.reached:.4g} m/s"
        if found.kept:
            edges = smooth_between(self.follow.path, motion.trajectory)
            speeds = bounded(_Along(self.follow, found), motion.robot, motion.trajectory, edges)
            # Written so that NaN is not kept.
            if speeds.undecided or not speeds.values[0] <= 1.0:
                time = speeds.undecided[0][0] if speeds.undecided else float(speeds.times[0])
                room = found.slowest * found.left_over / found.asked
                apart = f"by {speeds.values[0] * room:.2g} m/s" if not speeds.undecided else ""
                text = (
                    f"the feed of {found.asked:g} m/s is kept by the path, but not by "
                    f"'{self.follow.chain.tip_name}', which moves along it faster or slower "
                    f"{apart and apart + ' '}at t = {time:.3f} s, where {room:.2g} m/s are left: "
                    f"keep it nearer to the path (fewer relaxed rows, more samples or targets), or "
                    f"allow the feed more (within=)"
                )
                return Finding(self.name, "path", time, found.slowest, allowed, False, text)
        else:
            slow = f"for {found.slower:.3g} s, " if found.slower else ""
            text = (
                f"{text}, but {slow}at t = {found.time:.3f} s it is {found.slowest:.4g} m/s, held "
                f"by {found.held_by}: ask for {_rounded_down(found.slowest):g} m/s, or allow it "
                f"more (within=)"
            )
        return Finding(self.name, "path", found.time, found.slowest, allowed, found.kept, text)


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

    Nothing where something else is wrong, too, or no feed was asked for.
    """
    broken = [item for item in findings if not item.kept]
    factor = max((item.factor for item in broken), default=1.0)
    if not (feeds and 1.0 < factor < np.inf and all(item.of_pace for item in broken)):
        return ()
    asked = max(item.found.asked for item in feeds)
    feed = _rounded_down(asked / factor)
    slower = asked / feed
    return (
        f"the arm keeps its limits at a feed of {feed:g} m/s, accelerations of the path "
        f"being {slower**2:.3g} times smaller and its smoothing {slower:.3g} times longer: "
        f"Feed.slower({_rounded_up(slower)})",
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

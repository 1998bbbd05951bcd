"""The feed that a path can have, and what would allow the one that was asked for."""

from dataclasses import dataclass
from functools import cached_property
from math import ceil, floor, log10

import numpy as np

from selfmotion.path.base import Path
from selfmotion.path.feed import Feed
from selfmotion.path.feed_kept import FeedKept

# A feed is named that leaves this share of what may be missing to the tool.
_LEFT = 0.5
# Feeds and limits are tried so often.
_LESS, _MORE = 20, 3
# A feed this much larger than the one that is named is not kept.
_NEAR = 1.05
# Limits are raised by this much more than what is missing; a limit that gains a smaller share of
# what is missing is none.
_OVER, _GAIN = 1.02, 0.3
# Larger accelerations are not advised [m/s²].
_WILD = 100.0
# A tool that is slower than this share of its feed rests.
_RESTS = 1e-6
# Digits of numbers that are named.
_DIGITS = 3
# With what accelerations and turn rates grow, over that of the feed.
_POWERS = {"acceleration": 2, "turn_acceleration": 2, "turn_rate": 1}
_UNITS = {"acceleration": "m/s²", "turn_acceleration": "rad/s²", "turn_rate": "rad/s"}
# What is looked at first.
_FIRST = {
    "the turn rate": "turn_rate",
    "the turn acceleration in a bend": "turn_acceleration",
}


@dataclass(frozen=True, eq=False)
class FeedPossible:
    """What can be had where a path does not keep a feed, whatever arm follows it.

    Attributes
    ----------
    found : FeedKept
        What was asked for, and what is reached.
    """

    found: FeedKept

    @cached_property
    def feed(self) -> float | None:
        """The largest feed of three digits that is kept instead [m/s]; None where none was found.

        From above, each feed that is not kept leads to the slowest speed that it leaves. From the
        first that is kept it goes up again while one that is larger by a twentieth is kept, too:
        where corners are passed slower, a lower feed leaves more way to run up.
        """
        own, feed = self.found, self.found.asked
        for _ in range(_LESS):
            if own.slowest <= _RESTS * feed:
                return None
            if _leaves(own):
                return self._larger(feed)
            lower = _rounded(own.slowest, down=True)
            # What is missing may be less than what is left to the tool.
            feed = lower if lower < feed else _rounded(feed * (1.0 - 1e-2), down=True)
            own = self._at(feed)
        return None

    def _larger(self, feed: float) -> float:
        """Return a feed that is kept, and a larger one is not."""
        larger = _rounded(_NEAR * feed, down=True)
        while larger < self.found.asked and _leaves(self._at(larger)):
            feed, larger = larger, _rounded(_NEAR * larger, down=True)
        return feed

    def _at(self, feed: float) -> FeedKept:
        """Return how another feed is kept instead."""
        return _kept_by(self.found.path.changed({self.found.asked: feed}), feed)

    @cached_property
    def limits(self) -> dict[str, float]:
        """Limits of the path with which the feed is kept as asked, by name; none if not found.

        Of each what the feed lacks, one limit alone before all of them.
        """
        first = _FIRST.get(self.found.held_by, "acceleration")
        for names in ((first,), tuple(_POWERS)):
            limits, own = dict[str, float](), self.found
            for _ in range(_MORE):
                before, more = own.slowest, own.asked / max(own.slowest, _RESTS * own.asked)
                for name in names:
                    limit = limits.get(name, self.found.path.limits[name])
                    limits[name] = _rounded(limit * (_OVER * more) ** _POWERS[name], down=False)
                if limits.get("acceleration", 0.0) > _WILD:
                    break
                own = _kept_by(self.found.path.changed({}, **limits), own.asked)
                if _leaves(own):
                    return limits
                if own.slowest < before + _GAIN * (own.asked - before):
                    break
        return {}

    def text(self, path: Path) -> str:
        """Return what is missing on a path that has the feed in it, where, why, and what to do."""
        found = self.found
        place = ", ".join(f"{x:.3f}" for x in path.samples(np.array([found.time])).translation[0])
        where = f"at t = {found.time:.3f} s near ({place})"
        reached = f"is reached up to {found.reached:.4g} m/s"
        if found.slowest < found.reached:
            slow = f"for {found.slower:.3g} s, " if found.slower else ""
            reached = f"{reached}, but {slow}{where} it is {found.slowest:.4g} m/s"
        else:
            reached = f"{reached} only, {where}"
        what = found.named(found.time, path.duration)
        return f"{what} {reached}, held by {found.held_by}: {self.remedies}"

    @property
    def within(self) -> float:
        """What would have to be allowed to be missing, as a share."""
        share = 1.0 - self.found.slowest / self.found.asked
        return min(_rounded(1.01 * share + 1e-3, down=False), 1.0)

    @property
    def remedies(self) -> str:
        """What to do, in words."""
        told = [] if self.feed is None else [f"ask for {self.feed:g} m/s"]
        if self.limits:
            named = (
                f"{name.replace('_', ' ')} of {value:g} {_UNITS[name]} ({name}={value:g})"
                for name, value in self.limits.items()
            )
            told.append(f"let the path have {'an ' * (len(self.limits) == 1)}{' and '.join(named)}")
        if self.found.held_by.startswith("run-up"):
            told.append("give it more way to run up (longer legs, rounder corners)")
        return ", or ".join([*told, f"allow it more (within={self.within:g})"])


def _leaves(found: FeedKept) -> bool:
    """Return whether a feed is kept, and enough of what may be missing left to the tool."""
    return found.kept and found.left_over >= _LEFT * found.within * found.asked * (1.0 - 1e-9)


def _kept_by(path: Feed, feed: float) -> FeedKept:
    """Return how well a path keeps one of its feeds."""
    return next(item for item in path.feeds if item.asked == feed)


def _rounded(value: float, *, down: bool) -> float:
    """Return a number of three digits that is no larger, or no smaller."""
    digits = _DIGITS - 1 - floor(log10(value))
    scaled = value * 10.0**digits
    # What has three digits but for rounding stays as it is.
    whole = floor(scaled * (1.0 + 1e-12)) if down else ceil(scaled * (1.0 - 1e-12))
    return float(f"{whole * 10.0**-digits:.{_DIGITS}g}")

"""A path at a constant feed, and the feed that a path can have."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import ceil, floor, log10
from typing import Any

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import (
    Array,
    Flags,
    PathError,
    as_flag,
    as_number,
    as_numbers,
    read_only,
    series,
)
from selfmotion.model.path.base import Path, PathSamples, PathSeries, _Derived, check_path
from selfmotion.model.path.feed_nodes import FeedNodes, twist_sizes
from selfmotion.model.path.feed_profile import FeedProfile
from selfmotion.model.path.pace import Pace, times_when

# Faster feeds [m/s] are errors of units.
_FASTEST = 3.0


class Feed(_Derived, kind="feed"):
    """A path at a constant feed, from rest to rest.

    The tool has its feed wherever turn rate and accelerations allow: it is slower in bends and at
    both ends, and rests at kinks. At most half of the acceleration is for bends, and at most half
    for changes of speed.

    Over the length λ of the path, measured by the time that it takes at the feed, dλ/dt is the
    largest by these limits, forwards and backwards from node to node (J. E. Bobrow, S. Dubowsky,
    J. S. Gibson, Int. J. Robotics Research 4(3), 1985), and then its mean over `smoothing`, so that
    accelerations do not jump.

    Parameters
    ----------
    path : Path
        Where the tool goes; its own pace does not matter.
    feed : float
        Speed of the tool [m/s].
    turn_rate : float
        The tool turns no faster than this [rad/s].
    acceleration : float
        [m/s²].
    turn_acceleration : float
        [rad/s²].
    smoothing : float
        How long an acceleration takes to build up [s].
    within : float
        Allowed relative error of the feed, except in run-up, run-down and rounded corners: a
        certificate judges it.
    stretches : (M, 2), optional
        Times of the original [s], increasing, and the feed from each of them on [m/s], `feed`
        before the first. Before a slower feed starts, the tool has slowed down.
    required : bool
        Whether the feed has to be reached. Where it need not, as of retracts, it is a bound: the
        tool is as fast as the limits allow up to it, and `feeds` has none.

    Raises
    ------
    PathError
        A number is not above 0, or the path has a rest inside.
    """

    def __init__(
        self,
        path: Path,
        feed: float,
        *,
        turn_rate: float = 1.0,
        acceleration: float = 1.0,
        turn_acceleration: float = 10.0,
        smoothing: float = 0.05,
        within: float = 0.02,
        stretches: npt.ArrayLike | None = None,
        required: bool = True,
    ) -> None:
        self._path = check_path(path, "feed: path").at_constant_speed()
        self.required = as_flag(required, "feed: required", PathError)
        given = {
            "feed": feed,
            "turn_rate": turn_rate,
            "acceleration": acceleration,
            "turn_acceleration": turn_acceleration,
            "smoothing": smoothing,
        }
        self._limits = {
            name: as_number(value, f"feed: {name}", above=0.0, error=PathError)
            for name, value in given.items()
        }
        self._own_feed = self._limits["feed"]
        self._asked = self._checked(stretches)
        # Elsewhere it is below the fastest one.
        self._limits["feed"] = float(self._asked[:, 1].max())
        if self.feed > _FASTEST:
            raise PathError(
                f"feed: {self.feed:g} m/s is faster than any arm, expected at most {_FASTEST:g}: "
                f"feeds are in m/s, not mm/s"
            )
        self._within = as_number(within, "feed: within", above=0.0, most=1.0, error=PathError)
        self.duration = float(self._paces[-1][1])

    def _checked(self, stretches: npt.ArrayLike | None) -> Array:
        """Return the start times of the feeds, with that of the first, (M + 1, 2)."""
        table = as_numbers(
            [] if stretches is None else stretches, "feed: stretches", error=PathError
        )
        if stretches is not None and (table.ndim != 2 or table.shape[1] != 2 or not len(table)):
            raise PathError(f"feed: stretches have shape {table.shape}, expected (M, 2)")
        table = table.reshape(-1, 2)
        times = np.append(table[:, 0], self._path.duration)
        if not (np.all(np.diff(times) > 0.0) and times[0] >= 0.0 and np.all(table[:, 1] > 0.0)):
            raise PathError(
                f"feed: stretches begin at {table[:, 0].tolist()} s with {table[:, 1].tolist()} "
                f"m/s, expected times that increase from 0 on and end before "
                f"{self._path.duration:.6g} s, and feeds above 0"
            )
        if len(table) and table[0, 0] == 0.0:
            self._own_feed = float(table[0, 1])
            return table
        return read_only(np.vstack([[0.0, self._own_feed], table]))

    @property
    def feed(self) -> float:
        """Speed of the tool without limits in its way [m/s]; the fastest of several feeds."""
        return self._limits["feed"]

    @property
    def rest_times(self) -> Array:
        """When the tool rests: at both ends and in kinks [s]."""
        return read_only([self._paces[0][0], *(end for _, end, _ in self._paces)])

    @cached_property
    @override
    def knots(self) -> Array:
        """When those of the original are passed."""
        return self._moved(self._path.knots)

    @cached_property
    @override
    def marks(self) -> Array:
        inner = [pace.t + start for start, _, pace in self._paces]
        # Length over time, and time over length, are splines.
        inner.append(self._moved(np.union1d(self._path.marks, self._nodes.breaks)))
        return _separate(np.concatenate(inner), self.duration)

    def _moved(self, wanted: Array) -> Array:
        """Return when times of the original are passed, from first to last, and rests."""
        passed = self.when(wanted)[1:-1]
        return _separate(np.concatenate([passed, self.rest_times]), self.duration)

    def when(self, wanted: Array) -> Array:
        """Return when times (K,) of the original are passed [s]."""
        ends = np.zeros(len(wanted)), np.full(len(wanted), self.duration)
        return times_when(lambda t: self.pace(t)[0], wanted, *ends)

    def pace(self, t: Array) -> tuple[Array, Array]:
        """Return the original's time σ and dσ/dt at times `t` (K,)."""
        reached, rate = np.empty(len(t)), np.empty(len(t))
        for here, own, pace in self._sections(t):
            reached[here], rate[here] = pace(own), np.maximum(pace(own, 1), 0.0)
        sigma = np.clip(self._nodes.time_at(reached), 0.0, self._path.duration)
        return sigma, rate * np.maximum(self._nodes.time_at(reached, nu=1), 0.0)

    def _sections(self, t: Array) -> Iterator[tuple[Array, Array, Pace]]:
        """Yield for each section the mask of times (K,) in it, its own times, and its pace."""
        which = np.searchsorted([end for _, end, _ in self._paces[:-1]], t, side="right")
        for number, (start, end, pace) in enumerate(self._paces):
            here = which == number
            yield here, np.clip(t[here] - start, 0.0, end - start), pace

    @override
    def series(self, middle: Array, half: Array) -> PathSeries | None:
        """Return the original's time over the length, that over time."""
        reached, length = np.empty(len(middle)), np.empty((series.LENGTH, len(middle)))
        for here, own, pace in self._sections(middle):
            reached[here], length[:, here] = pace(own), pace.series(own, half[here])
        reach = series.after_first(length)
        reach = np.where(reach > 0.0, reach, 1.0)
        spline = self._nodes.time_at
        part = series.of_pieces(spline.x, spline.c[::-1], reached, reach)
        sigma = series.composed(series.of_polynomial(part), length / reach)
        return self._series_at(np.clip(spline(reached), 0.0, self._path.duration), sigma)

    @override
    def evaluate(self, t: Array) -> PathSamples:
        # In a kink the original has two directions, but the tool rests.
        return self._at_pace(t, *self.pace(t))

    @cached_property
    def _nodes(self) -> FeedNodes:
        return FeedNodes(self._path, self._limits, self._asked)

    @cached_property
    def _paces(self) -> list[tuple[float, float, Pace]]:
        """Start, end and pace of each section from rest to rest, the pace over the length."""
        stretches, start = [], 0.0
        for _, ramp, _ in self._nodes.ramps:
            pace = ramp.smoothed(self._limits["smoothing"])
            end = start + float(pace.t[-1])
            stretches.append((start, end, pace))
            start = end
        return stretches

    @cached_property
    @override
    def feeds(self) -> tuple[FeedProfile, ...]:
        """Errors of its own feeds, each in its interval."""
        if not self.required:
            return ()
        t, required, causes, asked = self._required_at
        speeds, durations = twist_sizes(self.samples(t).twist)[:, 0], np.gradient(t)
        begins = np.array([0.0, *self.when(self._asked[1:, 0]), self.duration])
        during = np.stack([begins[:-1], begins[1:]], axis=1)
        profiles = []
        for feed in dict.fromkeys(self._asked[:, 1].tolist()):
            here = asked == feed
            profiles.append(
                FeedProfile(
                    asked=feed,
                    within=self._within,
                    during=read_only(during[self._asked[:, 1] == feed]),
                    t=read_only(t[here]),
                    speeds=read_only(speeds[here]),
                    durations=read_only(durations[here]),
                    required=required[here],
                    causes=tuple(np.array(causes)[here].tolist()),
                    path=self,
                    path_times=read_only(t[here]),
                    rows=np.flatnonzero(here),
                )
            )
        return tuple(profiles)

    @property
    def _required_at(self) -> tuple[Array, Flags, list[str], Array]:
        """Return times of nodes (K,), whether the feed is required, limiting cause, and feed."""
        nodes, window = self._nodes, self._limits["smoothing"]
        sigma, causes, corners = nodes.sigma, nodes.causes, self._path.rounded
        inside = (sigma[:, None] >= corners[:, 0]) & (sigma[:, None] <= corners[:, 1])
        free = (inside.any(axis=1) | nodes.turns_on_the_spot)[nodes.narrowest]
        times, exempt, limits, asked = [], [], [], []
        for (part, pace, anchors), (start, _, _) in zip(nodes.ramps, self._paces, strict=True):
            is_exempt, feeds = free[part].copy(), nodes.feeds[part]
            is_exempt[[0, -1]] = True
            times.append(start + pace.t + 0.5 * window)
            # Changes of feed are ramps, like the ends.
            slower = nodes.feeds[nodes.narrowest][part][anchors] < feeds
            exempt.append(is_exempt[anchors] | slower)
            limits += [causes[part][k] for k in anchors]
            asked.append(feeds)
        t, rests = np.concatenate(times), np.concatenate(exempt)
        # From there to the next node the pace changes, and near that its mean does.
        rests = np.convolve(rests, np.ones(3), mode="same") > 0.0
        before = np.append(0, np.cumsum(rests))
        near = [np.searchsorted(t, t + side * 1.5 * window) for side in (-1, 1)]
        required = before[near[1]] == before[near[0]]
        return np.clip(t, 0.0, self.duration), required, limits, np.concatenate(asked)

    @property
    def limits(self) -> Mapping[str, float]:
        """Turn rate, accelerations and smoothing, by their names, and the fastest feed."""
        return self._limits

    def changed(self, feeds: Mapping[float, float], **limits: float) -> Feed:
        """Return the same with some feeds replaced [m/s], and other limits by name."""
        asked = self._asked.copy()
        for old, new in feeds.items():
            asked[self._asked[:, 1] == old, 1] = new
        changed = {**self._limits, **limits, "feed": float(asked[0, 1])}
        stretches = asked if len(asked) > 1 else None
        return self._like(self._path, changed, stretches)

    def along(self, path: Path, later: float) -> Feed:
        """Return the same along a longer path, on which the original starts `later` [s].

        Before it the first feed applies.
        """
        asked = self._asked + np.array([later, 0.0])
        changed = {**self._limits, "feed": float(asked[0, 1])}
        stretches = asked[1:] if len(asked) > 1 else None
        return self._like(path, changed, stretches)

    def slower(self, factor: float) -> Feed:
        """Return the same motion, taking `factor` times as long.

        Feed and turn rate are smaller by the factor, accelerations by its square, and the smoothing
        is longer.
        """
        factor = as_number(factor, "feed: factor", above=0.0, error=PathError)
        powers = {"acceleration": 2, "turn_acceleration": 2, "smoothing": -1}
        limits = {name: own / factor ** powers.get(name, 1) for name, own in self._limits.items()}
        limits["feed"] = self._own_feed / factor
        stretches = self._asked / [1.0, factor] if len(self._asked) > 1 else None
        return self._like(self._path, limits, stretches)

    def _like(self, path: Path, limits: Mapping[str, float], stretches: Any) -> Feed:
        """Return another path with other limits and the same requirements."""
        return Feed(
            path, **limits, within=self._within, stretches=stretches, required=self.required
        )

    @override
    def to_dict(self) -> dict[str, Any]:
        described: dict[str, Any] = {**self._limits, "feed": self._own_feed, "within": self._within}
        if len(self._asked) > 1:
            described["stretches"] = self._asked.tolist()
        if not self.required:
            described["required"] = False
        return {"kind": self.kind, "path": self._path.to_dict(), **described}


def _separate(times: Array, duration: float) -> Array:
    """Return times in order, but for those that differ by rounding."""
    unique = np.unique(np.clip(times, 0.0, duration))
    unique = unique[np.append(True, np.diff(unique) > 1e-9 * duration)]
    unique[-1] = duration
    return read_only(unique)


# Share of the allowed error that a recommended feed leaves to the tool.
_LEFT = 0.5
# Attempts at feeds …
_LESS = 20
# … and at limits.
_MORE = 3
# Factor above the recommended feed at which a feed has to fail.
_NEAR = 1.05
# Factor by which limits are raised above the necessary.
_OVER = 1.02
# Smallest relative gain of a limit that is recommended.
_GAIN = 0.3
# Largest acceleration that is recommended [m/s²].
_WILD = 100.0
# Share of its feed below which the tool rests.
_RESTS = 1e-6
# Digits of recommended numbers.
_DIGITS = 3
# Powers of the feed by which accelerations and turn rates grow.
_POWERS = {"acceleration": 2, "turn_acceleration": 2, "turn_rate": 1}
_UNITS = {"acceleration": "m/s²", "turn_acceleration": "rad/s²", "turn_rate": "rad/s"}
# Order in which limits are tried.
_FIRST = {
    "the turn rate": "turn_rate",
    "the turn acceleration in a bend": "turn_acceleration",
}


@dataclass(frozen=True, eq=False)
class FeedPossible:
    """Feeds and limits that are possible where a path does not keep a feed, for any arm.

    Attributes
    ----------
    found : FeedProfile
        The given feed and the reached one.
    """

    found: FeedProfile

    @cached_property
    def feed(self) -> float | None:
        """The largest feed of three digits that is kept [m/s]; None if none was found.

        From above, each feed that is not kept leads to its slowest speed. From the first that is
        kept it increases while one that is larger by a twentieth is kept, too: where corners are
        slower, a lower feed has a longer run-up.
        """
        own, feed = self.found, self.found.asked
        for _ in range(_LESS):
            if own.slowest <= _RESTS * feed:
                return None
            if _leaves(own):
                return self._larger(feed)
            lower = _rounded(own.slowest, down=True)
            # The error may be smaller than the share that is left to the tool.
            feed = lower if lower < feed else _rounded(feed * (1.0 - 1e-2), down=True)
            own = self._at(feed)
        return None

    def _larger(self, feed: float) -> float:
        """Return a feed that is kept, while a larger one is not."""
        larger = _rounded(_NEAR * feed, down=True)
        while larger < self.found.asked and _leaves(self._at(larger)):
            feed, larger = larger, _rounded(_NEAR * larger, down=True)
        return feed

    def _at(self, feed: float) -> FeedProfile:
        """Return the errors of another feed."""
        return _kept_by(self.found.path.changed({self.found.asked: feed}), feed)

    @cached_property
    def limits(self) -> dict[str, float]:
        """Limits of the path with which the feed is kept, by name; none if not found.

        The limiting one alone before all of them.
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
        """Return the error of a path's feed in words: where, the cause, and remedies."""
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
        """Relative error that would have to be allowed."""
        share = 1.0 - self.found.slowest / self.found.asked
        return min(_rounded(1.01 * share + 1e-3, down=False), 1.0)

    @property
    def remedies(self) -> str:
        """Remedies, in words."""
        said = [] if self.feed is None else [f"ask for {self.feed:g} m/s"]
        if self.limits:
            named = (
                f"{name.replace('_', ' ')} of {value:g} {_UNITS[name]} ({name}={value:g})"
                for name, value in self.limits.items()
            )
            said.append(f"let the path have {'an ' * (len(self.limits) == 1)}{' and '.join(named)}")
        if self.found.held_by.startswith("run-up"):
            said.append("give it more way to run up (longer legs, rounder corners)")
        return ", or ".join([*said, f"allow it more (within={self.within:g})"])


def _leaves(found: FeedProfile) -> bool:
    """Return whether a feed is kept with room for the tool."""
    return found.kept and found.left_over >= _LEFT * found.within * found.asked * (1.0 - 1e-9)


def _kept_by(path: Feed, feed: float) -> FeedProfile:
    """Return the errors of one of a path's feeds."""
    return next(item for item in path.feeds if item.asked == feed)


def _rounded(value: float, *, down: bool) -> float:
    """Return a number of three digits that is no larger, or no smaller."""
    digits = _DIGITS - 1 - floor(log10(value))
    scaled = value * 10.0**digits
    # Numbers of three digits up to rounding are unchanged.
    whole = floor(scaled * (1.0 + 1e-12)) if down else ceil(scaled * (1.0 - 1e-12))
    return float(f"{whole * 10.0**-digits:.{_DIGITS}g}")

"""A path at a constant feed."""

from collections.abc import Iterator
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    Array,
    Flags,
    Ints,
    PathError,
    as_number,
    as_numbers,
    read_only,
    series,
)
from selfmotion.path.base import STILL, Path, PathSamples, PathSeries, _Derived, check_path
from selfmotion.path.feed_kept import FeedKept
from selfmotion.path.pace import Pace, times_along, times_when

# What holds a tool that is slower than its feed.
_CAUSES = "the turn rate", "the acceleration in a bend", "the turn acceleration in a bend"
# Nodes of the pace between two knots of the original, at least.
_FEWEST = 16
# Nodes of the pace in all, about: a feed is kept between them as far as splines through them do.
_ABOUT = 1000
# How far from a node, by the distance of knots, the original's accelerations are measured.
_BESIDE = 1e-4
# How far from a knot it is measured whether the twist jumps there.
_AT = 1e-8
# The pace of the original is followed between nodes to this share, by so many halvings at most.
_ROUGH, _FINER = 0.05, 12
# Halvings by which it is found where the turn rate begins to hold the tool, and how near to a node,
# as a share of the way to the next one, that is the node.
_HALVINGS, _CLOSE = 40, 1e-6
# Faster feeds [m/s] are slips of units.
_FASTEST = 3.0
# A tool that is slower than this share of what it may be rests.
_RESTS = 1e-6
# The twist before and after a knot may differ by this share of it: by rounding.
_KINK = 1e-6


class Feed(_Derived, kind="feed"):
    """A path at a constant feed, from rest to rest.

    The tool keeps its feed wherever turn rate and accelerations allow: it is slower in bends, at
    both ends, and rests where the path has a kink. As much of the acceleration as is spent on
    bends, and as much as is spent on changes of speed, is at most half of what is allowed.

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
        What may be missing of the feed, as a share, but in run-up, run-down and rounded corners:
        a certificate judges that.
    stretches : (M, 2), optional
        Times of the original [s], increasing, and the feed from each of them on [m/s], `feed`
        before the first. The tool runs up to a faster feed, and down to a slower one before that
        begins.

    Raises
    ------
    PathError
        A number is not above 0, or the path rests on its way.
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
    ) -> None:
        self._path = check_path(path, "feed: path").at_constant_speed()
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
        # Elsewhere it is held below the fastest one.
        self._limits["feed"] = float(self._asked[:, 1].max())
        if self.feed > _FASTEST:
            raise PathError(
                f"feed: {self.feed:g} m/s is faster than any arm, expected at most {_FASTEST:g}: "
                f"feeds are in m/s, not mm/s"
            )
        self._within = as_number(within, "feed: within", above=0.0, most=1.0, error=PathError)
        self.duration = float(self._paces[-1][1])

    def _checked(self, stretches: npt.ArrayLike | None) -> Array:
        """Return when which feed begins, with that of the start, (M + 1, 2)."""
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
        """Speed of the tool where nothing is in its way [m/s]; of several feeds the fastest."""
        return self._limits["feed"]

    @property
    def rest_times(self) -> Array:
        """When the tool rests: at both ends and in kinks [s]."""
        return read_only([self._paces[0][0], *(end for _, end, _ in self._paces)])

    @cached_property
    def knots(self) -> Array:
        """See `Path.knots`: when those of the original are passed."""
        return self._moved(self._path.knots)

    @cached_property
    def marks(self) -> Array:
        """See `Path.marks`."""
        inner = [pace.t + start for start, _, pace in self._paces]
        # The length as a function of time, and time as one of the length, are splines.
        inner.append(self._moved(np.union1d(self._path.marks, self._sigma)))
        return _apart(np.concatenate(inner), self.duration)

    def _moved(self, wanted: Array) -> Array:
        """Return when times of the original are passed, from first to last, and rests."""
        passed = self.when(wanted)[1:-1]
        return _apart(np.concatenate([passed, self.rest_times]), self.duration)

    def when(self, wanted: Array) -> Array:
        """Return when times (K,) of the original are passed [s]."""
        ends = np.zeros(len(wanted)), np.full(len(wanted), self.duration)
        return times_when(lambda t: self.pace(t)[0], wanted, *ends)

    @property
    def original(self) -> Path:
        """The path at its own pace."""
        return self._path

    def pace(self, t: Array) -> tuple[Array, Array]:
        """Return the original's time σ and dσ/dt at times `t` (K,)."""
        reached, rate = np.empty(len(t)), np.empty(len(t))
        for here, own, pace in self._stretches(t):
            reached[here], rate[here] = pace(own), np.maximum(pace(own, 1), 0.0)
        sigma = np.clip(self._original(reached), 0.0, self._path.duration)
        return sigma, rate * np.maximum(self._original(reached, nu=1), 0.0)

    def _stretches(self, t: Array) -> Iterator[tuple[Array, Array, Pace]]:
        """Yield for each stretch which of times (K,) lie in it, its own times, and its pace."""
        which = np.searchsorted([end for _, end, _ in self._paces[:-1]], t, side="right")
        for number, (start, end, pace) in enumerate(self._paces):
            here = which == number
            yield here, np.clip(t[here] - start, 0.0, end - start), pace

    def series(self, middle: Array, half: Array) -> PathSeries | None:
        """See `Path.series`: the original's time over the length, that over time."""
        reached, length = np.empty(len(middle)), np.empty((series.LENGTH, len(middle)))
        for here, own, pace in self._stretches(middle):
            reached[here], length[:, here] = pace(own), pace.series(own, half[here])
        reach = series.after_first(length)
        reach = np.where(reach > 0.0, reach, 1.0)
        spline = self._original
        part = series.of_pieces(spline.x, spline.c[::-1], reached, reach)
        sigma = series.composed(series.of_polynomial(part), length / reach)
        return self._series_at(np.clip(spline(reached), 0.0, self._path.duration), sigma)

    def evaluate(self, t: Array) -> PathSamples:
        """See `Path.evaluate`."""
        # In a kink the original has two directions, but the tool rests.
        return self._at_pace(t, *self.pace(t))

    @cached_property
    def _paces(self) -> list[tuple[float, float, Pace]]:
        """Start, end and pace of each stretch from rest to rest, the pace over `_lengths`."""
        sigma, lengths = self._sigma, self._lengths
        stretches, start = [], 0.0
        for first, last in pairwise(np.searchsorted(sigma, self._stops)):
            part = slice(first, last + 1)
            most, gain = self._most[part], self._gain[part]
            pace = _ramped(lengths[part], most, gain)[0].smoothed(self._limits["smoothing"])
            end = start + float(pace.t[-1])
            stretches.append((start, end, pace))
            start = end
        return stretches

    @cached_property
    def _stops(self) -> list[float]:
        """The original's times between which it has no kink."""
        knots = self._path.knots
        inner = knots[1:-1]
        if not len(inner):
            return [0.0, self._path.duration]
        beside = _AT * np.diff(knots)
        before = self._path.samples(inner - beside[:-1]).twist
        after = self._path.samples(inner + beside[1:]).twist
        jump = np.abs(after - before).max(axis=1)
        size = np.maximum(np.abs(before), np.abs(after)).max(axis=1)
        kinks = inner[jump > _KINK * size + STILL]
        return [0.0, *kinks.tolist(), self._path.duration]

    @cached_property
    def _sigma(self) -> Array:
        """The original's times at the nodes, (K,)."""
        parts = []
        for start, end in pairwise(self._path.knots):
            count = max(_FEWEST, int(np.ceil(_ABOUT * (end - start) / self._path.duration)))
            parts.append(np.linspace(start, end, count, endpoint=False))
        sigma = np.append(np.concatenate(parts), self._path.duration)
        for _ in range(_FINER):
            middle, share = 0.5 * (sigma[:-1] + sigma[1:]), self._share_of(sigma)
            between, found = 0.5 * (share[:-1] + share[1:]), self._share_of(middle)
            rough = np.abs(found - between) > _ROUGH * found
            if not rough.any():
                break
            # Where the tool all but rests, its pace changes much faster than elsewhere.
            sigma = np.union1d(sigma, middle[rough])
        return self._with_changes(self._with_crossings(sigma))

    def _with_changes(self, sigma: Array) -> Array:
        """Return nodes, and where feeds change; however short, a stretch has one of its own."""
        if len(self._asked) == 1:
            return sigma
        changes = np.append(self._asked[:, 0], self._path.duration)
        apart = np.abs(sigma[:, None] - changes).min(axis=1)
        inner = sigma[apart > _CLOSE * np.diff(changes).min()]
        empty = np.diff(np.searchsorted(inner, changes)) == 0
        between = 0.5 * (changes[:-1] + changes[1:])[empty]
        return np.union1d(changes, np.append(inner, between))

    def _with_crossings(self, sigma: Array) -> Array:
        """Return nodes, and where the turn rate begins or ends to hold the tool: a kink of σ(λ)."""
        turns = self._turns(sigma)
        (cells,) = np.nonzero(turns[:-1] != turns[1:])
        early, late, before = sigma[cells], sigma[cells + 1], turns[cells]
        for _ in range(_HALVINGS):
            middle = 0.5 * (early + late)
            same = self._turns(middle) == before
            early, late = np.where(same, middle, early), np.where(same, late, middle)
        widths = np.minimum(late - sigma[cells], sigma[cells + 1] - late)
        return np.union1d(sigma, late[widths > _CLOSE * np.diff(sigma)[cells]])

    def _turns(self, sigma: Array) -> Flags:
        """Return at which times (K,) the turn rate holds the tool, rather than the feed."""
        speeds = _sizes(self._path.samples(sigma).twist)
        allowed = np.array([self._limits["feed"], self._limits["turn_rate"]])
        return np.asarray(np.diff(speeds / allowed, axis=1)[:, 0] > 0.0)

    @cached_property
    def _shares(self) -> Array:
        """What the original's own pace takes of the feed or the turn rate at the nodes, (K,)."""
        share = self._share_of(self._sigma)
        if share.min() <= _RESTS * share.max():
            at = self._sigma[int(np.argmin(share))]
            raise PathError(
                f"feed: the path rests at {at:.6g} s of its own time, where it has no direction; "
                f"take one that does not rest (Polyline, corners='blend'), or join several: "
                f"Feed(first, …) + Dwell(…) + Feed(second, …)"
            )
        return share

    def _share_of(self, sigma: Array) -> Array:
        speeds = _sizes(self._path.samples(sigma).twist)
        allowed = np.array([self._limits["feed"], self._limits["turn_rate"]])
        return np.asarray((speeds / allowed).max(axis=1))

    @cached_property
    def _lengths(self) -> Array:
        """How long the way to each node takes at the feed [s], (K,), by Simpson's rule."""
        sigma, share = self._sigma, self._shares
        middle = self._share_of(0.5 * (sigma[:-1] + sigma[1:]))
        parts = np.diff(sigma) * (share[:-1] + 4.0 * middle + share[1:]) / 6.0
        return np.append(0.0, np.cumsum(parts))

    @cached_property
    def _original(self) -> Any:
        """The original's time as a function of the length."""
        from scipy.interpolate import CubicHermiteSpline

        return CubicHermiteSpline(self._lengths, self._sigma, 1.0 / self._shares)

    @cached_property
    def _bends(self) -> Array:
        """|dv/dλ| and |dω/dλ| over the length λ with velocities per length too, (K, 2)."""
        sigma, share = self._sigma, self._shares[:, None]
        beside = float(_BESIDE * np.diff(self._path.knots).min())
        inner = np.clip(sigma, sigma[0] + beside, sigma[-1] - beside)
        early, here, late = (
            self._path.samples(at).twist / self._share_of(at)[:, None]
            for at in (inner - beside, inner, inner + beside)
        )
        # Before and after by themselves: where the turn rate begins to hold, they differ.
        sides = (_sizes((b - a) / beside / share) for a, b in ((early, here), (here, late)))
        return np.maximum(*sides)

    @cached_property
    def _caps(self) -> Array:
        """What the square of the pace may be by feed and accelerations, (K, 3)."""
        bends = 1.0 / np.maximum(self._bends / self._half, 1e-300)
        if len(self._asked) == 1:
            return np.hstack([np.ones((len(bends), 1)), bends])
        speeds = _sizes(self._path.samples(self._sigma).twist)[:, :1] / self._shares[:, None]
        slower = self._feeds_at_nodes[:, None] / np.maximum(speeds, _RESTS * self.feed)
        return np.hstack([np.minimum(slower, 1.0) ** 2, bends])

    @cached_property
    def _feeds_at_nodes(self) -> Array:
        """The feed that is asked for at each node, where it changes the slower one, (K,)."""
        times, feeds = self._asked.T
        after = feeds[np.searchsorted(times, self._sigma, side="right") - 1]
        before = feeds[np.maximum(np.searchsorted(times, self._sigma) - 1, 0)]
        return np.asarray(np.minimum(before, after))

    @cached_property
    def _most(self) -> Array:
        """What the square of the pace may be by the feed and by bends near each node, (K,)."""
        most: Array = self._caps.min(axis=1)[self._narrowest]
        return most

    @cached_property
    def _narrowest(self) -> Ints:
        """The node near each one at which the pace may be least, (K,)."""
        most = self._caps.min(axis=1)
        # What is kept half a window before and after is kept by the mean in the middle.
        lengths, reach = self._lengths, 0.5 * self._limits["smoothing"] * np.sqrt(most)
        before = later = lengths
        if len(self._asked) > 1:
            # A feed changes at one node: between the two beside it the pace does, too.
            before, later = np.append(lengths[0], lengths[:-1]), np.append(lengths[1:], lengths[-1])
        first = np.searchsorted(lengths, before - reach)
        after = np.searchsorted(lengths, later + reach, side="right")
        pairs = zip(first, after, strict=True)
        return np.array([k + int(np.argmin(most[k:m])) for k, m in pairs])

    @cached_property
    def _gain(self) -> Array:
        """How much the square of the pace may change per length by changes of speed, (K,)."""
        speeds = _sizes(self._path.samples(self._sigma).twist) / self._shares[:, None]
        return np.asarray(2.0 / np.maximum((speeds / self._half).max(axis=1), 1e-300))

    @cached_property
    def feeds(self) -> tuple[FeedKept, ...]:
        """See `Path.feeds`: how well its own feeds are kept, each where it is asked for."""
        t, counts, causes, asked = self._counted
        speeds, lasts = _sizes(self.samples(t).twist)[:, 0], np.gradient(t)
        begins = np.array([0.0, *self.when(self._asked[1:, 0]), self.duration])
        during = np.stack([begins[:-1], begins[1:]], axis=1)
        found = []
        for feed in dict.fromkeys(self._asked[:, 1].tolist()):
            here = asked == feed
            found.append(
                FeedKept(
                    *(feed, self._within, read_only(during[self._asked[:, 1] == feed])),
                    *(read_only(t[here]), read_only(speeds[here]), read_only(lasts[here])),
                    *(counts[here], tuple(np.array(causes)[here].tolist())),
                )
            )
        return tuple(found)

    @property
    def _counted(self) -> tuple[Array, Flags, list[str], Array]:
        """Return when nodes are passed (K,), whether the feed counts, what holds it, and which."""
        sigma, window = self._sigma, self._limits["smoothing"]
        speeds = _sizes(self._path.samples(sigma).twist) / self._shares[:, None]
        causes = [_CAUSES[k] for k in np.argmin(self._caps, axis=1)[self._narrowest]]
        feeds = self._feeds_at_nodes
        turning = speeds[:, 0] < (1.0 - 0.5 * self._within) * feeds
        corners = self._path.rounded
        inside = (sigma[:, None] >= corners[:, 0]) & (sigma[:, None] <= corners[:, 1])
        free = (inside.any(axis=1) | (speeds[:, 0] <= _RESTS * self.feed))[self._narrowest]
        times, exempt, held = [], [], []
        stops = np.searchsorted(sigma, self._stops)
        for (first, last), (start, _, _) in zip(pairwise(stops), self._paces, strict=True):
            part = slice(first, last + 1)
            pace, anchors = _ramped(self._lengths[part], self._most[part], self._gain[part])
            own = free[part].copy()
            own[[0, -1]] = True
            times.append(start + pace.t + 0.5 * window)
            # Down to a slower feed, and up from one, the tool runs as at the ends.
            slower = feeds[self._narrowest][part][anchors] < feeds[part]
            exempt.append(own[anchors] | slower)
            held += [causes[first + k] for k in anchors]
        t, rests = np.concatenate(times), np.concatenate(exempt)
        # From there to the next node the pace changes, and near that its mean does.
        rests = np.convolve(rests, np.ones(3), mode="same") > 0.0
        before = np.append(0, np.cumsum(rests))
        near = [np.searchsorted(t, t + side * 1.5 * window) for side in (-1, 1)]
        counts = before[near[1]] == before[near[0]]
        every = np.concatenate([turning[a : b + 1] for a, b in pairwise(stops)])
        named = [
            "the turn rate" if x and y == _CAUSES[0] else y
            for x, y in zip(every, held, strict=True)
        ]
        asked = np.concatenate([feeds[a : b + 1] for a, b in pairwise(stops)])
        return np.clip(t, 0.0, self.duration), counts, named, asked

    @property
    def _half(self) -> Array:
        return 0.5 * np.array([self._limits["acceleration"], self._limits["turn_acceleration"]])

    def slower(self, factor: float) -> "Feed":
        """Return the same motion, taking `factor` times as long.

        Feed and turn rate are smaller by the factor, accelerations by its square, and the smoothing
        is longer.
        """
        factor = as_number(factor, "feed: factor", above=0.0, error=PathError)
        powers = {"acceleration": 2, "turn_acceleration": 2, "smoothing": -1}
        limits = {name: own / factor ** powers.get(name, 1) for name, own in self._limits.items()}
        limits["feed"] = self._own_feed / factor
        stretches = self._asked / [1.0, factor] if len(self._asked) > 1 else None
        return Feed(self._path, **limits, within=self._within, stretches=stretches)

    def to_dict(self) -> dict[str, Any]:
        """See `Saved.to_dict`."""
        described: dict[str, Any] = {**self._limits, "feed": self._own_feed, "within": self._within}
        if len(self._asked) > 1:
            described["stretches"] = self._asked.tolist()
        return {"kind": self.kind, "path": self._path.to_dict(), **described}


def _sizes(twists: Array) -> Array:
    """Return the sizes of the linear and the angular part of (K, 6), (K, 2)."""
    parts = twists[:, :3], twists[:, 3:]
    return np.stack([np.sqrt(np.sum(part**2, axis=1)) for part in parts], axis=1)


def _ramped(lengths: Array, most: Array, gain: Array) -> tuple[Pace, Ints]:
    """Return the largest pace from rest to rest, its square ≤ `most`, changing by ≤ `gain`.

    And for each node which one limits its pace: itself, or one that it is run up from or down to.
    """
    limiting = np.arange(len(lengths))
    squared = most.copy()
    squared[0] = squared[-1] = 0.0
    steps = np.diff(lengths) * np.minimum(gain[:-1], gain[1:])
    for k in range(len(steps)):
        if squared[k] + steps[k] < squared[k + 1]:
            squared[k + 1], limiting[k + 1] = squared[k] + steps[k], limiting[k]
    for k in reversed(range(len(steps))):
        if squared[k + 1] + steps[k] < squared[k]:
            squared[k], limiting[k] = squared[k + 1] + steps[k], limiting[k + 1]
    rates = np.sqrt(squared)
    return Pace(times_along(lengths, rates), lengths, rates), limiting


def _apart(times: Array, duration: float) -> Array:
    """Return times in order, but for those that differ by rounding."""
    unique = np.unique(np.clip(times, 0.0, duration))
    unique = unique[np.append(True, np.diff(unique) > 1e-9 * duration)]
    unique[-1] = duration
    return read_only(unique)

"""Limits of the pace of a tool at nodes along a path."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from selfmotion.basics import Array, Flags, Ints, PathError
from selfmotion.model.path.base import REST_SPEED, Path
from selfmotion.model.path.pace import Pace, largest_pace

# Limiting causes of a tool that is slower than its feed.
_CAUSES = "the turn rate", "the acceleration in a bend", "the turn acceleration in a bend"
# Smallest number of nodes between two knots of the original.
_MIN_NODES = 16
# Approximate number of nodes: between them a feed is as accurate as splines.
_ABOUT = 1000
# Distance from a node at which accelerations are evaluated, relative to that of knots.
_BESIDE = 1e-4
# Distance from a knot at which jumps of the twist are evaluated, likewise.
_AT = 1e-8
# Relative accuracy of the original's pace between nodes …
_ROUGH = 0.05
# … and largest number of halvings for it.
_FINER = 24
# Relative difference of the tool's speed half way between two nodes.
_UNEVEN = 2e-3
# Largest slope of a monotone spline, in multiples of the smaller neighbouring chord's.
_STEEPEST = 3.0
# Bisections of the point from which on the turn rate limits the tool …
_HALVINGS = 40
# … and its distance from a node that counts as the node, as a share of the interval.
_CLOSE = 1e-6
# Share of the allowed speed below which the tool rests.
_RESTS = 1e-6
# Relative jump of the twist at a knot that counts as rounding.
_KINK = 1e-6


@dataclass(frozen=True, eq=False)
class FeedNodes:
    """Nodes along a path, and the pace that a feed and its limits allow there.

    The pace is dλ/dt over the length λ of the path, measured by the time that it takes at the feed.

    Attributes
    ----------
    path : Path
        At a pace of its own.
    limits : dict
        Those of a `Feed`, by name.
    asked : (M, 2)
        Start times of the path's feeds [s], and the feeds [m/s].
    """

    path: Path
    limits: Mapping[str, float]
    asked: Array

    @cached_property
    def _stops(self) -> list[float]:
        """The original's times between which it has no kink."""
        knots = self.path.knots
        inner = knots[1:-1]
        if not len(inner):
            return [0.0, self.path.duration]
        beside = _AT * np.diff(knots)
        before = self.path.samples(inner - beside[:-1]).twist
        after = self.path.samples(inner + beside[1:]).twist
        jump = np.abs(after - before).max(axis=1)
        size = np.maximum(np.abs(before), np.abs(after)).max(axis=1)
        kinks = inner[jump > _KINK * size + REST_SPEED]
        return [0.0, *kinks.tolist(), self.path.duration]

    @cached_property
    def sigma(self) -> Array:
        """The original's times at the nodes, (K,)."""
        parts = []
        for start, end in pairwise(self.path.knots):
            count = max(_MIN_NODES, int(np.ceil(_ABOUT * (end - start) / self.path.duration)))
            parts.append(np.linspace(start, end, count, endpoint=False))
        sigma = np.append(np.concatenate(parts), self.path.duration)
        for _ in range(_FINER):
            middle, share = 0.5 * (sigma[:-1] + sigma[1:]), self._share_of(sigma)
            between, found = 0.5 * (share[:-1] + share[1:]), self._share_of(middle)
            rough = np.abs(found - between) > _ROUGH * found
            if not rough.any():
                break
            # Near rests the pace changes much faster than elsewhere.
            sigma = np.union1d(sigma, middle[rough])
        return self._evened(self._with_changes(self._with_crossings(sigma)))

    def _evened(self, sigma: Array) -> Array:
        """Return nodes between which the tool is as fast as at them, with more where it is not."""
        for _ in range(_FINER):
            lengths, slopes = self._along(sigma)
            h, rise = np.diff(lengths), np.diff(sigma)
            if h.min() <= 0.0:
                # It rests there, which is refused.
                break
            # The cubic and its slope half way between two nodes.
            middle = sigma[:-1] + 0.5 * rise + 0.125 * h * (slopes[:-1] - slopes[1:])
            slope = 1.5 * rise / h - 0.25 * (slopes[:-1] + slopes[1:])
            uneven = np.abs(self._share_of(middle) * slope - 1.0) > _UNEVEN
            # Near rests no pace is even.
            uneven &= rise > _CLOSE * np.diff(self.path.knots).min()
            if not uneven.any():
                break
            sigma = np.union1d(sigma, (0.5 * (sigma[:-1] + sigma[1:]))[uneven])
        return sigma

    def _along(self, sigma: Array) -> tuple[Array, Array]:
        """Return the time to each node (K,) at the feed [s], and dσ/dλ, (K,).

        By Simpson's rule. With slopes up to three times those of the chords beside them a spline
        never falls (F. N. Fritsch, R. E. Carlson, SIAM J. Numer. Anal. 17, 1980).
        """
        share = self._share_of(sigma)
        middle = self._share_of(0.5 * (sigma[:-1] + sigma[1:]))
        steps = np.diff(sigma) * (share[:-1] + 4.0 * middle + share[1:]) / 6.0
        chords = np.diff(sigma) / np.maximum(steps, 1e-300)
        beside = np.minimum(np.append(chords, np.inf), np.append(np.inf, chords))
        slopes = np.minimum(1.0 / np.maximum(share, 1e-300), _STEEPEST * beside)
        return np.append(0.0, np.cumsum(steps)), slopes

    def _with_changes(self, sigma: Array) -> Array:
        """Return nodes with changes of feed; however short, an interval has one of its own."""
        if len(self.asked) == 1:
            return sigma
        changes = np.append(self.asked[:, 0], self.path.duration)
        separate = np.abs(sigma[:, None] - changes).min(axis=1)
        inner = sigma[separate > _CLOSE * np.diff(changes).min()]
        empty = np.diff(np.searchsorted(inner, changes)) == 0
        between = 0.5 * (changes[:-1] + changes[1:])[empty]
        return np.union1d(changes, np.append(inner, between))

    def _with_crossings(self, sigma: Array) -> Array:
        """Return nodes with the ends of intervals that the turn rate limits: kinks of σ(λ)."""
        turns = self._turns(sigma)
        (cells,) = np.nonzero(turns[:-1] != turns[1:])
        if not len(cells):
            return sigma
        early, late, before = sigma[cells], sigma[cells + 1], turns[cells]
        for _ in range(_HALVINGS):
            middle = 0.5 * (early + late)
            same = self._turns(middle) == before
            early, late = np.where(same, middle, early), np.where(same, late, middle)
        widths = np.minimum(late - sigma[cells], sigma[cells + 1] - late)
        return np.union1d(sigma, late[widths > _CLOSE * np.diff(sigma)[cells]])

    def _turns(self, sigma: Array) -> Flags:
        """Return at which times (K,) the turn rate holds the tool, rather than the feed."""
        return np.asarray(np.diff(self._shares_of(sigma), axis=1)[:, 0] > 0.0)

    @cached_property
    def _shares(self) -> Array:
        """Shares that the original's own pace uses of feed or turn rate at the nodes, (K,)."""
        share = self._share_of(self.sigma)
        if share.min() <= _RESTS * share.max():
            at = self.sigma[int(np.argmin(share))]
            raise PathError(
                f"feed: the path rests at {at:.6g} s of its own time, where it has no direction; "
                f"take one that does not rest (Polyline, corners='blend'), or join several: "
                f"Feed(first, …) + Dwell(…) + Feed(second, …)"
            )
        return share

    def _share_of(self, sigma: Array) -> Array:
        return np.asarray(self._shares_of(sigma).max(axis=1))

    def _shares_of(self, sigma: Array) -> Array:
        """Return the shares that the original's pace uses of feed and turn rate, (K, 2)."""
        speeds = twist_sizes(self.path.samples(sigma).twist)
        return speeds / [self.limits["feed"], self.limits["turn_rate"]]

    @cached_property
    def speeds(self) -> Array:
        """The sizes of the velocities per length at the nodes, (K, 2) [m/s, rad/s]."""
        return twist_sizes(self.path.samples(self.sigma).twist) / self._shares[:, None]

    @cached_property
    def _spaced(self) -> tuple[Array, Array]:
        """Time to each node at the feed [s], and dσ/dλ there, (K,) each."""
        return self._along(self.sigma)

    @property
    def _lengths(self) -> Array:
        return self._spaced[0]

    @cached_property
    def time_at(self) -> Any:
        """The original's time as a function of the length."""
        from scipy.interpolate import CubicHermiteSpline

        along = self._along_length
        return CubicHermiteSpline(along.t, along.sigma, along.rate)

    @property
    def breaks(self) -> Array:
        """The original's times between which it is one polynomial of the length."""
        return self._along_length.sigma

    @cached_property
    def _along_length(self) -> Pace:
        return Pace(self._lengths, self.sigma, self._spaced[1]).simplified()

    @cached_property
    def _bends(self) -> Array:
        """|dv/dλ| and |dω/dλ| over the length λ with velocities per length too, (K, 2)."""
        sigma, share = self.sigma, self._shares[:, None]
        beside = float(_BESIDE * np.diff(self.path.knots).min())
        inner = np.clip(sigma, sigma[0] + beside, sigma[-1] - beside)
        early, here, late = (
            self.path.samples(at).twist / self._share_of(at)[:, None]
            for at in (inner - beside, inner, inner + beside)
        )
        # Before and after separately: they differ where the turn rate starts to limit.
        sides = (twist_sizes((b - a) / beside / share) for a, b in ((early, here), (here, late)))
        return np.maximum(*sides)

    @cached_property
    def _caps(self) -> Array:
        """Largest square of the pace by feed and accelerations, (K, 3)."""
        bends = 1.0 / np.maximum(self._bends / self._half, 1e-300)
        if len(self.asked) == 1:
            return np.hstack([np.ones((len(bends), 1)), bends])
        slower = self.feeds[:, None] / np.maximum(self.speeds[:, :1], _RESTS * self.limits["feed"])
        return np.hstack([np.minimum(slower, 1.0) ** 2, bends])

    @cached_property
    def feeds(self) -> Array:
        """Feed at each node, at changes the slower one, (K,)."""
        times, feeds = self.asked.T
        after = feeds[np.searchsorted(times, self.sigma, side="right") - 1]
        before = feeds[np.maximum(np.searchsorted(times, self.sigma) - 1, 0)]
        return np.asarray(np.minimum(before, after))

    @cached_property
    def _most(self) -> Array:
        """Largest square of the pace by the feed and by bends near each node, (K,)."""
        most: Array = self._caps.min(axis=1)[self.narrowest]
        return most

    @cached_property
    def narrowest(self) -> Ints:
        """The node near each one at which the pace may be least, (K,)."""
        most = self._caps.min(axis=1)
        # A bound half a window before and after is one of the mean in the middle.
        lengths, reach = self._lengths, 0.5 * self.limits["smoothing"] * np.sqrt(most)
        before = later = lengths
        if len(self.asked) > 1:
            # A feed changes at one node: the pace changes between its neighbours.
            before, later = np.append(lengths[0], lengths[:-1]), np.append(lengths[1:], lengths[-1])
        first = np.searchsorted(lengths, before - reach)
        after = np.searchsorted(lengths, later + reach, side="right")
        return least_within(most, first, after)

    @cached_property
    def _gain(self) -> Array:
        """Largest change of the square of the pace per length, (K,)."""
        return np.asarray(2.0 / np.maximum((self.speeds / self._half).max(axis=1), 1e-300))

    @cached_property
    def ramps(self) -> list[tuple[slice, Pace, Ints]]:
        """Nodes of each section from rest to rest, its pace, and the limiting node of each."""
        found = []
        for first, last in pairwise(np.searchsorted(self.sigma, self._stops)):
            part = slice(int(first), int(last) + 1)
            found.append(
                (part, *largest_pace(self._lengths[part], self._most[part], self._gain[part]))
            )
        return found

    @property
    def causes(self) -> list[str]:
        """Limiting cause at each node where the tool is slower than its feed."""
        return [_CAUSES[k] for k in np.argmin(self._caps, axis=1)[self.narrowest]]

    @property
    def turns_on_the_spot(self) -> Flags:
        """At which nodes the tool all but rests while it turns, (K,)."""
        return np.asarray(self.speeds[:, 0] <= _RESTS * self.limits["feed"])

    @property
    def _half(self) -> Array:
        return 0.5 * np.array([self.limits["acceleration"], self.limits["turn_acceleration"]])


def least_within(values: Array, first: Ints, after: Ints) -> Ints:
    """Return the place of the first least value (K,) in each range from `first` to before `after`.

    By the least of all ranges of 1, 2, 4, … values: of two of these that overlap each range is
    made (M. A. Bender, M. Farach-Colton, "The LCA problem revisited", 2000).
    """
    size = np.frexp(after - first)[1] - 1
    places, least = np.empty(len(first), dtype=np.int64), np.arange(len(values))
    for level in range(int(size.max(initial=-1)) + 1):
        if level:
            least = _lesser(values, least[: -(1 << level - 1)], least[1 << level - 1 :])
        own = size == level
        places[own] = _lesser(values, least[first[own]], least[after[own] - (1 << level)])
    return places


def _lesser(values: Array, places: Ints, others: Ints) -> Ints:
    """Return of each two places the one with the lesser value, the former where they are equal."""
    return np.where(values[others] < values[places], others, places)


def twist_sizes(twists: Array) -> Array:
    """Return the sizes of the linear and the angular part of (K, 6), (K, 2)."""
    parts = twists[:, :3], twists[:, 3:]
    return np.stack([np.sqrt(np.sum(part**2, axis=1)) for part in parts], axis=1)

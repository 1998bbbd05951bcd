"""Poses that a polyline can do without: those that its legs pass within a tolerance.

By the algorithm of Ramer (1972), Douglas and Peucker (1973): a leg from the first pose to the last
is divided at the pose that it misses by most, until it misses none by more than the tolerance. A
pose from which the tool goes back along the leg, or that is turned otherwise, divides it as well.
"""

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from selfmotion.basics import Array, Ints

# Legs miss poses by this share of the tolerances: rounding of files. Where they cut off a stub, by
# that; a stub is shorter than this share of the legs beside it.
_ROUNDING, _CUT, _STUB = 2e-3, 0.5, 0.25


class Merged(NamedTuple):
    """Which poses of N are ends of legs.

    Attributes
    ----------
    kept : (M,)
        Their numbers; first and last are among them.
    shares : (N,)
        Where each pose is passed: the leg's number, and as its fraction the share of the leg.
    missed, turned : (M - 1,)
        By how much each leg misses poses at most [m, rad].
    """

    kept: Ints
    shares: Array
    missed: Array
    turned: Array


def merged(points: Array, turns: Array, tolerance: float, turn_tolerance: float) -> Merged:
    """Return which of poses (N, 3), (N, 4) legs have to end at.

    Legs miss poses by next to nothing, so that curves of short chords stay what they are. Where a
    leg shorter than the tolerance stands between legs that are far longer, these miss one of its
    ends, by half of the tolerances [m, rad] at most.
    """
    measure = _Measure(points, turns, tolerance, turn_tolerance)
    kept = measure.without_stubs(measure.divided(_ROUNDING))
    legs = [measure.leg(first, last) for first, last in pairwise(kept)]
    shares = np.concatenate(
        [[0.0], *(np.append(k + leg.shares, k + 1.0) for k, leg in enumerate(legs))]
    )
    return Merged(
        np.array(kept, dtype=np.int64),
        shares,
        np.array([leg.away.max(initial=0.0) for leg in legs]),
        np.array([leg.turned.max(initial=0.0) for leg in legs]),
    )


class _Leg(NamedTuple):
    """Of the poses between a leg's ends: where it passes them, how far off, turned, and back."""

    shares: Array
    away: Array
    turned: Array
    back: Array


class _Measure:
    """Poses, and what legs between them may miss."""

    def __init__(
        self, points: Array, turns: Array, tolerance: float, turn_tolerance: float
    ) -> None:
        self._points, self._turns = points, turns
        self._tolerance, self._turn_tolerance = tolerance, turn_tolerance

    def leg(self, first: int, last: int) -> _Leg:
        """Return what a leg from one pose to another does to those between them."""
        return _leg(self._points, self._turns, first, last)

    def miss(self, leg: _Leg) -> Array:
        """Return by how much it misses each, as shares of the tolerances."""
        moved = np.maximum(leg.away, leg.back) / self._tolerance
        return np.asarray(np.maximum(moved, leg.turned / self._turn_tolerance))

    def divided(self, most: float) -> list[int]:
        """Return the ends of legs that miss poses by a share of the tolerances."""
        kept, waiting = [0], [(0, len(self._points) - 1)]
        while waiting:
            first, last = waiting.pop()
            if last == first + 1:
                kept.append(last)
                continue
            # Turns take ten times as long as places, which decide as a rule.
            moved = _leg(self._points, self._turns, first, last, turns_count=False)
            missed = self.miss(moved)
            if missed.max() <= most:
                missed = self.miss(self.leg(first, last))
            if missed.max() > most:
                middle = first + 1 + int(missed.argmax())
                waiting += [(middle, last), (first, middle)]
            else:
                kept.append(last)
        return kept

    def without_stubs(self, kept: list[int]) -> list[int]:
        """Return these ends but for one of each short leg among long ones, the better one."""
        lengths = np.linalg.norm(np.diff(self._points[kept], axis=0), axis=1)
        beside = np.concatenate([[np.inf], lengths, [np.inf]])
        bounds = np.minimum(_STUB * np.minimum(beside[:-2], beside[2:]), self._tolerance)
        # Of thousands of chords none is a stub as a rule.
        if not (lengths < bounds).any():
            return kept
        found = list(kept)
        k = 0
        while k + 1 < len(found):
            around = found[max(k - 1, 0) : k + 3]
            lengths = np.linalg.norm(np.diff(self._points[around], axis=0), axis=1)
            own = lengths[min(k, 1)]
            others = np.delete(lengths, min(k, 1))
            if own < self._tolerance and len(others) and own < _STUB * others.min():
                ends = [each for each in (k, k + 1) if 0 < each < len(found) - 1]
                missed = [
                    self.miss(self.leg(found[each - 1], found[each + 1])).max(initial=0.0)
                    for each in ends
                ]
                if min(missed) <= _CUT:
                    del found[ends[int(np.argmin(missed))]]
                    continue
            k += 1
        return found


def _leg(points: Array, turns: Array, first: int, last: int, turns_count: bool = True) -> _Leg:
    if last == first + 1:
        return _Leg(*np.zeros((4, 0)))
    inner = points[first + 1 : last] - points[first]
    chord = points[last] - points[first]
    length = float(np.sqrt(chord @ chord))
    if length > 0.0:
        along = inner @ (chord / length)
        shares = np.clip(along / length, 0.0, 1.0)
    else:
        along = np.zeros(len(inner))
        shares = np.arange(1, len(inner) + 1) / (len(inner) + 1.0)
    beside = inner - shares[:, None] * chord
    away = np.sqrt((beside * beside).sum(axis=1))
    passed = np.maximum(np.maximum.accumulate(along), 0.0)
    shares = np.maximum.accumulate(shares)
    # Where the tool goes back, it has to turn round where it has come farthest.
    back = _gone_back(along, passed)
    turned = _turned(turns, first, last, shares) if turns_count else np.zeros(len(shares))
    return _Leg(shares, away, turned, back)


def _gone_back(along: Array, passed: Array) -> Array:
    """Return for each pose by how much the tool goes back from it along a leg before its end."""
    rest = np.minimum.accumulate(along[::-1])[::-1]
    return np.where(along >= passed, np.maximum(along - rest, 0.0), 0.0)


def _turned(turns: Array, first: int, last: int, shares: Array) -> Array:
    """Return by how much poses are turned otherwise than a leg passes them [rad]."""
    if (turns[first : last + 1] == turns[first]).all():
        return np.zeros(len(shares))
    from scipy.spatial.transform import Rotation

    rotations: Any = Rotation.from_quat(turns[first : last + 1], scalar_first=True)
    whole = (rotations[0].inv() * rotations[-1]).as_rotvec()
    passed = rotations[0] * Rotation.from_rotvec(shares[:, None] * whole)
    return np.asarray((passed.inv() * rotations[1:-1]).magnitude())

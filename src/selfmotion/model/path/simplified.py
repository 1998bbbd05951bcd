"""Simplification: poses that the legs of a polyline pass within a tolerance are left out.

By the algorithm of Ramer (1972), Douglas and Peucker (1973): a leg from the first pose to the last
is divided at its farthest pose, until none is farther than the tolerance. A pose from which the
tool goes back along the leg, or that is turned otherwise, divides it as well.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from selfmotion.basics import (
    Array,
    Ints,
)

# Share of the tolerances by which legs may be off poses: rounding of files.
_ROUNDING = 2e-3
# The same where they cut off a stub …
_CUT = 0.5
# … which is shorter than this share of the legs next to it.
_STUB = 0.25


class Merged(NamedTuple):
    """Which poses of N are ends of legs.

    Attributes
    ----------
    kept : (M,)
        Their numbers; first and last are among them.
    shares : (N,)
        Where each pose is passed: the leg's number, and as its fraction the share of the leg.
    errors, turned : (M - 1,)
        Largest distance of each leg from its poses [m, rad].
    """

    kept: Ints
    shares: Array
    errors: Array
    turned: Array


def merged(points: Array, turns: Array, tolerance: float, turn_tolerance: float) -> Merged:
    """Return the numbers of poses (N, 3), (N, 4) at which legs have to end.

    Legs miss poses by rounding only, so that curves of short chords are unchanged. A leg shorter
    than the tolerance between far longer ones (a stub) is left out, where these then miss its end
    by half of the tolerances [m, rad] at most.
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
    """Distances of a leg from the poses between its ends: share passed, offset, turn, reversal."""

    shares: Array
    away: Array
    turned: Array
    back: Array


class _Measure:
    """Poses, and allowed distances of legs from them."""

    def __init__(
        self, points: Array, turns: Array, tolerance: float, turn_tolerance: float
    ) -> None:
        self._points, self._turns = points, turns
        self._tolerance, self._turn_tolerance = tolerance, turn_tolerance

    def leg(self, first: int, last: int) -> _Leg:
        """Return the leg from one pose to another, with its distances from those between them."""
        return _leg(self._points, self._turns, first, last)

    def distance(self, leg: _Leg) -> Array:
        """Return its distance from each, as shares of the tolerances."""
        moved = np.maximum(leg.away, leg.back) / self._tolerance
        return np.asarray(np.maximum(moved, leg.turned / self._turn_tolerance))

    def divided(self, most: float) -> list[int]:
        """Return the ends of legs that are off poses by a share of the tolerances."""
        kept, waiting = [0], [(0, len(self._points) - 1)]
        while waiting:
            first, last = waiting.pop()
            if last == first + 1:
                kept.append(last)
                continue
            # Turns take ten times as long as places, which decide as a rule.
            moved = _leg(self._points, self._turns, first, last, turns_count=False)
            errors = self.distance(moved)
            if errors.max() <= most:
                errors = self.distance(self.leg(first, last))
            if errors.max() > most:
                middle = first + 1 + int(errors.argmax())
                waiting += [(middle, last), (first, middle)]
            else:
                kept.append(last)
        return kept

    def without_stubs(self, kept: list[int]) -> list[int]:
        """Return these ends but for one of each short leg among long ones, the better one."""
        lengths = np.linalg.norm(np.diff(self._points[kept], axis=0), axis=1)
        beside = np.concatenate([[np.inf], lengths, [np.inf]])
        bounds = np.minimum(_STUB * np.minimum(beside[:-2], beside[2:]), self._tolerance)
        # Thousands of chords rarely have a stub.
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
                errors = [
                    self.distance(self.leg(found[each - 1], found[each + 1])).max(initial=0.0)
                    for each in ends
                ]
                if min(errors) <= _CUT:
                    del found[ends[int(np.argmin(errors))]]
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
    """Return the rotations of poses relative to a leg that passes them [rad]."""
    if (turns[first : last + 1] == turns[first]).all():
        return np.zeros(len(shares))
    from scipy.spatial.transform import Rotation

    rotations: Any = Rotation.from_quat(turns[first : last + 1], scalar_first=True)
    whole = (rotations[0].inv() * rotations[-1]).as_rotvec()
    passed = rotations[0] * Rotation.from_rotvec(shares[:, None] * whole)
    return np.asarray((passed.inv() * rotations[1:-1]).magnitude())

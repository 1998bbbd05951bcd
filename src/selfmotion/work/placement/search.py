"""The best of many places: beginnings all over the box, then BFGS within its bounds.

The cost of a place is the optimal cost of the motions there. Near a place that is planned it is had
by planning again from these motions, which takes a few steps; so its derivatives are differences.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from selfmotion.basics import Array
from selfmotion.work.placement.places import Places, Tried

# First places to plan if a part moves in one direction; twice as many for each further one.
_IN_ONE = 8
# First places at most. With half as many, one of 20 random placements in three directions was 7 %
# dearer than the best.
_BEGINNINGS = 32
# First places at most if none of these has a motion.
_MAX_BEGINNINGS = 64
# Best first places that the descent starts from.
_FINALISTS = 3
# Beginnings nearer to each other than this go on once [share of the box].
_APART = 0.15
# Differences are taken over this share of the box.
_DIFFERENCE = 4e-3
# Steps of the descent.
_STEPS = 12
# Halvings of a step.
_HALVINGS = 4
# The longest step [share of the box].
_LONGEST = 0.3
# The shortest step [share of the box].
_SHORTEST = 3e-3
# A step that takes less off the cost is the last one [share].
_GAIN = 1e-3


@dataclass(frozen=True, eq=False)
class Box:
    """The box of places: from low to high (d,) [m or rad]."""

    low: Array
    high: Array

    def at(self, share: Array) -> Array:
        """Return the place for shares of the box (d,)."""
        return np.asarray(self.low + share * (self.high - self.low))

    def share(self, place: Array) -> Array:
        """Return the shares for a place (d,)."""
        return np.asarray((place - self.low) / (self.high - self.low))

    def holds(self, place: Array) -> bool:
        """Whether a place is in the box."""
        return bool(np.all((place >= self.low) & (place <= self.high)))


def beginnings(box: Box, first: int, last: int) -> list[Array]:
    """Return places all over a box: those of a Sobol sequence from one number to another."""
    from scipy.stats import qmc

    sequence = qmc.Sobol(len(box.low), scramble=False)
    # The first one is a corner.
    sequence.fast_forward(1 + first)
    return [box.at(share) for share in sequence.random(last - first)]


def finalists(tried: Iterable[Tried], box: Box) -> list[Tried]:
    """Return the best places that were tried, none near another."""
    chosen: list[Tried] = []
    for each in sorted(tried, key=lambda item: item.cost):
        far = all(
            np.linalg.norm(box.share(each.place) - box.share(other.place)) > _APART
            for other in chosen
        )
        if np.isfinite(each.cost) and far:
            chosen.append(each)
    return chosen[:_FINALISTS]


@dataclass(eq=False)
class Descent:
    """From a place downhill, within a box."""

    places: Places
    box: Box
    told: Callable[[Tried], object]
    tried: list[Tried] = field(default_factory=list)

    def run(self, begun: Tried) -> Tried:
        """Return the best place that is found from one with plans."""
        best, inverse, before = begun, None, None
        for _ in range(_STEPS):
            share = self.box.share(best.place)
            slope, bend = self._derivatives(best, both=inverse is None)
            if inverse is None:
                # A step in one coordinate alone is Newton's, but not longer than the longest.
                inverse = np.diag(1.0 / np.maximum(bend, np.abs(slope) / _LONGEST + 1e-12))
            elif before is not None:
                inverse = _updated(inverse, share - before[0], slope - before[1])
            before = share, slope
            held = ((share <= 0.0) & (slope > 0.0)) | ((share >= 1.0) & (slope < 0.0))
            step = -np.where(held, 0.0, inverse @ np.where(held, 0.0, slope))
            if step @ slope >= 0.0:
                inverse, step = None, -np.where(held, 0.0, slope)
            length = float(np.linalg.norm(step))
            step *= min(1.0, _LONGEST / max(length, 1e-12))
            found = self._along(best, share, step)
            if found is None:
                return best
            done = best.cost - found.cost < _GAIN * abs(best.cost)
            best = found
            if done:
                return best
        return best

    def _along(self, best: Tried, share: Array, step: Array) -> Tried | None:
        """Return a better place along a step; None where there is none."""
        for halving in range(_HALVINGS):
            there = np.clip(share + 0.5**halving * step, 0.0, 1.0)
            if np.linalg.norm(there - share) < _SHORTEST:
                return None
            found = self._planned(there, best)
            if found.cost < best.cost:
                return found
        return None

    def _derivatives(self, best: Tried, both: bool) -> tuple[Array, Array]:
        """Return slope and curvature (d,) by shares of the box; the latter 0 unless asked for."""
        share = self.box.share(best.place)
        slope, bend = np.zeros(len(share)), np.zeros(len(share))
        for k in range(len(share)):
            ahead, behind = share.copy(), share.copy()
            ahead[k] += _DIFFERENCE
            behind[k] -= _DIFFERENCE
            more = self._planned(ahead, best).cost if ahead[k] <= 1.0 else np.inf
            # One side will do but where the curvature is asked for, or nothing is there.
            less = np.inf
            if behind[k] >= 0.0 and (both or not np.isfinite(more)):
                less = self._planned(behind, best).cost
            if np.isfinite(more) and np.isfinite(less):
                slope[k] = (more - less) / (2.0 * _DIFFERENCE)
                bend[k] = (more + less - 2.0 * best.cost) / _DIFFERENCE**2
            elif np.isfinite(more):
                slope[k] = (more - best.cost) / _DIFFERENCE
            elif np.isfinite(less):
                slope[k] = (best.cost - less) / _DIFFERENCE
        return slope, bend

    def _planned(self, share: Array, near: Tried) -> Tried:
        found = self.places.tried(self.box.at(share), near.plans)
        self.tried.append(Tried(found.place, found.cost, found.reason))
        self.told(found)
        return found


def _updated(inverse: Array, moved: Array, changed: Array) -> Array:
    """Return BFGS's inverse Hessian after a step, or as it was where that bends the other way."""
    curved = float(moved @ changed)
    if curved <= 1e-10 * float(np.linalg.norm(moved) * np.linalg.norm(changed)):
        return inverse
    eye = np.eye(len(moved))
    left = eye - np.outer(moved, changed) / curved
    return np.asarray(left @ inverse @ left.T + np.outer(moved, moved) / curved)


def _nearest(place: Tried, others: Sequence[Tried], box: Box) -> Tried:
    """Return the one of some places that is nearest to another."""
    share = box.share(place.place)
    return min(others, key=lambda item: float(np.linalg.norm(box.share(item.place) - share)))


def best_place(
    places: Places,
    box: Box,
    every: Callable[[Sequence[Array]], list[Tried]],
    near: Callable[[Sequence[tuple[Array, Tried]]], list[Tried]],
    descents: Callable[[Sequence[Tried]], list[tuple[Tried, list[Tried]]]],
    known: Sequence[Tried] = (),
) -> tuple[Tried, list[Tried]]:
    """Return the best place that is found, and all that were tried.

    Parameters
    ----------
    places, box
    every : callable
        Plans at places, each on its own.
    near : callable
        Plans at places, each from the motions of another one.
    descents : callable
        Goes downhill from places; returns where each arrives, and what it tried.
    known : sequence of Tried
        Places that were planned before.
    """
    tried: list[Tried] = [*known]
    count, first = min(_IN_ONE * 2 ** (len(box.low) - 1), _BEGINNINGS), 0
    while first < _MAX_BEGINNINGS:
        tried += every([one for one in beginnings(box, first, count) if one.any()])
        if any(np.isfinite(item.cost) for item in tried):
            break
        first, count = count, 2 * count
    # A quick 'no' is none: the nearest place that has motions may lend them.
    met = [item for item in tried if np.isfinite(item.cost)]
    unmet = [item for item in tried if not np.isfinite(item.cost)]
    if met:
        tried += near([(item.place, _nearest(item, met, box)) for item in unmet])
    best = min(tried, key=lambda item: item.cost)
    for arrived, more in descents(finalists(tried, box)):
        tried += more
        if arrived.cost < best.cost:
            best = arrived
    if np.isfinite(best.cost):
        # Another motion may be better there than the one that led there.
        (anew,) = every([best.place])
        if anew.cost < (1.0 - _GAIN) * best.cost:
            ((anew, more),) = descents([anew])
            tried += more
            best = anew
    return best, tried

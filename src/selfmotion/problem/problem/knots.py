"""Knots of a problem: times at which its paths or the windows of tolerances are not smooth."""

from collections.abc import Iterable, Sequence

import numpy as np

from selfmotion.basics import Array, read_only
from selfmotion.model.follow import Follows
from selfmotion.model.task import Relaxation

# Distance below which two knots are the same, as a share of the duration.
_SAME_TIME = 1e-9


def smooth_knots(follows: Follows, relaxations: Sequence[Relaxation]) -> Array:
    """Return the knots of all paths, and the ends of the windows of tolerances, [s] (K,)."""
    duration, first = follows.duration, follows.items[0]
    knots = list(first.path.knots)
    for other in follows.items[1:]:
        knots = _merged(knots, other.path.knots, duration)
    for item in relaxations:
        knots = _merged(knots, item.window(duration), duration)
    return read_only(sorted(knots))


def _merged(knots: list[float], times: Iterable[float], duration: float) -> list[float]:
    """Return knots and those times that are none of them yet."""
    merged = list(knots)
    for time in times:
        if np.abs(np.array(merged) - time).min() > _SAME_TIME * duration:
            merged.append(float(time))
    return merged

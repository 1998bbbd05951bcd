"""Times between which everything that is asked for is smooth."""

from collections.abc import Iterable, Sequence

import numpy as np

from selfmotion.basics import Array, read_only
from selfmotion.follow import Follows
from selfmotion.task import Relaxation


def smooth_knots(follows: Follows, relaxations: Sequence[Relaxation]) -> Array:
    """Return the knots of all paths, and the ends of the windows of tolerances, [s] (K,)."""
    duration, first = follows.duration, follows.items[0]
    knots = list(first.path.knots)
    for other in follows.items[1:]:
        knots = _with_times(knots, other.path.knots, duration)
    for item in relaxations:
        knots = _with_times(knots, item.window(duration), duration)
    return read_only(sorted(knots))


def _with_times(knots: list[float], times: Iterable[float], duration: float) -> list[float]:
    """Return knots and times; nearer to each other than rounding, two are one."""
    found = list(knots)
    for time in times:
        if np.abs(np.array(found) - time).min() > 1e-9 * duration:
            found.append(float(time))
    return found

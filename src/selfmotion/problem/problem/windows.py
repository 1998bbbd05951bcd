"""Time windows of tolerances, on a part of the path that is run at a pace of its own."""

from collections.abc import Callable

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.path import Retimed

# Shortest window on a part, as a share of the part and of the window: shorter ones are dropped.
_SHORTEST_WINDOW = 1e-2


def times_along(path: Retimed, ends: tuple[float, float]) -> Callable[[Array], Array]:
    """Return the map from windows (first, last) of the whole path to windows on a part of it [s].

    The part is between `ends` of the whole path [s], and `path` is its motion. Windows that hardly
    overlap with it become (0, 0).
    """

    def window_on_part(window: Array) -> Array:
        first, last = path.when(np.clip(window, *ends) - ends[0]).tolist()
        # A ramp hardly moves at its end, so that its end time has few digits.
        first = 0.0 if window[0] <= ends[0] else first
        last = path.duration if window[1] >= ends[1] else last
        shortest = _SHORTEST_WINDOW * min(path.duration, float(window[1] - window[0]))
        return np.array([first, last]) if last - first > shortest else np.zeros(2)

    return window_on_part

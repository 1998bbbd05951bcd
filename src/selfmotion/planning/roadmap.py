"""Ways between two configurations that no straight one leads to: a roadmap that is checked lazily.

The shortest way through a few samples is looked for first, and only its legs are checked; what
meets something is left out of the next search (R. Bohlin, L. Kavraki, "Path planning using lazy
PRM", ICRA 2000).
"""

from collections.abc import Callable

import numpy as np

from selfmotion.basics import Array
from selfmotion.planning.settings import ANYWHERE, AROUND, LEG_STEP, SPREAD, STOP


class Roadmap:
    """Finds ways from a configuration to another one.

    Parameters
    ----------
    first, last : (n,)
        Where ways begin and end.
    limits : (n,), (n,)
        Joint limits, finite [rad or m].
    weights : (n,)
        What a unit of each joint counts.
    free : callable
        Whether a configuration (n,) is allowed.
    rng : Generator
    """

    def __init__(
        self,
        first: Array,
        last: Array,
        limits: tuple[Array, Array],
        weights: Array,
        free: Callable[[Array], bool],
        rng: np.random.Generator,
    ) -> None:
        self._free, self._weights = free, weights
        spread = SPREAD * float((weights * np.abs(last - first)).max()) / weights
        around = rng.normal(0.5 * (first + last), spread, (AROUND, len(first)))
        anywhere = rng.uniform(*limits, (ANYWHERE, len(first)))
        samples = np.clip(np.concatenate([around, anywhere]), *limits)
        self._points = np.concatenate([[first, last], samples])
        apart = np.abs(self._points[:, None] - self._points) @ weights
        self._lengths = apart + STOP
        self._known: set[tuple[int, int]] = set()
        self._way = [0, 1]

    def way(self) -> Array | None:
        """Return the shortest way of straight legs that seem free, (m, n); None where none is."""
        from scipy.sparse.csgraph import dijkstra

        while True:
            lengths, before = dijkstra(self._lengths, indices=[0], return_predecessors=True)
            if not np.isfinite(lengths[0, 1]):
                return None
            way = [1]
            while way[-1] != 0:
                way.append(int(before[0, way[-1]]))
            self._way = way[::-1]
            if all(self._open(leg) for leg in range(len(way) - 1)):
                return np.asarray(self._points[self._way])

    def close(self, leg: int) -> None:
        """Leave a leg of the way found last out of the next ones."""
        i, j = self._way[leg], self._way[leg + 1]
        self._lengths[i, j] = self._lengths[j, i] = np.inf

    def _open(self, leg: int) -> bool:
        """Whether a leg seems free; closes it where it is not."""
        i, j = sorted(self._way[leg : leg + 2])
        if (i, j) in self._known:
            return True
        for point in {i, j} - {0, 1}:
            if not self._free(self._points[point]):
                self._lengths[point, :] = self._lengths[:, point] = np.inf
                return False
        first, last = self._points[i], self._points[j]
        count = int(np.ceil((self._weights * np.abs(last - first)).max() / LEG_STEP)) + 1
        # In an order in which what is in the way shows early.
        shares = np.linspace(0.0, 1.0, count + 1)[_spread_out(count + 1)]
        if all(self._free(first + share * (last - first)) for share in shares):
            self._known.add((i, j))
            return True
        self.close(leg)
        return False


def _spread_out(count: int) -> list[int]:
    """Return 0 to count - 1 in an order in which each one is far from those before."""
    order: dict[int, None] = {}
    step = count
    while step > 0:
        order.update(dict.fromkeys(range(0, count, step)))
        step //= 2
    return list(order)

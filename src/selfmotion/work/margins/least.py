"""By how much bodies may be displaced while a motion goes on, proved at all times.

At a time and for one pair, `Separation.least` bounds what is left of the distance after all
displacements of a size. Between two times that changes by no more than the ways of the joints times
their levers, as in the certificate (`certificate.separation`). So the middle of an interval decides
about all of it. Intervals on which it does not are halved, the pair with the least first.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from selfmotion.basics import Array, Ints
from selfmotion.model.collision import DisplacedBodies
from selfmotion.model.motion import Trajectory

# Intervals of time to begin with.
_FIRST = 32
# Bisections of each at most.
_DEPTH = 40
# Share of the bound at single times that a proof may lose.
_SHARE = 0.02
# Relative accuracy to which a bound is solved for.
_EXACT = 1e-4
# Rounds of that at most.
_ROUNDS = 12
# Sections of each round.
_PARTS = 16


@dataclass(frozen=True)
class Size:
    """How large displacements are: all up to both, in any direction.

    Attributes
    ----------
    position : float
        [m].
    rotation : float
        [rad].
    """

    position: float
    rotation: float


@dataclass(frozen=True, eq=False)
class Least:
    """By how much bodies may be displaced.

    Attributes
    ----------
    scale : float
        What a `Size` may be multiplied by; proved.
    pair : tuple of str
        What meets first, the displaced body first; empty where nothing does.
    time : float
        When [s].
    normal, moment : (3,)
        In which direction, and about what, times its lever [m], the displaced body meets the other
        one; in world axes.
    """

    scale: float
    pair: tuple[str, ...] = ()
    time: float = np.nan
    normal: Array | None = None
    moment: Array | None = None


def least_scale(
    bodies: DisplacedBodies, motion: Trajectory, size: Size, left: float, most: float
) -> Least:
    """Return by what displacements of a size may be multiplied, up to `most`.

    Afterwards no pair of a displaced and another body is nearer than `left` [m] at any time.
    """
    if not bodies.pairs:
        return Least(most)
    search = _Search(bodies, motion, size, left, most)
    edges = np.linspace(motion.t[0], motion.t[-1], _FIRST + 1)
    count = len(bodies.pairs)
    starts, pairs = np.repeat(np.arange(_FIRST), count), np.tile(np.arange(count), _FIRST)
    open_ = _Open(edges[starts], edges[starts + 1], pairs)
    for _ in range(_DEPTH):
        open_ = search.narrowed(open_)
        if not len(open_.pairs):
            break
    return search.found(open_)


@dataclass(frozen=True, eq=False)
class _Open:
    """Intervals (I,) on which a pair (I,) is not decided."""

    early: Array
    late: Array
    pairs: Ints

    def halves(self) -> "_Open":
        middle = 0.5 * (self.early + self.late)
        return _Open(
            np.append(self.early, middle),
            np.append(middle, self.late),
            np.append(self.pairs, self.pairs),
        )


class _Search:
    """The least bound so far, at single times and on intervals."""

    def __init__(
        self, bodies: DisplacedBodies, motion: Trajectory, size: Size, left: float, most: float
    ) -> None:
        self._bodies, self._motion, self._size, self._left = bodies, motion, size, left
        self._best, self._proved = Least(most), most
        self._farthest = np.abs(motion.extremes(0)[1]).max(axis=0)

    @property
    def _goal(self) -> float:
        """The margin that is enough to be proved."""
        return (1.0 - _SHARE) * self._best.scale

    def _levers(self) -> Array:
        """Return the pairs' levers (P, n) while bodies are displaced as far as is in question."""
        aside = self._size.position + self._size.rotation * self._bodies.lever_arms
        model = self._bodies.model
        return model.pair_levers_up_to(self._farthest, self._best.scale * aside)

    def narrowed(self, open_: _Open) -> _Open:
        """Look at the middles of intervals; return the halves of those that are left."""
        middle = 0.5 * (open_.early + open_.late)
        ways = self._motion.travelled(np.concatenate([open_.early, middle, open_.late]))
        early, here, late = np.split(ways, 3)
        made = np.maximum(here - early, late - here)
        slack = np.einsum("in,in->i", made, self._levers()[open_.pairs])
        times, row = np.unique(middle, return_inverse=True)
        q = self._motion(times)
        quick = self._quick(q, row, open_.pairs, slack)
        kept = []
        for k in np.argsort(quick, kind="stable").tolist():
            if quick[k] >= self._goal:
                self._proved = min(self._proved, float(quick[k]))
            elif not self._settles(q[row[k]], float(middle[k]), int(open_.pairs[k]), slack[k]):
                kept.append(k)
        rows = np.array(kept, dtype=np.int64)
        left = _Open(open_.early[rows], open_.late[rows], open_.pairs[rows])
        if not self._best.scale > 0.0:
            # Nothing is left to be proved.
            return replace(left, early=left.early[:0], late=left.late[:0], pairs=left.pairs[:0])
        return left.halves()

    def _quick(self, q: Array, row: Ints, pairs: Ints, slack: Array) -> Array:
        """Return lower bounds of the scales by boxes around the bodies (I,)."""
        size, bodies = self._size, self._bodies
        rates = np.full((len(q), len(bodies.pairs)), size.position)
        if size.rotation:
            others = [bodies.other_lever_arms(each) for each in q]
            rates += size.rotation * np.minimum(others, bodies.lever_arms)
        apart = bodies.model.hulls.lower_bounds(q) - self._left
        found: Array = (apart[row, pairs] - slack) / np.maximum(rates[row, pairs], 1e-12)
        return np.clip(found, 0.0, self._best.scale)

    def _settles(self, q: Array, time: float, pair: int, slack: float) -> bool:
        """Look at a pair at one time; return whether enough is proved around it."""
        found, size = self._bodies.at(q, pair), self._size

        def left(scales: Array) -> Array:
            least = found.least(scales * size.position, scales * size.rotation)
            return np.asarray(least - self._left)

        best = self._best.scale
        # Written so that NaN falls short.
        if not left(np.array([best]))[0] >= 0.0:
            here = _largest(left, best)
            angle = here * size.rotation
            near = found.nearest(angle)
            pairs = self._bodies.pairs[pair]
            self._best = Least(here, pairs, time, near.normal, near.moment(angle))
        goal = self._goal
        if not left(np.array([goal]))[0] >= slack:
            return False
        self._proved = min(self._proved, goal)
        return True

    def found(self, open_: _Open) -> Least:
        """Return the proved margin while some intervals are undecided."""
        scale = min(self._proved, self._best.scale)
        return replace(self._best, scale=0.0 if len(open_.pairs) else max(scale, 0.0))


def _largest(left: Callable[[Array], Array], most: float) -> float:
    """Return the largest scale up to `most`, from below, to which nothing is short; 0 for none."""
    low, high = 0.0, most
    for _ in range(_ROUNDS):
        scales = np.linspace(low, high, _PARTS + 1)
        # Written so that NaN falls short.
        short = np.flatnonzero(~(left(scales) >= 0.0))
        if not short.size:
            return high
        if not short[0]:
            return low
        low, high = float(scales[short[0] - 1]), float(scales[short[0]])
        if high - low <= _EXACT * high:
            break
    return low

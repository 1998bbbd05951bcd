"""By how much bodies may be displaced during a motion, proved at all times.

At one time and for one pair, `Separation.least` bounds the distance that remains after any
displacement of a size. Between two times this distance changes by no more than the path lengths of
the joints times their lever arms, as in the certificate (`certificate.separation`). So a bound in
the middle of an interval can decide the whole interval. Undecided intervals are halved, the pair
with the smallest bound first.
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
# Share of the bound at single times that a proof may fall short of it.
_SHARE = 0.02
# Relative accuracy of a bound.
_ACCURACY = 1e-4
# Rounds of its search, at most.
_ROUNDS = 12
# Sections of each round.
_PARTS = 16


@dataclass(frozen=True)
class Size:
    """Largest translation and rotation of displacements, both at once and in any direction.

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
    """The largest displacement that is proved.

    Attributes
    ----------
    scale : float
        Proved factor of a `Size`.
    pair : tuple of str
        The bodies that would collide first, the displaced one first; empty for none.
    time : float
        Of that collision [s].
    normal, moment : (3,)
        Translation direction, and rotation axis times its lever arm [m], by which the displaced
        body approaches the other one; in world axes.
    """

    scale: float
    pair: tuple[str, ...] = ()
    time: float = np.nan
    normal: Array | None = None
    moment: Array | None = None


def least_scale(
    bodies: DisplacedBodies, motion: Trajectory, size: Size, left: float, most: float
) -> Least:
    """Return the largest factor of a displacement, up to `most`, that leaves bodies apart.

    No pair of a displaced and another body is then nearer than `left` [m] at any time.
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
        """The factor that is enough to prove."""
        return (1.0 - _SHARE) * self._best.scale

    def _lever_arms(self) -> Array:
        """Return lever arms of joints for pairs (P, n), with bodies displaced by the best scale."""
        displaced = self._size.position + self._size.rotation * self._bodies.lever_arms
        model = self._bodies.model
        return model.pair_levers_up_to(self._farthest, self._best.scale * displaced)

    def narrowed(self, open_: _Open) -> _Open:
        """Bound the middles of intervals; return the halves of undecided ones."""
        middle = 0.5 * (open_.early + open_.late)
        lengths = self._motion.travelled(np.concatenate([open_.early, middle, open_.late]))
        early, here, late = np.split(lengths, 3)
        travelled = np.maximum(here - early, late - here)
        slack = np.einsum("in,in->i", travelled, self._lever_arms()[open_.pairs])
        times, row = np.unique(middle, return_inverse=True)
        q = self._motion(times)
        quick = self._bounds_by_boxes(q, row, open_.pairs, slack)
        undecided = []
        for k in np.argsort(quick, kind="stable").tolist():
            if quick[k] >= self._goal:
                self._proved = min(self._proved, float(quick[k]))
            elif not self._decides(q[row[k]], float(middle[k]), int(open_.pairs[k]), slack[k]):
                undecided.append(k)
        rows = np.array(undecided, dtype=np.int64)
        left = _Open(open_.early[rows], open_.late[rows], open_.pairs[rows])
        if not self._best.scale > 0.0:
            # Nothing is left to be proved.
            return replace(left, early=left.early[:0], late=left.late[:0], pairs=left.pairs[:0])
        return left.halves()

    def _bounds_by_boxes(self, q: Array, row: Ints, pairs: Ints, slack: Array) -> Array:
        """Return lower bounds of the scales by boxes around the bodies (I,)."""
        size, bodies = self._size, self._bodies
        rates = np.full((len(q), len(bodies.pairs)), size.position)
        if size.rotation:
            others = [bodies.other_lever_arms(each) for each in q]
            rates += size.rotation * np.minimum(others, bodies.lever_arms)
        room = bodies.model.hulls.lower_bounds(q) - self._left
        found: Array = (room[row, pairs] - slack) / np.maximum(rates[row, pairs], 1e-12)
        return np.clip(found, 0.0, self._best.scale)

    def _decides(self, q: Array, time: float, pair: int, slack: float) -> bool:
        """Measure a pair at one time; return whether that proves enough around it."""
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
        """Return what is proved; a scale of 0 while intervals are undecided."""
        scale = min(self._proved, self._best.scale)
        return replace(self._best, scale=0.0 if len(open_.pairs) else max(scale, 0.0))


def _largest(left: Callable[[Array], Array], most: float) -> float:
    """Return a scale up to `most`, from below, up to which `left` is not negative; 0 for none."""
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
        if high - low <= _ACCURACY * high:
            break
    return low

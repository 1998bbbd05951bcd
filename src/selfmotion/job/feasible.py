"""An order of stops in which each can be reached from the one before, whatever it costs."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Flags, Ints

# So many stops are looked at as the next one, at most: some seconds.
_LOOKS = 300_000
# What to go on with: a stop, and which of its states can be reached.
_Next = tuple[int, int]


def feasible_order(
    after: Sequence[frozenset[int]],
    after_any: Sequence[frozenset[int]],
    states: Sequence[Ints],
    between: Flags,
    first: Flags,
    last: Flags,
    too_late: Flags,
) -> list[int] | None:
    """Return an order of all stops that can be made; None where none was found.

    Depth first, on with what leaves the fewest ways to go on (H. C. von Warnsdorff, 1823), and no
    set of stops made with the same states of the last one twice: for a dozen stops that looks at
    all orders there are.

    Parameters
    ----------
    after, after_any : sequence of frozenset
        See `Before`.
    states : sequence of Ints
        The states of each stop.
    between : (m, m)
        Whether one can go from the end of a state to the beginning of another one.
    first, last : (m,)
        Whether a state can be the first, or the last.
    too_late : (m, n)
        Whether a state cannot be made any more once a stop is made.
    """
    ways = between.T
    search = _Search(
        after=[_bits(each) for each in after],
        after_any=[_bits(each) for each in after_any],
        of=[_bits(each.tolist()) for each in states],
        onward=[_places(np.asarray(row)) for row in between],
        into=[_places(np.asarray(ways[each].any(axis=0))) for each in states],
        first=_places(first),
        last=_places(last),
        lost=[_places(column) for column in too_late.T],
    )
    return search.order()


@dataclass
class _Search:
    """Depth first over sets of stops, which are bits of whole numbers as states are.

    Attributes
    ----------
    after, after_any : list of int
        The stops before each one.
    of : list of int
        The states of each stop.
    onward : list of int
        The states that each state leads to.
    into : list of int
        The states that lead to each stop.
    first, last : int
        The states that can be the first, or the last.
    lost : list of int
        The states that cannot be made any more once each stop is made.
    looks : int
        So many stops were looked at as the next one.
    """

    after: list[int]
    after_any: list[int]
    of: list[int]
    onward: list[int]
    into: list[int]
    first: int
    last: int
    lost: list[int]
    looks: int = 0

    def order(self) -> list[int] | None:
        """Return the order, or None."""
        full, made = (1 << len(self.of)) - 1, 0
        tried: set[tuple[int, int]] = set()
        order: list[int] = []
        levels = [self._following(0, self.first)]
        while levels and self.looks < _LOOKS:
            stop, reached = next(levels[-1], (-1, 0))
            if stop < 0:
                levels.pop()
                if order:
                    made &= ~(1 << order.pop())
                continue
            key = made | 1 << stop, reached
            if key in tried:
                continue
            tried.add(key)
            if key[0] == full:
                if reached & self.last:
                    return [*order, stop]
                continue
            order.append(stop)
            made = key[0]
            levels.append(self._following(made, self._beyond(reached), reached))
        return None

    def _following(self, made: int, beyond: int, reached: int = 0) -> Iterator[_Next]:
        """Return stops that may come next, those first that leave the fewest ways to go on."""
        left = [stop for stop in range(len(self.of)) if not made >> stop & 1]
        self.looks += len(left)
        todo = 0
        for stop in left:
            todo |= self.of[stop]
        for stop, lost in enumerate(self.lost):
            if made >> stop & 1:
                todo &= ~lost
        # One without a state, or that nothing leads to any more, is never made.
        if not all(self.of[stop] & todo for stop in left) or (
            made and not all(self.into[stop] & (todo | reached) for stop in left)
        ):
            return iter(())
        rated = []
        for stop in left:
            here = self.of[stop] & beyond & todo
            if here and self._may(stop, made):
                rated.append(((self._beyond(here) & todo & ~self.of[stop]).bit_count(), stop, here))
        return iter([(stop, here) for _, stop, here in sorted(rated)])

    def _may(self, stop: int, made: int) -> bool:
        any_of = self.after_any[stop]
        return not self.after[stop] & ~made and (not any_of or bool(any_of & made))

    def _beyond(self, reached: int) -> int:
        """Return the states that can be reached from some."""
        found = 0
        while reached:
            lowest = reached & -reached
            found |= self.onward[lowest.bit_length() - 1]
            reached ^= lowest
        return found


def _bits(places: Sequence[int] | frozenset[int]) -> int:
    return sum(1 << int(k) for k in places)


def _places(found: Flags) -> int:
    return _bits(np.flatnonzero(found).tolist())

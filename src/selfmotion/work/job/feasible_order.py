"""Depth-first search for a feasible order, without regard to costs."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Flags, Ints

# Stops that are tried as the next one, at most: some seconds.
_MAX_EXPANSIONS = 300_000
# A partial round: its last stop, and the states of it that can be reached.
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
    """Return an order of all stops that can be visited; None where none was found.

    Depth first, with the stop next that leaves the fewest continuations (H. C. von Warnsdorff,
    1823). No set of visited stops is expanded twice with the same states of the last one, so that
    the search is complete for a dozen stops.

    Parameters
    ----------
    after, after_any : sequence of frozenset
        See `Precedences`.
    states : sequence of Ints
        The states of each stop.
    between : (m, m)
        Whether there is a transition between two states.
    first, last : (m,)
        Whether a state can be the first, or the last.
    too_late : (m, n)
        Whether a state cannot be used any more once a stop is visited.
    """
    into = between.T
    search = _Search(
        after=[_bits(each) for each in after],
        after_any=[_bits(each) for each in after_any],
        of=[_bits(each.tolist()) for each in states],
        onward=[_places(np.asarray(row)) for row in between],
        into=[_places(np.asarray(into[each].any(axis=0))) for each in states],
        first=_places(first),
        last=_places(last),
        lost=[_places(column) for column in too_late.T],
    )
    return search.order()


@dataclass
class _Search:
    """Depth-first search; sets of stops and of states are the bits of integers.

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
        The states that cannot be used any more once each stop is visited.
    expanded : int
        Stops that were tried as the next one.
    """

    after: list[int]
    after_any: list[int]
    of: list[int]
    onward: list[int]
    into: list[int]
    first: int
    last: int
    lost: list[int]
    expanded: int = 0

    def order(self) -> list[int] | None:
        """Return the order, or None."""
        full, visited = (1 << len(self.of)) - 1, 0
        tried: set[tuple[int, int]] = set()
        order: list[int] = []
        levels = [self._following(0, self.first)]
        while levels and self.expanded < _MAX_EXPANSIONS:
            stop, reached = next(levels[-1], (-1, 0))
            if stop < 0:
                levels.pop()
                if order:
                    visited &= ~(1 << order.pop())
                continue
            key = visited | 1 << stop, reached
            if key in tried:
                continue
            tried.add(key)
            if key[0] == full:
                if reached & self.last:
                    return [*order, stop]
                continue
            order.append(stop)
            visited = key[0]
            levels.append(self._following(visited, self._beyond(reached), reached))
        return None

    def _following(self, visited: int, beyond: int, reached: int = 0) -> Iterator[_Next]:
        """Return stops that may come next, those first that leave the fewest continuations."""
        left = [stop for stop in range(len(self.of)) if not visited >> stop & 1]
        self.expanded += len(left)
        todo = 0
        for stop in left:
            todo |= self.of[stop]
        for stop, lost in enumerate(self.lost):
            if visited >> stop & 1:
                todo &= ~lost
        # A stop without a state, or without a transition to it, could never be visited.
        if not all(self.of[stop] & todo for stop in left) or (
            visited and not all(self.into[stop] & (todo | reached) for stop in left)
        ):
            return iter(())
        rated = []
        for stop in left:
            here = self.of[stop] & beyond & todo
            if here and self._may(stop, visited):
                rated.append(((self._beyond(here) & todo & ~self.of[stop]).bit_count(), stop, here))
        return iter([(stop, here) for _, stop, here in sorted(rated)])

    def _may(self, stop: int, visited: int) -> bool:
        any_of = self.after_any[stop]
        return not self.after[stop] & ~visited and (not any_of or bool(any_of & visited))

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

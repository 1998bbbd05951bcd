"""Stops that can be made in several ways, and an order in which each can be reached."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from selfmotion.basics import Array, Flags, Ints

# Stops, their states, costs of transitions, and precedences.
#
# Knows only numbers. A stop (a seam) has states (a direction and a branch of configurations);
# what leads from one state to another one costs something.


@dataclass(frozen=True, eq=False)
class Before:
    """Precedences.

    Attributes
    ----------
    after : sequence of frozenset
        For each stop those that have to be made before it.
    after_any : sequence of frozenset
        For each stop those of which one has to be made before it; an empty set asks for nothing.
    """

    after: Sequence[frozenset[int]]
    after_any: Sequence[frozenset[int]]

    def allows(self, stop: int, made: frozenset[int] | set[int]) -> bool:
        """Whether a stop may come next when others are made."""
        any_of = self.after_any[stop]
        return self.after[stop] <= made and (not any_of or not any_of.isdisjoint(made))

    def keeps(self, order: Sequence[int]) -> bool:
        """Whether an order makes nothing too early."""
        made: set[int] = set()
        for stop in order:
            if not self.allows(stop, made):
                return False
            made.add(stop)
        return True


@dataclass(frozen=True, eq=False)
class Stops(Before):
    """Stops to be ordered.

    Attributes
    ----------
    of : (m,)
        Whose state each state is: numbers of stops from 0 on.
    own : (m,)
        What a state costs by itself.
    between : (m, m)
        What it costs to go from the end of one state to the beginning of another; inf where it
        cannot be done.
    first, last : (m,)
        What it costs to come to a state from the start, and from a state to the end.
    too_late : (m, n)
        Whether a state cannot be made any more once a stop is made.
    late_price : float
        What a state costs that is made too late.
    """

    of: Ints
    own: Array
    between: Array
    first: Array
    last: Array
    too_late: Flags
    late_price: float = np.inf

    @property
    def count(self) -> int:
        """How many stops there are."""
        return len(self.after)

    @cached_property
    def states(self) -> list[Ints]:
        """The states of each stop."""
        return [np.flatnonzero(self.of == stop) for stop in range(self.count)]

    def cost(self, states: Sequence[int]) -> float:
        """Return the cost of a round of states in order."""
        made = np.zeros(self.count, dtype=bool)
        total = self.first[states[0]] + self.last[states[-1]]
        total += sum(self.between[a, b] for a, b in pairwise(states))
        for state in states:
            total += self.made_after(made, [state])[0]
            made[self.of[state]] = True
        return float(total)

    def made_after(self, made: Flags, states: Sequence[int] | Ints) -> Array:
        """Return the costs of states, without moves, after stops (n,)."""
        is_late = (self.too_late[states] & made).any(axis=1)
        return np.asarray(np.where(is_late, self.late_price, 0.0) + self.own[states])


@dataclass(frozen=True)
class Round:
    """An order of all stops, and how each is made.

    Attributes
    ----------
    states : tuple of int
        The states, in order; empty where there is no round.
    cost : float
        What they cost; inf where there is no round.
    bound : float
        No round costs less.
    """

    states: tuple[int, ...]
    cost: float
    bound: float


NO_ROUND = Round((), np.inf, np.inf)


def along(stops: Stops, order: Sequence[int]) -> tuple[tuple[int, ...], float]:
    """Return the best states for an order of stops, and their cost; none where there are none."""
    if not order or not stops.keeps(order):
        return (), np.inf
    made = np.zeros(stops.count, dtype=bool)
    cost = stops.first[stops.states[order[0]]] + stops.made_after(made, stops.states[order[0]])
    came: list[Ints] = []
    for one, other in pairwise(order):
        made[one] = True
        ways = cost[:, None] + stops.between[np.ix_(stops.states[one], stops.states[other])]
        came.append(ways.argmin(axis=0))
        cost = ways.min(axis=0) + stops.made_after(made, stops.states[other])
    ends = cost + stops.last[stops.states[order[-1]]]
    at = int(np.argmin(ends))
    if not np.isfinite(ends[at]):
        return (), np.inf
    places = [at]
    for back in reversed(came):
        places.append(int(back[places[-1]]))
    found = (int(stops.states[k][i]) for k, i in zip(order, reversed(places), strict=True))
    return tuple(found), float(ends[at])


# Depth-first search for a feasible order, whatever it costs.

# So many stops are looked at as the next one, at most: some seconds.
_LOOKS = 300_000
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

"""Stops that can be made in several ways, what leads from one to another, and what has to wait.

Knows only numbers. A stop (a seam) has states (a direction and a branch of configurations); what
leads from one state to another one costs something.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from selfmotion.basics import Array, Flags, Ints


@dataclass(frozen=True, eq=False)
class Before:
    """What has to come before what.

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
    """What there is to order.

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
        """Return what a round of states, in order, costs."""
        made = np.zeros(self.count, dtype=bool)
        total = self.first[states[0]] + self.last[states[-1]]
        total += sum(self.between[a, b] for a, b in pairwise(states))
        for state in states:
            total += self.made_after(made, [state])[0]
            made[self.of[state]] = True
        return float(total)

    def made_after(self, made: Flags, states: Sequence[int] | Ints) -> Array:
        """Return what states cost by themselves when stops (n,) are made before."""
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

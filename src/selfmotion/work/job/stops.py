"""Stops with several states each, costs of transitions, and precedences.

It knows only numbers. A stop (a seam) has states (a direction and a branch of configurations);
each transition from one state to another has a cost.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from selfmotion.basics import Array, Flags, Ints


@dataclass(frozen=True, eq=False)
class Precedences:
    """Precedences.

    Attributes
    ----------
    after : sequence of frozenset
        For each stop those that have to be visited before it.
    after_any : sequence of frozenset
        For each stop those of which one has to be visited before it; empty for none.
    """

    after: Sequence[frozenset[int]]
    after_any: Sequence[frozenset[int]]

    def allows(self, stop: int, visited: frozenset[int] | set[int]) -> bool:
        """Whether a stop may come next when others are visited."""
        any_of = self.after_any[stop]
        return self.after[stop] <= visited and (not any_of or not any_of.isdisjoint(visited))

    def keeps(self, order: Sequence[int]) -> bool:
        """Whether an order visits no stop too early."""
        visited: set[int] = set()
        for stop in order:
            if not self.allows(stop, visited):
                return False
            visited.add(stop)
        return True


@dataclass(frozen=True, eq=False)
class Stops(Precedences):
    """Stops to be ordered.

    Attributes
    ----------
    of : (m,)
        The stop of each state, numbered from 0 on.
    own : (m,)
        Cost of each state by itself.
    between : (m, m)
        Cost of each transition between states; inf where there is none.
    first, last : (m,)
        Cost of the transition from the start to each state, and from each state to the end.
    too_late : (m, n)
        Whether a state cannot be used any more once a stop is visited.
    late_price : float
        Cost of a state that is used too late.
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
        visited = np.zeros(self.count, dtype=bool)
        total = self.first[states[0]] + self.last[states[-1]]
        total += sum(self.between[a, b] for a, b in pairwise(states))
        for state in states:
            total += self.cost_after(visited, [state])[0]
            visited[self.of[state]] = True
        return float(total)

    def cost_after(self, visited: Flags, states: Sequence[int] | Ints) -> Array:
        """Return the costs of states, without moves, after stops (n,)."""
        is_late = (self.too_late[states] & visited).any(axis=1)
        return np.asarray(np.where(is_late, self.late_price, 0.0) + self.own[states])


@dataclass(frozen=True)
class Round:
    """An order of all stops, with the state of each.

    Attributes
    ----------
    states : tuple of int
        The states, in order; empty where there is no round.
    cost : float
        The cost of the round; inf where there is none.
    bound : float
        No round costs less.
    """

    states: tuple[int, ...]
    cost: float
    bound: float


NO_ROUND = Round((), np.inf, np.inf)


def along(stops: Stops, order: Sequence[int]) -> tuple[tuple[int, ...], float]:
    """Return the best states for an order of stops, and their cost; () and inf for none."""
    if not order or not stops.keeps(order):
        return (), np.inf
    visited = np.zeros(stops.count, dtype=bool)
    cost = stops.first[stops.states[order[0]]] + stops.cost_after(visited, stops.states[order[0]])
    predecessors: list[Ints] = []
    for one, other in pairwise(order):
        visited[one] = True
        totals = cost[:, None] + stops.between[np.ix_(stops.states[one], stops.states[other])]
        predecessors.append(totals.argmin(axis=0))
        cost = totals.min(axis=0) + stops.cost_after(visited, stops.states[other])
    ends = cost + stops.last[stops.states[order[-1]]]
    at = int(np.argmin(ends))
    if not np.isfinite(ends[at]):
        return (), np.inf
    places = [at]
    for back in reversed(predecessors):
        places.append(int(back[places[-1]]))
    found = (int(stops.states[k][i]) for k, i in zip(order, reversed(places), strict=True))
    return tuple(found), float(ends[at])

"""In which order, and how each: the shortest round of stops that can be made in several ways.

Knows only numbers. A stop (a seam) has states (a direction and a branch of configurations); what
leads from one state to another one costs something. Up to a dozen stops are ordered exactly, by
dynamic programming over the sets of stops made (M. Held, R. Karp, "A dynamic programming approach
to sequencing problems", 1962), with the states of the last one beside the set. More are inserted
one by one, then moved and turned round where that pays (2-opt and or-opt), with the best states for
each order by dynamic programming along it. What cannot be done costs more than any round there,
so that these steps lead out of it; where they do not, `feasible` looks for an order without costs.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from selfmotion.basics import Array, Ints
from selfmotion.job.feasible import feasible_order

# Stops that are ordered exactly, at most: the sets of more fit neither into time nor memory.
EXACT = 12
# Stretches that are moved or turned round are at most so long, and moved so far; rounds of tries.
_LONGEST, _FARTHEST, _ROUNDS = 30, 40, 12
# Of the orders in reach so many are looked at closely, if their bound is below this much of the way
# from the bound of the present one to its cost; what gains less [s] is rounding.
_TRIED, _PROMISE, _GAIN = 4, 0.5, 1e-9


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
    """

    of: Ints
    own: Array
    between: Array
    first: Array
    last: Array

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
        total = self.first[states[0]] + self.last[states[-1]] + self.own[list(states)].sum()
        return float(total + sum(self.between[a, b] for a, b in pairwise(states)))


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


_NONE = Round((), np.inf, np.inf)


def best_round(stops: Stops, given: Sequence[int] | None = None) -> Round:
    """Return the best round: exactly for a given order, or up to `EXACT` stops."""
    if given is not None:
        states, cost = along(stops, given)
        return Round(states, cost, cost) if states else _NONE
    if stops.count <= EXACT:
        return exact(stops)
    return improved(stops)


def exact(stops: Stops) -> Round:
    """Return the best round of all, by dynamic programming over sets of stops."""
    n, m = stops.count, len(stops.of)
    full = (1 << n) - 1
    best = np.full((1 << n, m), np.inf)
    before = np.full((1 << n, m), -1, dtype=np.int32)
    masks = [sum(1 << k for k in each) for each in stops.after]
    any_of = [sum(1 << k for k in each) for each in stops.after_any]
    for made in range(full):
        cost = best[made]
        if made and not np.isfinite(cost).any():
            continue
        for stop in range(n):
            bit = 1 << stop
            if made & bit or masks[stop] & ~made or (any_of[stop] and not any_of[stop] & made):
                continue
            states = stops.states[stop]
            if made == 0:
                new, came = stops.first[states], np.full(len(states), -1)
            else:
                ways = cost[:, None] + stops.between[:, states]
                came = ways.argmin(axis=0)
                new = ways[came, np.arange(len(states))]
            best[made | bit, states] = new + stops.own[states]
            before[made | bit, states] = came
    ends = best[full] + stops.last
    state = int(np.argmin(ends))
    cost = float(ends[state])
    if not np.isfinite(cost):
        return _NONE
    found, made = [], full
    while state >= 0:
        found.append(state)
        made, state = made & ~(1 << int(stops.of[state])), int(before[made, state])
    return Round(tuple(found[::-1]), cost, cost)


def along(stops: Stops, order: Sequence[int]) -> tuple[tuple[int, ...], float]:
    """Return the best states for an order of stops, and their cost; none where there are none."""
    if not order or not stops.keeps(order):
        return (), np.inf
    cost = stops.first[stops.states[order[0]]] + stops.own[stops.states[order[0]]]
    came: list[Ints] = []
    for one, other in pairwise(order):
        ways = cost[:, None] + stops.between[np.ix_(stops.states[one], stops.states[other])]
        came.append(ways.argmin(axis=0))
        cost = ways.min(axis=0) + stops.own[stops.states[other]]
    ends = cost + stops.last[stops.states[order[-1]]]
    at = int(np.argmin(ends))
    if not np.isfinite(ends[at]):
        return (), np.inf
    places = [at]
    for back in reversed(came):
        places.append(int(back[places[-1]]))
    found = (int(stops.states[k][i]) for k, i in zip(order, reversed(places), strict=True))
    return tuple(found), float(ends[at])


def improved(stops: Stops) -> Round:
    """Return a good round of many stops, and a bound of what any costs."""
    dear = _with_prices(stops)
    order = _nearest_first(dear)
    if order is None:
        return _NONE
    order = _settled(dear, order)
    if not along(stops, order)[0]:
        order = feasible_order(
            stops.after,
            stops.after_any,
            stops.states,
            np.isfinite(stops.between),
            np.isfinite(stops.first + stops.own),
            np.isfinite(stops.last),
        )
        order = [] if order is None else _settled(stops, order)
    states, cost = along(stops, order)
    return Round(states, cost, lower_bound(stops)) if states else _NONE


def _with_prices(stops: Stops) -> Stops:
    """Return the same where what cannot be done costs more than any round that can."""
    tables = stops.between, stops.first, stops.last
    dearest = max(float(np.abs(table[np.isfinite(table)]).max(initial=0.0)) for table in tables)
    price = (stops.count + 1) * (1.0 + dearest) + float(np.abs(stops.own).sum())
    between, first, last = (np.where(np.isfinite(table), table, price) for table in tables)
    return replace(stops, between=between, first=first, last=last)


def _settled(stops: Stops, order: list[int]) -> list[int]:
    """Return an order after moving and turning round stretches of it until none pays any more."""
    cost = along(stops, order)[1]
    for _ in range(_ROUNDS):
        before = cost
        order, cost = _swept(stops, order, cost)
        if not cost < before - _GAIN:
            break
    return order


def lower_bound(stops: Stops) -> float:
    """Return what no round costs less than: each stop has one before it, and one after it.

    The cheapest assignment of these, which need not form one round.
    """
    from scipy.optimize import linear_sum_assignment

    n = stops.count
    table = np.full((n + 1, n + 1), np.inf)
    table[:n, :n] = _by_stop(stops)
    np.fill_diagonal(table, np.inf)
    for stop, states in enumerate(stops.states):
        own = stops.own[states]
        table[n, stop] = (stops.first[states] + own).min()
        table[stop, n] = stops.last[states].min()
    large = 1e3 * (1.0 + np.where(np.isfinite(table), table, 0.0).sum())
    table = np.where(np.isfinite(table), table, large)
    rows, columns = linear_sum_assignment(table)
    return float(table[rows, columns].sum())


def _by_stop(stops: Stops) -> Array:
    """Return the least cost from one stop to another, and of that by itself, (n, n)."""
    whole = stops.between + stops.own
    rows = np.array([whole[states].min(axis=0) for states in stops.states])
    return np.array([rows[:, states].min(axis=1) for states in stops.states]).T


def _nearest_first(stops: Stops) -> list[int] | None:
    """Return an order that goes on with what is nearest, as far as that may be made."""
    order: list[int] = []
    made: set[int] = set()
    cost = stops.first + stops.own
    while len(order) < stops.count:
        may = [k for k in range(stops.count) if k not in made and stops.allows(k, made)]
        if not may:
            return None
        nearest = min(may, key=lambda k: float(cost[stops.states[k]].min()))
        states = stops.states[nearest]
        order.append(nearest)
        made.add(nearest)
        reached = cost[states]
        cost = (reached[:, None] - reached.min() + stops.between[states]).min(axis=0) + stops.own
    return order


def _swept(stops: Stops, order: list[int], cost: float) -> tuple[list[int], float]:
    """Return an order after moving or turning round each stretch of it where that pays."""
    table = _by_stop(stops)
    n = len(order)
    for length in (1, 2, 3):
        for first in range(n - length + 1):
            order, cost = _best_of(stops, order, cost, _moved(order, first, length), table)
    for first in range(n - 1):
        order, cost = _best_of(stops, order, cost, _turned(order, first), table)
    return order, cost


def _moved(order: list[int], first: int, length: int) -> list[list[int]]:
    """Return the orders with a stretch moved elsewhere, as it is and turned round."""
    stretch, rest = order[first : first + length], order[:first] + order[first + length :]
    places = range(max(0, first - _FARTHEST), min(len(rest), first + _FARTHEST) + 1)
    pieces = [stretch] if length == 1 else [stretch, stretch[::-1]]
    return [rest[:k] + piece + rest[k:] for k in places for piece in pieces if k != first]


def _turned(order: list[int], first: int) -> list[list[int]]:
    """Return the orders with a stretch from `first` on turned round."""
    ends = range(first + 2, min(len(order), first + _LONGEST) + 1)
    return [order[:first] + order[first:end][::-1] + order[end:] for end in ends]


def _best_of(
    stops: Stops, order: list[int], cost: float, others: list[list[int]], table: Array
) -> tuple[list[int], float]:
    """Return the best of an order and others, of which only those that promise something count."""
    least = _summed(table, order)
    rated = sorted((_summed(table, other), other) for other in others)
    # What stops cost at least tells what is worth a close look.
    for promised, other in rated[:_TRIED]:
        if promised >= least + _PROMISE * (cost - least):
            break
        found = along(stops, other)[1]
        if found < cost - _GAIN:
            return other, found
    return order, cost


def _summed(table: Array, order: list[int]) -> float:
    return float(table[order[:-1], order[1:]].sum())

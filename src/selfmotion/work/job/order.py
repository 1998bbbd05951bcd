"""The shortest round of stops that can be made in several ways: in which order, and how each."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from selfmotion.basics import Array, Ints, obey_interruption
from selfmotion.work.job.kernels import Tables, swept
from selfmotion.work.job.stops import NO_ROUND, Round, Stops, along, feasible_order

# Local search for many stops: 2-opt and or-opt.
#
# They are put one after the other by what is nearest, then stretches of the order are moved and
# turned round where that pays (2-opt and or-opt), each try with the best states by dynamic
# programming along what it changes: what the stops before cost and those after it, by state,
# stays. What cannot be done costs more than any round there, so that these steps lead out of it;
# where they do not, `feasible_order` looks for an order without costs.

# Rounds of tries, at most.
_ROUNDS = 12


def improved(stops: Stops, near: Sequence[int] | None = None) -> Round:
    """Return a good round of many stops, and a bound of what any costs.

    Parameters
    ----------
    stops : Stops
    near : sequence of int, optional
        An order to begin with; by default what is nearest comes next.
    """
    dear = _with_prices(stops)
    order = _nearest_first(dear) if near is None else list(near)
    if order is None:
        return NO_ROUND
    order = _settled(dear, order)
    if not along(stops, order)[0]:
        found = feasible_order(
            stops.after,
            stops.after_any,
            stops.states,
            np.isfinite(stops.between),
            np.isfinite(stops.first + stops.own),
            np.isfinite(stops.last),
            stops.too_late,
        )
        order = [] if found is None else _settled(dear, found)
    states, cost = along(stops, order)
    return Round(states, cost, lower_bound(stops)) if states else NO_ROUND


def _with_prices(stops: Stops) -> Stops:
    """Return finite costs: a forbidden transition costs more than any allowed round."""
    tables = stops.between, stops.first, stops.last
    dearest = max(float(np.abs(table[np.isfinite(table)]).max(initial=0.0)) for table in tables)
    price = (stops.count + 1) * (1.0 + dearest) + float(np.abs(stops.own).sum())
    between, first, last = (np.where(np.isfinite(table), table, price) for table in tables)
    return replace(stops, between=between, first=first, last=last, late_price=price)


def lower_bound(stops: Stops) -> float:
    """Return a lower bound of all rounds: each stop has one before it, and one after it.

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
    made, flags = set[int](), np.zeros(stops.count, dtype=bool)
    cost = stops.first + stops.made_after(flags, np.arange(len(stops.of)))
    while len(order) < stops.count:
        may = [k for k in range(stops.count) if k not in made and stops.allows(k, made)]
        if not may:
            return None
        nearest = min(may, key=lambda k: float(cost[stops.states[k]].min()))
        states = stops.states[nearest]
        order.append(nearest)
        made.add(nearest)
        flags[nearest] = True
        reached = cost[states]
        cost = (reached[:, None] - reached.min() + stops.between[states]).min(axis=0)
        cost += stops.made_after(flags, np.arange(len(stops.of)))
    return order


def _settled(stops: Stops, order: Sequence[int]) -> list[int]:
    """Return an order after moving and turning round stretches of it until none pays any more."""
    after = np.zeros((stops.count, stops.count), dtype=bool)
    for stop, those in enumerate(stops.after):
        after[stop, list(those)] = True
    tables = Tables(
        _padded([states.tolist() for states in stops.states]),
        stops.own,
        stops.between,
        stops.first,
        stops.last,
        _padded([np.flatnonzero(row).tolist() for row in stops.too_late]),
        float(stops.late_price),
        after,
        _padded([sorted(those) for those in stops.after_any]),
    )
    found = np.array(order, dtype=np.int64)
    for _ in range(_ROUNDS):
        obey_interruption()
        if not swept(found, tables):
            break
    return [int(stop) for stop in found]


def _padded(rows: Sequence[Sequence[int]]) -> Ints:
    table = np.full((len(rows), max(1, *map(len, rows))), -1, dtype=np.int64)
    for line, row in zip(table, rows, strict=True):
        line[: len(row)] = row
    return table


# The shortest round: exact for few stops.
#
# Up to a dozen stops are ordered exactly, by dynamic programming over the sets of stops made (M.
# Held, R. Karp, "A dynamic programming approach to sequencing problems", 1962), with the states
# of the last one beside the set; more of them by `improved`.

# Stops that are ordered exactly, at most: the sets of more fit neither into time nor memory.
EXACT = 12


def best_round(
    stops: Stops, given: Sequence[int] | None = None, near: Sequence[int] | None = None
) -> Round:
    """Return the best round: exactly for a `given` order, or up to `EXACT` stops.

    Of more stops a good one, which is looked for from an order that is `near` to it.
    """
    if given is not None:
        states, cost = along(stops, given)
        return Round(states, cost, cost) if states else NO_ROUND
    if stops.count <= EXACT:
        return exact(stops)
    return improved(stops, near)


def exact(stops: Stops) -> Round:
    """Return the best round of all, by dynamic programming over sets of stops."""
    n, m = stops.count, len(stops.of)
    full = (1 << n) - 1
    best = np.full((1 << n, m), np.inf)
    before = np.full((1 << n, m), -1, dtype=np.int32)
    masks = [sum(1 << k for k in each) for each in stops.after]
    any_of = [sum(1 << k for k in each) for each in stops.after_any]
    bits = 1 << np.arange(n)
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
            best[made | bit, states] = new + stops.made_after((bits & made) > 0, states)
            before[made | bit, states] = came
    ends = best[full] + stops.last
    state = int(np.argmin(ends))
    cost = float(ends[state])
    if not np.isfinite(cost):
        return NO_ROUND
    found, made = [], full
    while state >= 0:
        found.append(state)
        made, state = made & ~(1 << int(stops.of[state])), int(before[made, state])
    return Round(tuple(found[::-1]), cost, cost)

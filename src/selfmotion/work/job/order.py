"""The shortest round of stops with several states each: the order, and the state of each."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from selfmotion.basics import Array, Ints, obey_interruption
from selfmotion.work.job.feasible_order import feasible_order
from selfmotion.work.job.stops import NO_ROUND, Round, Stops, along
from selfmotion.work.job.two_opt import Tables, sweep

# Local search for many stops: 2-opt and or-opt.
#
# The first order is by nearest neighbours. Then segments of it are moved and reversed where that
# lowers the cost (2-opt and or-opt). The best states of each trial are found by dynamic programming
# along the segment that it changes: the costs of stops before and after it, by state, stay.
# Forbidden transitions cost more than any allowed round, so that these steps lead out of them;
# where they do not, `feasible_order` finds an order without regard to costs.

# Sweeps over an order, at most.
_SWEEPS = 12


def improved(stops: Stops, near: Sequence[int] | None = None) -> Round:
    """Return a good round of many stops, with a lower bound of the cost of any round.

    Parameters
    ----------
    stops : Stops
    near : sequence of int, optional
        An order to begin with; by default that of nearest neighbours.
    """
    dear = _with_prices(stops)
    order = _nearest_first(dear) if near is None else list(near)
    if order is None:
        return NO_ROUND
    order = _local_optimum(dear, order)
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
        order = [] if found is None else _local_optimum(dear, found)
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
    """Return the order of nearest neighbours that precedences allow; None for a dead end."""
    order: list[int] = []
    visited, flags = set[int](), np.zeros(stops.count, dtype=bool)
    cost = stops.first + stops.cost_after(flags, np.arange(len(stops.of)))
    while len(order) < stops.count:
        may = [k for k in range(stops.count) if k not in visited and stops.allows(k, visited)]
        if not may:
            return None
        nearest = min(may, key=lambda k: float(cost[stops.states[k]].min()))
        states = stops.states[nearest]
        order.append(nearest)
        visited.add(nearest)
        flags[nearest] = True
        reached = cost[states]
        cost = (reached[:, None] - reached.min() + stops.between[states]).min(axis=0)
        cost += stops.cost_after(flags, np.arange(len(stops.of)))
    return order


def _local_optimum(stops: Stops, order: Sequence[int]) -> list[int]:
    """Return an order in which no segment can be moved or reversed at a gain."""
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
    for _ in range(_SWEEPS):
        obey_interruption()
        if not sweep(found, tables):
            break
    return [int(stop) for stop in found]


def _padded(rows: Sequence[Sequence[int]]) -> Ints:
    table = np.full((len(rows), max(1, *map(len, rows))), -1, dtype=np.int64)
    for line, row in zip(table, rows, strict=True):
        line[: len(row)] = row
    return table


# The shortest round: exact for few stops.
#
# Up to a dozen stops are ordered exactly, by dynamic programming over the sets of stops visited and
# the states of the last one (M. Held, R. Karp, "A dynamic programming approach to sequencing
# problems", 1962); more of them by `improved`.

# Stops that are ordered exactly, at most: time and memory double with each further one.
EXACT = 12


def best_round(
    stops: Stops, given: Sequence[int] | None = None, near: Sequence[int] | None = None
) -> Round:
    """Return the best round: exactly for a `given` order, or up to `EXACT` stops.

    Of more stops a good one, found by local search from an order `near` to it.
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
    for visited in range(full):
        cost = best[visited]
        if visited and not np.isfinite(cost).any():
            continue
        for stop in range(n):
            bit = 1 << stop
            supported = not any_of[stop] or any_of[stop] & visited
            if visited & bit or masks[stop] & ~visited or not supported:
                continue
            states = stops.states[stop]
            if visited == 0:
                new, predecessors = stops.first[states], np.full(len(states), -1)
            else:
                totals = cost[:, None] + stops.between[:, states]
                predecessors = totals.argmin(axis=0)
                new = totals[predecessors, np.arange(len(states))]
            best[visited | bit, states] = new + stops.cost_after((bits & visited) > 0, states)
            before[visited | bit, states] = predecessors
    ends = best[full] + stops.last
    state = int(np.argmin(ends))
    cost = float(ends[state])
    if not np.isfinite(cost):
        return NO_ROUND
    found, visited = [], full
    while state >= 0:
        found.append(state)
        visited, state = visited & ~(1 << int(stops.of[state])), int(before[visited, state])
    return Round(tuple(found[::-1]), cost, cost)

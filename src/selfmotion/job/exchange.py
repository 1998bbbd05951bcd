"""Many stops in a good order.

They are put one after the other by what is nearest, then stretches of the order are moved and
turned round where that pays (2-opt and or-opt), each try with the best states by dynamic
programming along what it changes: what the stops before cost and those after it, by state, stays.
What cannot be done costs more than any round there, so that these steps lead out of it; where they
do not, `feasible` looks for an order without costs.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, Flags, Ints, called, kernel, obey_interruption
from selfmotion.job.feasible import feasible_order
from selfmotion.job.stops import NO_ROUND, Round, Stops, along

# Stretches that are turned round are at most so long, those that are moved so long and moved so
# far; rounds of tries.
_TURNED, _MOVED, _FARTHEST, _ROUNDS = 40, 3, 40, 12
# What gains less than this [s] is rounding.
_GAIN = 1e-9


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
    """Return the same where what cannot be done costs more than any round that can."""
    tables = stops.between, stops.first, stops.last
    dearest = max(float(np.abs(table[np.isfinite(table)]).max(initial=0.0)) for table in tables)
    price = (stops.count + 1) * (1.0 + dearest) + float(np.abs(stops.own).sum())
    between, first, last = (np.where(np.isfinite(table), table, price) for table in tables)
    return replace(stops, between=between, first=first, last=last, late_price=price)


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


class _Tables(NamedTuple):
    """What stops cost, as compiled functions take it: rows of -1 filled up to one length.

    Attributes
    ----------
    states : (n, w)
        Of each stop.
    own, between, first, last
        See `Stops`.
    lost : (m, k)
        The stops after which each state is too late.
    price : float
        What that costs.
    after : (n, n)
        Whether a stop has to come after another one.
    any_of : (n, l)
        The stops of which one has to come before each.
    """

    states: Ints
    own: Array
    between: Array
    first: Array
    last: Array
    lost: Ints
    price: float
    after: Flags
    any_of: Ints


def _settled(stops: Stops, order: Sequence[int]) -> list[int]:
    """Return an order after moving and turning round stretches of it until none pays any more."""
    after = np.zeros((stops.count, stops.count), dtype=bool)
    for stop, those in enumerate(stops.after):
        after[stop, list(those)] = True
    tables = _Tables(
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
        if not _swept(found, tables):
            break
    return [int(stop) for stop in found]


def _padded(rows: Sequence[Sequence[int]]) -> Ints:
    table = np.full((len(rows), max(1, *map(len, rows))), -1, dtype=np.int64)
    for line, row in zip(table, rows, strict=True):
        line[: len(row)] = row
    return table


@called
def _alone(state: int, position: int, place: Ints, tables: _Tables) -> float:
    """Return what a state costs by itself at a position."""
    for stop in tables.lost[state]:
        if stop < 0:
            break
        if place[stop] < position:
            return tables.own[state] + tables.price  # type: ignore[no-any-return]
    return tables.own[state]  # type: ignore[no-any-return]


@called
def _reach(
    out: Array, cost: Array, order: Ints, position: int, place: Ints, tables: _Tables
) -> None:
    """Set what it costs to have made a stop, by its states, from that of the one before it."""
    out[:] = np.inf
    for b, state in enumerate(tables.states[order[position]]):
        if state < 0:
            continue
        if position == 0:
            least = tables.first[state]
        else:
            least = np.inf
            for a, earlier in enumerate(tables.states[order[position - 1]]):
                if earlier >= 0:
                    least = min(least, cost[a] + tables.between[earlier, state])
        out[b] = least + _alone(state, position, place, tables)


@called
def _judge(ahead: Array, behind: Array, place: Ints, order: Ints, tables: _Tables) -> float:
    """Set what stops cost by their states with those before them, and those after each; the sum."""
    n = len(order)
    for i in range(n):
        place[order[i]] = i
    for i in range(n):
        _reach(ahead[i], ahead[i - 1], order, i, place, tables)
    behind[:] = np.inf
    for i in range(n - 1, -1, -1):
        for a, state in enumerate(tables.states[order[i]]):
            if state < 0:
                continue
            if i == n - 1:
                behind[i, a] = tables.last[state]
                continue
            for b, later in enumerate(tables.states[order[i + 1]]):
                if later >= 0:
                    onward = tables.between[state, later] + behind[i + 1, b]
                    onward += _alone(later, i + 1, place, tables)
                    behind[i, a] = min(behind[i, a], onward)
    return (ahead[n - 1] + behind[n - 1]).min()  # type: ignore[no-any-return]


@called
def _may(order: Ints, low: int, high: int, place: Ints, tables: _Tables) -> bool:
    """Whether stops at positions from `low` to `high` have before them what they need."""
    for i in range(low, high + 1):
        stop = order[i]
        for j in range(i + 1, high + 1):
            if tables.after[stop, order[j]]:
                return False
        found = tables.any_of[stop, 0] < 0
        for other in tables.any_of[stop]:
            found = found or (other >= 0 and place[other] < i)
        if not found:
            return False
    return True


@called
def _tried(
    trial: Ints,
    low: int,
    high: int,
    ahead: Array,
    behind: Array,
    place: Ints,
    tables: _Tables,
) -> float:
    """Return what an order costs that is another one from `low` to `high` only; inf for none."""
    n, total = len(trial), np.inf
    present = np.empty(high - low + 1, np.int64)
    for i in range(low, high + 1):
        present[i - low] = place[trial[i]]
        place[trial[i]] = i
    if _may(trial, low, high, place, tables):
        cost, reached = np.empty(ahead.shape[1]), np.empty(ahead.shape[1])
        if low:
            cost[:] = ahead[low - 1]
        for i in range(low, min(high + 1, n - 1) + 1):
            _reach(reached, cost, trial, i, place, tables)
            cost[:] = reached
        if high < n - 1:
            total = (cost + behind[high + 1]).min()
        else:
            for a, state in enumerate(tables.states[trial[n - 1]]):
                if state >= 0:
                    total = min(total, cost[a] + tables.last[state])
    for i in range(low, high + 1):
        place[trial[i]] = present[i - low]
    return total


@kernel
def _swept(order: Ints, tables: _Tables) -> bool:
    """Move and turn round stretches of an order, in place, where that pays; whether any did."""
    n, width = len(order), tables.states.shape[1]
    ahead, behind = np.empty((n, width)), np.empty((n, width))
    place, trial, chosen = order.copy(), order.copy(), order.copy()
    cost = _judge(ahead, behind, place, order, tables)
    changed = False
    # Stretches of these lengths are moved; 0 stands for those of any length, which are turned.
    for length in range(_MOVED, -1, -1):
        for start in range(n - max(length, 1) + 1):
            if length:
                begin, end = max(0, start - _FARTHEST), min(n - length, start + _FARTHEST) + 1
            else:
                begin, end = start + 2, min(n, start + _TURNED) + 1
            best, low, high = cost - _GAIN, 0, -1
            for to in range(begin, end):
                for turned in range(2 if length > 1 else 1):
                    if length and to == start and not turned:
                        continue
                    # Only what lies between the old place and the new one changes.
                    trial[:] = order
                    if length:
                        first, last = min(start, to), max(start, to) + length - 1
                        passed = (
                            order[first:start] if to < start else order[start + length : last + 1]
                        )
                        shift = length if to < start else 0
                        trial[first + shift : first + shift + len(passed)] = passed
                        stretch = order[start : start + length]
                        trial[to : to + length] = stretch[::-1] if turned else stretch
                    else:
                        first, last = start, to - 1
                        trial[first:to] = order[first:to][::-1]
                    found = _tried(trial, first, last, ahead, behind, place, tables)
                    if found < best:
                        best, low, high = found, first, last
                        chosen[low : high + 1] = trial[low : high + 1]
            if high >= low:
                order[low : high + 1] = chosen[low : high + 1]
                cost = _judge(ahead, behind, place, order, tables)
                changed = True
    return changed

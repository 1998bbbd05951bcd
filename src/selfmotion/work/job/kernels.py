"""Exchanges in an order of many stops, compiled."""

from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, Flags, Ints, called, kernel

# Longest segment of an order that is reversed [stops].
_TURNED = 40
# Longest segment of an order that is moved [stops] …
_MOVED = 3
# … and how far [stops].
_FARTHEST = 40
# A gain below this is rounding [s].
_GAIN = 1e-9


class Tables(NamedTuple):
    """Costs of stops as arrays for compiled functions: rows, filled up with -1.

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


@called
def _alone(state: int, position: int, place: Ints, tables: Tables) -> float:
    """Return the cost of a state at a position, without moves."""
    for stop in tables.lost[state]:
        if stop < 0:
            break
        if place[stop] < position:
            return tables.own[state] + tables.price  # type: ignore[no-any-return]
    return tables.own[state]  # type: ignore[no-any-return]


@called
def _reach(
    out: Array, cost: Array, order: Ints, position: int, place: Ints, tables: Tables
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
def _judge(ahead: Array, behind: Array, place: Ints, order: Ints, tables: Tables) -> float:
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
def _may(order: Ints, low: int, high: int, place: Ints, tables: Tables) -> bool:
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
    tables: Tables,
) -> float:
    """Return the cost of an order that differs from `low` to `high` only; inf if not allowed."""
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
def swept(order: Ints, tables: Tables) -> bool:
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

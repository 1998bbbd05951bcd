"""2-opt and or-opt on an order of stops with states, compiled.

2-opt reverses a segment of the order (G. Croes, "A method for solving traveling-salesman problems",
1958). Or-opt moves a short segment to another place (I. Or, "Traveling salesman-type combinatorial
problems", 1976). The best states of a trial order are found by dynamic
programming along the positions that it changes: the least costs up to each stop, and from each stop
on, are known from the present order.
"""

from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, Flags, Ints, called, kernel

# Longest segment of an order that is reversed [stops].
_MAX_REVERSED = 40
# Longest segment of an order that is moved [stops] …
_MAX_MOVED = 3
# … and how far [stops].
_MAX_SHIFT = 40
# A gain below this is rounding [s].
_GAIN = 1e-9


class Tables(NamedTuple):
    """Costs of stops as arrays for compiled functions; rows of indices are filled up with -1.

    Attributes
    ----------
    states : (n, w)
        The states of each stop.
    own, between, first, last
        See `Stops`.
    lost : (m, k)
        The stops after which each state is too late.
    price : float
        Cost of a state that is too late.
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


class _Search(NamedTuple):
    """The present order of n stops with up to w states each, its costs, and a trial order.

    Attributes
    ----------
    order, place : (n,)
        The stop at each position, and the position of each stop.
    ahead : (n, w)
        Least cost of the order up to each position, by the state of the stop there.
    behind : (n, w)
        Least cost from each position to the end, by the state of the stop there, without the state.
    trial, best : (n,)
        An order that is tried, and the best one of those tried; outside the segment that was
        changed, `best` means nothing.
    """

    order: Ints
    place: Ints
    ahead: Array
    behind: Array
    trial: Ints
    best: Ints


@kernel
def sweep(order: Ints, tables: Tables) -> bool:
    """Move and reverse segments of an order, in place, where that pays; return whether any did."""
    n, width = len(order), tables.states.shape[1]
    ahead, behind = np.empty((n, width)), np.empty((n, width))
    search = _Search(order, order.copy(), ahead, behind, order.copy(), order.copy())
    cost = _evaluate(search, tables)
    changed = False
    for length in range(_MAX_MOVED, 0, -1):
        for start in range(n - length + 1):
            low, high = _best_move(start, length, cost - _GAIN, search, tables)
            if high >= low:
                order[low : high + 1] = search.best[low : high + 1]
                cost = _evaluate(search, tables)
                changed = True
    for start in range(n):
        low, high = _best_reversal(start, cost - _GAIN, search, tables)
        if high >= low:
            order[low : high + 1] = search.best[low : high + 1]
            cost = _evaluate(search, tables)
            changed = True
    return changed


@called
def _best_move(
    start: int, length: int, limit: float, search: _Search, tables: Tables
) -> tuple[int, int]:
    """Try all moves of a segment; return the first and last position that the best one changes.

    It is in `search.best`, and costs less than `limit`; (0, -1) if there is none. A moved segment
    may be reversed as well.
    """
    order, trial, n = search.order, search.trial, len(search.order)
    best, low, high = limit, 0, -1
    for to in range(max(0, start - _MAX_SHIFT), min(n - length, start + _MAX_SHIFT) + 1):
        for is_reversed in range(2 if length > 1 else 1):
            if to == start and not is_reversed:
                continue
            # Only what lies between the old place and the new one changes.
            trial[:] = order
            first, last = min(start, to), max(start, to) + length - 1
            passed = order[first:start] if to < start else order[start + length : last + 1]
            shift = length if to < start else 0
            trial[first + shift : first + shift + len(passed)] = passed
            segment = order[start : start + length]
            trial[to : to + length] = segment[::-1] if is_reversed else segment
            cost = _trial_cost(first, last, search, tables)
            if cost < best:
                best, low, high = cost, first, last
                search.best[low : high + 1] = trial[low : high + 1]
    return low, high


@called
def _best_reversal(start: int, limit: float, search: _Search, tables: Tables) -> tuple[int, int]:
    """Try all reversals of a segment from `start` on; return as `_best_move` does."""
    order, trial, n = search.order, search.trial, len(search.order)
    best, low, high = limit, 0, -1
    for end in range(start + 2, min(n, start + _MAX_REVERSED) + 1):
        trial[:] = order
        trial[start:end] = order[start:end][::-1]
        cost = _trial_cost(start, end - 1, search, tables)
        if cost < best:
            best, low, high = cost, start, end - 1
            search.best[low : high + 1] = trial[low : high + 1]
    return low, high


@called
def _evaluate(search: _Search, tables: Tables) -> float:
    """Set `place`, `ahead` and `behind` of an order; return its least cost."""
    order, place = search.order, search.place
    ahead, behind = search.ahead, search.behind
    n = len(order)
    for i in range(n):
        place[order[i]] = i
    for i in range(n):
        _extend(ahead[i], ahead[i - 1], order, i, place, tables)
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
                    onward += _state_cost(later, i + 1, place, tables)
                    behind[i, a] = min(behind[i, a], onward)
    return (ahead[n - 1] + behind[n - 1]).min()  # type: ignore[no-any-return]


@called
def _trial_cost(low: int, high: int, search: _Search, tables: Tables) -> float:
    """Return the cost of the trial order, which differs at `low` to `high`; inf if not allowed."""
    trial, place = search.trial, search.place
    n, total = len(trial), np.inf
    present = np.empty(high - low + 1, np.int64)
    for i in range(low, high + 1):
        present[i - low] = place[trial[i]]
        place[trial[i]] = i
    if _keeps_precedences(trial, low, high, place, tables):
        cost, extended = np.empty(search.ahead.shape[1]), np.empty(search.ahead.shape[1])
        if low:
            cost[:] = search.ahead[low - 1]
        for i in range(low, min(high + 1, n - 1) + 1):
            _extend(extended, cost, trial, i, place, tables)
            cost[:] = extended
        if high < n - 1:
            total = (cost + search.behind[high + 1]).min()
        else:
            for a, state in enumerate(tables.states[trial[n - 1]]):
                if state >= 0:
                    total = min(total, cost[a] + tables.last[state])
    for i in range(low, high + 1):
        place[trial[i]] = present[i - low]
    return total


@called
def _keeps_precedences(order: Ints, low: int, high: int, place: Ints, tables: Tables) -> bool:
    """Whether stops at positions from `low` to `high` have before them what they need."""
    for i in range(low, high + 1):
        stop = order[i]
        for j in range(i + 1, high + 1):
            if tables.after[stop, order[j]]:
                return False
        is_supported = tables.any_of[stop, 0] < 0
        for other in tables.any_of[stop]:
            is_supported = is_supported or (other >= 0 and place[other] < i)
        if not is_supported:
            return False
    return True


@called
def _extend(
    cost: Array, before: Array, order: Ints, position: int, place: Ints, tables: Tables
) -> None:
    """Set the least `cost` of an order up to a position from that up to the one `before`.

    Both are by the state of the stop there, (w,).
    """
    cost[:] = np.inf
    for b, state in enumerate(tables.states[order[position]]):
        if state < 0:
            continue
        if position == 0:
            smallest = tables.first[state]
        else:
            smallest = np.inf
            for a, earlier in enumerate(tables.states[order[position - 1]]):
                if earlier >= 0:
                    smallest = min(smallest, before[a] + tables.between[earlier, state])
        cost[b] = smallest + _state_cost(state, position, place, tables)


@called
def _state_cost(state: int, position: int, place: Ints, tables: Tables) -> float:
    """Return the cost of a state at a position, without moves."""
    for stop in tables.lost[state]:
        if stop < 0:
            break
        if place[stop] < position:
            return tables.own[state] + tables.price  # type: ignore[no-any-return]
    return tables.own[state]  # type: ignore[no-any-return]

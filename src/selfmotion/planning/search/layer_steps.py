"""Steps between the vertices of two layers: compiled loops over all pairs that are near enough."""

import numpy as np

from selfmotion.basics import Array, Flags, Ints, inlined, kernel


@kernel
def wrapped(difference: float, revolute: bool) -> float:
    """Return the difference of two coordinates, modulo a turn where the joint is revolute."""
    if revolute:
        turns = np.floor(difference / (2.0 * np.pi) + 0.5)
        return float(difference - 2.0 * np.pi * turns)
    return difference


@inlined
def _window(before: Array, value: float, step: float, is_unbounded: bool) -> tuple[int, int]:
    """Return the range of vertices, sorted by the first joint, whose first joint is near enough."""
    if is_unbounded:
        return 0, len(before)
    start = int(np.searchsorted(before[:, 0], value - step))
    return start, int(np.searchsorted(before[:, 0], value + step, side="right"))


@kernel
def relax_steps(
    before: Array,
    cost: Array,
    after: Array,
    largest_step: Array,
    is_unbounded: Flags,
    weights: Array,
    least_cost: Array,
    parent: Ints,
) -> None:
    """Set the least cost (M,) of chains to the vertices `after` (M, n), and their predecessors.

    Chains to the vertices `before` (N, n) have a `cost` (N,). A step from there adds Σ w|Δq|, with
    `weights` (n,); no joint may move by more than `largest_step` (n,), and joints with
    `is_unbounded` (n,) are compared modulo 2π. `before` is sorted by its first joint, unless that
    one is unbounded. `parent` is -1 where no step is short enough.
    """
    # Not `near_pairs` and `lower_to_cheapest`: a sum that exceeds the least one so far ends early.
    n = after.shape[1]
    for j in range(after.shape[0]):
        least_cost[j], parent[j] = np.inf, -1
        start, end = _window(before, after[j, 0], largest_step[0], is_unbounded[0])
        for i in range(start, end):
            total = cost[i]
            for k in range(n):
                step = abs(wrapped(after[j, k] - before[i, k], is_unbounded[k]))
                total += weights[k] * step
                if step > largest_step[k] or total >= least_cost[j]:
                    total = np.inf
                    break
            if total < least_cost[j]:
                least_cost[j], parent[j] = total, i


@kernel
def near_pairs(
    before: Array, after: Array, largest_step: Array, is_unbounded: Flags
) -> tuple[Ints, Ints]:
    """Return the indices (P,), (P,) of pairs of vertices, `before` (N, n) and `after` (M, n).

    All those of which no joint differs by more than `largest_step`; see `relax_steps`.
    """
    n, capacity = after.shape[1], 4 * (before.shape[0] + after.shape[0])
    first, second = np.empty(capacity, dtype=np.intp), np.empty(capacity, dtype=np.intp)
    count = 0
    for j in range(after.shape[0]):
        start, end = _window(before, after[j, 0], largest_step[0], is_unbounded[0])
        for i in range(start, end):
            is_near = True
            for k in range(n):
                if abs(wrapped(after[j, k] - before[i, k], is_unbounded[k])) > largest_step[k]:
                    is_near = False
                    break
            if is_near:
                if count == capacity:
                    capacity *= 2
                    enlarged = np.empty((2, capacity), dtype=np.intp)
                    enlarged[0, :count], enlarged[1, :count] = first, second
                    first, second = enlarged[0], enlarged[1]
                first[count], second[count] = i, j
                count += 1
    return first[:count].copy(), second[:count].copy()


@kernel
def lower_to_cheapest(
    first: Ints, second: Ints, price: Array, cost: Array, least_cost: Array, parent: Ints
) -> None:
    """Lower the least cost (M,) by steps between pairs (P,), (P,) of a price (P,)."""
    for k in range(len(first)):
        total = cost[first[k]] + price[k]
        if total < least_cost[second[k]]:
            least_cost[second[k]], parent[second[k]] = total, first[k]


def cheapest(
    first: Ints, second: Ints, price: Array, cost: Array, count: int
) -> tuple[Array, Ints]:
    """Return the least costs (M,) by steps between pairs (P,), (P,) of a price (P,), and parents.

    `cost` (N,) is that of chains to the first vertices of the pairs, and M is `count`. inf and -1
    where no step arrives.
    """
    least_cost, parent = np.full(count, np.inf), np.full(count, -1, dtype=np.intp)
    lower_to_cheapest(first, second, price, cost, least_cost, parent)
    return least_cost, parent


def unturned(difference: Array, is_unbounded: Flags) -> Array:
    """Return differences (…, n), modulo 2π in joints without limits."""
    turn = 2.0 * np.pi
    return np.where(is_unbounded, difference - turn * np.round(difference / turn), difference)

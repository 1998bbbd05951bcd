"""What numba compiles for chains of nodes: steps between neighbours, and the cheapest of them."""

import numpy as np

from selfmotion.basics import Array, Flags, Ints, kernel


@kernel
def wrapped(difference: float, revolute: bool) -> float:
    """Return the difference of two coordinates, modulo a turn where the joint is revolute."""
    if revolute:
        turns = np.floor(difference / (2.0 * np.pi) + 0.5)
        return float(difference - 2.0 * np.pi * turns)
    return difference


@kernel
def extend(
    before: Array,
    cost: Array,
    after: Array,
    largest_step: Array,
    turning: Flags,
    weights: Array,
    reach: Array,
    parent: Ints,
) -> None:
    """Set `reach` (M,), the least cost at `after` (M, n) over steps from `before` (N, n).

    The cost of a step is Σ w|Δq| with `weights` (n,); `turning` joints count modulo turns. `before`
    is sorted by its first joint unless that one turns. `parent` is -1 where no step is short
    enough.
    """
    n, many = after.shape[1], before.shape[0]
    for j in range(after.shape[0]):
        reach[j], parent[j] = np.inf, -1
        first = 0
        if not turning[0]:
            first = int(np.searchsorted(before[:, 0], after[j, 0] - largest_step[0]))
        for i in range(first, many):
            if not turning[0] and before[i, 0] > after[j, 0] + largest_step[0]:
                break
            total = cost[i]
            for k in range(n):
                step = abs(wrapped(after[j, k] - before[i, k], turning[k]))
                total += weights[k] * step
                if step > largest_step[k] or total >= reach[j]:
                    total = np.inf
                    break
            if total < reach[j]:
                reach[j], parent[j] = total, i


@kernel
def near_pairs(
    before: Array, after: Array, largest_step: Array, turning: Flags
) -> tuple[Ints, Ints]:
    """Return the pairs of nodes (P,), (P,) from `before` (N, n) to `after` (M, n) that are near.

    No joint may move by more than `largest_step`; otherwise as `extend`.
    """
    n, many = after.shape[1], before.shape[0]
    room = 4 * (many + after.shape[0])
    first, second = np.empty(room, dtype=np.intp), np.empty(room, dtype=np.intp)
    count = 0
    for j in range(after.shape[0]):
        begin = 0
        if not turning[0]:
            begin = int(np.searchsorted(before[:, 0], after[j, 0] - largest_step[0]))
        for i in range(begin, many):
            if not turning[0] and before[i, 0] > after[j, 0] + largest_step[0]:
                break
            near = True
            for k in range(n):
                if abs(wrapped(after[j, k] - before[i, k], turning[k])) > largest_step[k]:
                    near = False
                    break
            if near:
                if count == room:
                    room *= 2
                    longer = np.empty((2, room), dtype=np.intp)
                    longer[0, :count], longer[1, :count] = first, second
                    first, second = longer[0], longer[1]
                first[count], second[count] = i, j
                count += 1
    return first[:count].copy(), second[:count].copy()


@kernel
def spread_out(q: Array, apart: Array, most: int) -> Ints:
    """Return the rows of q (K, n) to keep, at most so many: the earlier ones of near ones.

    First those farther from all kept ones in some coordinate than apart[0], then apart[1], ….
    """
    n, many = q.shape[1], len(q)
    kept, count = np.empty(min(most, many), dtype=np.intp), 0
    taken = np.zeros(many, dtype=np.bool_)
    for distance in apart:
        for k in range(many):
            if taken[k] or count == len(kept):
                continue
            alone = True
            for other in range(count):
                far = False
                for i in range(n):
                    if abs(q[k, i] - q[kept[other], i]) > distance:
                        far = True
                        break
                if not far:
                    alone = False
                    break
            if alone:
                taken[k], kept[count] = True, k
                count += 1
    return kept[:count]


@kernel
def cheapest(
    first: Ints, second: Ints, price: Array, cost: Array, reach: Array, parent: Ints
) -> None:
    """Lower `reach` (M,) to the least cost over steps with prices (P,), and set `parent`."""
    for k in range(len(first)):
        total = cost[first[k]] + price[k]
        if total < reach[second[k]]:
            reach[second[k]], parent[second[k]] = total, first[k]

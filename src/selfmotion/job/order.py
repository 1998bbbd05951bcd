"""In which order, and how each: the shortest round of stops that can be made in several ways.

Up to a dozen stops are ordered exactly, by dynamic programming over the sets of stops made
(M. Held, R. Karp, "A dynamic programming approach to sequencing problems", 1962), with the states
of the last one beside the set; more of them as `exchange` says.
"""

from collections.abc import Sequence

import numpy as np

from selfmotion.job.exchange import improved
from selfmotion.job.stops import NO_ROUND, Round, Stops, along

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

"""Orders are the best there are where they say so, and never break what has to come first."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from selfmotion.work.job.order import best_round, exact, improved, lower_bound
from selfmotion.work.job.stops import Stops, along

# Sums of a dozen costs in another order differ by this share.
ROUNDING = 1e-12


def random_stops(
    rng: np.random.Generator, count: int, states: int, share: float = 0.0, late: float = 0.0
) -> Stops:
    """Return stops with random costs; a share of them has to come after another one.

    And of all pairs of a state and another stop that share where the stop makes it too late.
    """
    of = np.repeat(np.arange(count), states)
    m = len(of)
    # A hidden order, so that some order keeps what has to come first.
    hidden = rng.permutation(count)
    after = [frozenset[int]()] * count
    after_any = [frozenset[int]()] * count
    for place in range(1, count):
        if rng.uniform() < share:
            after[hidden[place]] = frozenset({int(hidden[rng.integers(place)])})
        elif rng.uniform() < share:
            after_any[hidden[place]] = frozenset(hidden[:place][-2:].tolist())
    between = rng.uniform(0.1, 1.0, (m, m))
    between[rng.uniform(size=(m, m)) < 0.1] = np.inf
    ends = rng.uniform(0.0, 1.0, (3, m))
    too_late = rng.uniform(size=(m, count)) < late
    too_late[np.arange(m), of] = False
    return Stops(after, after_any, of, ends[0], between, ends[1], ends[2], too_late)


def by_force(stops: Stops) -> float:
    """Return the least cost of all orders and states, one by one."""

    def onward(made: frozenset[int], state: int, cost: float) -> float:
        if len(made) == stops.count:
            return cost + stops.last[state]
        return min(
            (
                onward(made | {stop}, other, cost + between[state][other] + own[other])
                for stop in range(stops.count)
                if stop not in made and stops.allows(stop, made)
                for other in states[stop]
                if made.isdisjoint(lost[other])
            ),
            default=np.inf,
        )

    between, own = stops.between.tolist(), stops.own.tolist()
    states = [each.tolist() for each in stops.states]
    lost = [np.flatnonzero(row).tolist() for row in stops.too_late]
    begun = (
        onward(frozenset({stop}), state, float(stops.first[state] + stops.own[state]))
        for stop in range(stops.count)
        if stops.allows(stop, frozenset())
        for state in states[stop]
    )
    return min(begun, default=np.inf)


@pytest.mark.parametrize("seed", range(20))
def test_up_to_a_dozen_stops_the_order_is_the_best_of_all(seed) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(5, 7))
    stops = random_stops(rng, count, 2, share=0.4 * (seed % 2), late=0.1 * (seed % 3))
    found = best_round(stops)
    assert found.cost == pytest.approx(by_force(stops), rel=ROUNDING)
    # Where states are too late there may be no round at all.
    assert found.states or seed % 3
    if found.states:
        assert found.cost == pytest.approx(stops.cost(found.states), rel=ROUNDING)
        assert stops.keeps(stops.of[list(found.states)].tolist())
        assert found.bound == found.cost


@pytest.mark.parametrize("seed", range(4))
def test_for_a_given_order_the_states_are_the_best(seed) -> None:
    rng = np.random.default_rng(seed)
    stops = random_stops(rng, 5, 3, late=0.1)
    order = rng.permutation(5).tolist()
    states, cost = along(stops, order)
    ways = itertools.product(*(stops.states[k] for k in order))
    assert cost == pytest.approx(min(map(stops.cost, ways)), rel=ROUNDING)
    assert stops.of[list(states)].tolist() == order


@pytest.mark.parametrize("seed", range(6))
def test_many_stops_are_ordered_well_and_not_below_the_bound(seed) -> None:
    rng = np.random.default_rng(seed)
    stops = random_stops(rng, 10, 2, share=0.3 * (seed % 2), late=0.05 * (seed % 3))
    best, found = exact(stops), improved(stops)
    assert stops.keeps(stops.of[list(found.states)].tolist())
    assert lower_bound(stops) <= best.cost * (1.0 + ROUNDING)
    assert best.cost <= found.cost * (1.0 + ROUNDING)
    assert found.bound <= found.cost
    # Random costs have no geometry: worse than what any job has.
    assert found.cost <= 1.5 * best.cost


def test_exchanges_see_what_orders_cost() -> None:
    # From the best order none leads away, from one near to it the next exchange leads back.
    for seed in range(6):
        rng = np.random.default_rng(seed)
        stops = random_stops(rng, 9, 2, share=0.2, late=0.03 * (seed % 2))
        best = exact(stops)
        assert best.states
        order = stops.of[list(best.states)].tolist()
        assert improved(stops, order).cost == pytest.approx(best.cost, rel=ROUNDING)
        for place in range(8):
            other = [*order[:place], order[place + 1], order[place], *order[place + 2 :]]
            if stops.keeps(other):
                found = improved(stops, other)
                assert best.cost * (1.0 - ROUNDING) <= found.cost <= along(stops, other)[1]
                assert stops.cost(found.states) == pytest.approx(found.cost, rel=ROUNDING)


def with_moves_lost(stops: Stops, rng: np.random.Generator, share: float) -> Stops:
    """Return stops of which a share of the moves cannot be made."""
    lost = (
        np.where(rng.uniform(size=table.shape) < share, np.inf, table)
        for table in (stops.between, stops.first, stops.last)
    )
    between, first, last = lost
    return replace(stops, between=between, first=first, last=last)


def test_where_moves_cannot_be_made_a_round_is_found_if_there_is_one() -> None:
    found = 0
    for seed in range(150):
        rng = np.random.default_rng(seed)
        count, late = int(rng.integers(4, 7)), 0.1 * (seed % 3)
        stops = random_stops(rng, count, 2, share=0.3 * (seed % 2), late=late)
        stops = with_moves_lost(stops, rng, float(rng.uniform(0.3, 0.8)))
        best, quick = exact(stops), improved(stops)
        assert bool(quick.states) == bool(best.states), seed
        if quick.states:
            found += 1
            assert stops.keeps(stops.of[list(quick.states)].tolist())
            assert best.cost * (1.0 - ROUNDING) <= stops.cost(quick.states) < np.inf
            assert quick.bound <= best.cost * (1.0 + ROUNDING)
    # Rounds there are and none, both often.
    assert 30 < found < 120


def test_of_many_stops_with_few_moves_a_round_is_found() -> None:
    rng = np.random.default_rng(0)
    stops = with_moves_lost(random_stops(rng, 25, 2), rng, 0.85)
    # One there is.
    hidden = 2 * rng.permutation(25) + rng.integers(0, 2, 25)
    stops.between[hidden[:-1], hidden[1:]] = 1.0
    stops.first[hidden[0]] = stops.last[hidden[-1]] = 1.0
    assert np.isfinite(stops.cost(improved(stops).states))


def test_what_cannot_be_ordered_has_no_round() -> None:
    rng = np.random.default_rng(0)
    stops = random_stops(rng, 3, 1)
    circle = [frozenset({1}), frozenset({2}), frozenset({0})]
    none = replace(stops, after=circle)
    assert best_round(none).states == ()
    assert improved(none).states == ()
    assert best_round(none, given=[0, 1, 2]).cost == np.inf

"""Samples along curves: as near to each other as asked, and none twice."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from selfmotion.basics import Array
from selfmotion.planning.search.search_bounds import SearchBounds
from selfmotion.planning.search.vertices import (
    _MERGED,
    _CurveSamples,
    _gap_fillers,
    _interval_brackets,
    _spaced,
)

SPACING, LENGTH = 0.1, 2.0


def arcs_of(seed: int, count: int) -> Array:
    return np.sort(np.random.default_rng(seed).uniform(0.0, LENGTH, count))


@pytest.mark.parametrize("count", [0, 1, 7, 40])
@pytest.mark.parametrize("seed", range(4))
def test_gaps_are_filled_evenly_and_no_further(seed: int, count: int) -> None:
    """The start of a curve is filled as well, unless a sample is beside it."""
    arcs = arcs_of(seed, count)
    fill = _gap_fillers(arcs.tolist(), LENGTH, SPACING)
    every = np.sort(np.concatenate([arcs, fill, [LENGTH]]))
    steps = np.diff(every)
    # None is there twice, and none is as far from the next one as would fit another in between.
    assert steps.min(initial=np.inf) > 0.0
    assert steps.max(initial=0.0) <= SPACING * (1.0 + 1e-9)
    beside = bool(count) and arcs[0] <= _MERGED * SPACING
    assert (0.0 in fill) is not beside
    # No gap that is short enough has a sample in it.
    for first, last in pairwise(arcs):
        inside = np.sum((fill > first) & (fill < last))
        assert inside == np.ceil((last - first) / SPACING) - 1


@pytest.mark.parametrize("seed", range(4))
def test_what_is_kept_is_apart_and_near_to_all_that_is_left_out(seed: int) -> None:
    arcs = arcs_of(seed, 60)
    kept = arcs[_spaced(arcs, SPACING)]
    assert kept[0] == arcs[0]
    assert np.diff(kept).min() > SPACING
    before = kept[np.searchsorted(kept, arcs, side="right") - 1]
    assert (arcs - before).max() <= SPACING


@pytest.mark.parametrize("closed", [False, True])
def test_intervals_end_between_neighbours_also_around_the_start_of_a_closed_curve(
    closed: bool,
) -> None:
    arcs, is_in = np.array([1.9, 0.5, 1.5, 1.0]), np.array([True, False, True, False])
    ones = np.zeros(len(arcs), dtype=np.intp)
    curves = SimpleNamespace(curves=[SimpleNamespace(closed=closed, length=LENGTH)])
    found = _interval_brackets(_CurveSamples(ones, arcs, ones - 1), is_in, curves)
    # Of a closed one the first sample is also a whole length further on.
    expected = [(1.5, 1.0), (1.9, 0.5 + LENGTH)][: 2 if closed else 1]
    assert list(zip(*(column.tolist() for column in found[1:]), strict=True)) == expected
    assert found[0].tolist() == [0] * len(expected)


def test_all_turns_are_those_within_the_limits() -> None:
    lower, upper = np.array([-7.0, -1.0, -np.inf]), np.array([13.0, 1.0, np.inf])
    bounds = SearchBounds(lower, upper, np.array([True, False, True]), ())
    found = bounds.all_turns(np.array([[0.5, 0.3, 9.0]]))
    turns = 0.5 + 2.0 * np.pi * np.arange(-3, 4)
    expected = turns[(turns >= -7.0) & (turns <= 13.0)]
    np.testing.assert_allclose(np.sort(found[:, 0]), expected)
    assert (found[:, 1] == 0.3).all()

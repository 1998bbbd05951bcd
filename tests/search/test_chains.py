"""Chains, against brute force."""

import itertools

import numpy as np
import pytest

from selfmotion.basics import Array
from selfmotion.planning.search import Sequence
from selfmotion.planning.search.chains import UNLIKE, best_chains, connected, diverse_chains, unlike
from selfmotion.planning.search.search_bounds import SearchBounds


def brute_force(layers: list[Array], step: Array) -> float:
    best = np.inf
    for chain in itertools.product(*layers):
        steps = np.abs(np.diff(np.array(chain), axis=0))
        if np.all(steps <= step):
            best = min(best, float(steps.sum()))
    return best


def random_layers(seed: int) -> list[Array]:
    rng = np.random.default_rng(seed)
    layers = [rng.uniform(0.0, 1.0, (rng.integers(3, 8), 3)) for _ in range(5)]
    return [layer[np.argsort(layer[:, 0])] for layer in layers]


@pytest.mark.parametrize("seed", range(12))
def test_shortest_chain_is_that_of_brute_force(seed: int) -> None:
    layers, step = random_layers(seed), np.array([0.6, 0.5, 0.7])
    chains = best_chains(layers, step, np.zeros(3, dtype=bool))
    best = brute_force(layers, step)
    assert chains.cost[-1].min() == pytest.approx(best)
    if np.isfinite(best):
        chain = diverse_chains(layers, chains, step, np.zeros(3, dtype=bool), 1)[0]
        q = np.array([layer[k] for layer, k in zip(layers, chain, strict=True)])
        assert np.abs(np.diff(q, axis=0)).sum() == pytest.approx(best)
        # Without one of its nodes the answer is another one.
        layers[2] = np.delete(layers[2], chain[2], axis=0)
        assert brute_force(layers, step) > best


def test_angles_of_turning_joints_count_modulo_turns() -> None:
    layers = [np.array([[3.1, 0.0]]), np.array([[-3.1, 0.0]])]
    step = np.array([0.2, 0.2])
    assert best_chains(layers, step, np.array([False, False])).blocked == 1
    turned = best_chains(layers, step, np.array([True, False]))
    assert turned.cost[-1][0] == pytest.approx(2 * np.pi - 6.2)


def test_bounds_count_every_turn() -> None:
    bounds = SearchBounds(np.array([-7.0]), np.array([7.0]), np.array([True]), ())
    assert sorted(bounds.all_turns(np.array([[0.5]]))[:, 0]) == pytest.approx(
        [0.5 - 2 * np.pi, 0.5, 0.5 + 2 * np.pi]
    )
    narrow = SearchBounds(np.array([-1.0]), np.array([1.0]), np.array([True]), ())
    assert list(narrow.is_admissible_modulo_turns(np.array([[0.9], [1.1], [0.9 - 4 * np.pi]]))) == [
        True,
        False,
        True,
    ]
    assert narrow.excess(np.array([[1.2], [-1.3], [0.3]]))[:, 0] == pytest.approx([0.2, 0.3, 0.0])


def test_motions_are_unlike_that_differ_by_much_for_long() -> None:
    """In some joint, at a tenth of the waypoints."""
    turning = np.array([True, False])
    q = np.random.default_rng(0).normal(size=(100, 2))
    for size, count, differs in (
        *((1.01, 10, True), (1.01, 9, False), (0.99, 100, False)),
        (-1.01, 100, True),
    ):
        other = q.copy()
        other[:count, 1] += size * UNLIKE
        # Whole turns are none of a joint that turns without end.
        other[:, 0] += 2.0 * np.pi
        assert unlike(q, other, turning) is differs


def test_joints_that_turn_without_end_do_not_jump_in_a_chain() -> None:
    """Each vertex is the one of its layer, up to whole turns; others stay as they are."""
    turning, rng = np.array([True, False]), np.random.default_rng(1)
    q = np.column_stack([np.cumsum(rng.uniform(0.5, 2.5, 12)), rng.normal(size=12)])
    wrapped = q.copy()
    wrapped[:, 0] = (q[:, 0] + np.pi) % (2.0 * np.pi) - np.pi
    layers = [np.vstack([here + 1.0, here]) for here in wrapped]
    found = connected(layers, [1] * 12, turning)
    np.testing.assert_allclose(np.diff(found, axis=0), np.diff(q, axis=0))
    np.testing.assert_allclose(found[0], wrapped[0])
    np.testing.assert_array_equal(found[:, 1], q[:, 1])


@pytest.mark.parametrize(("period", "is_kept"), [(4, False), (6, False), (9, True), (24, True)])
def test_zigzag_of_few_waypoints_is_no_part_of_the_motion_near_a_sequence(
    period: int, is_kept: bool
) -> None:
    """The motion follows what takes nine waypoints or more to swing to and fro."""
    k, t = np.arange(181), np.linspace(0.0, 4.0, 181)
    frequency = 2.0 * np.pi / (period * t[1])
    swing = Sequence(t, np.sin(2.0 * np.pi * k / period)[:, None], 0.0)
    expected = frequency * np.cos(frequency * t)
    off = np.linalg.norm(swing(t)[:, 0] - expected) / np.linalg.norm(expected)
    assert off < 0.25 if is_kept else off > 0.9

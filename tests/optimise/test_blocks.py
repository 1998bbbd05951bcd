"""Block-banded systems are the dense ones."""

import numpy as np
import pytest

from selfmotion.planning.optimise import Banded


@pytest.mark.parametrize("size", [1, 3, 6])
def test_a_banded_system_is_the_dense_one(size: int) -> None:
    rng, count = np.random.default_rng(size), 7
    matrix = Banded(count, size, 1)
    dense = np.zeros((count * size, count * size))
    pairs = rng.normal(size=(count - 1, 2 * size, 2 * size))
    pairs = pairs @ np.swapaxes(pairs, 1, 2)
    for k, block in enumerate(pairs):
        dense[k * size : (k + 2) * size, k * size : (k + 2) * size] += block
    for part, column in ((pairs[:, :size, :size], 0), (pairs[:, size:, size:], 1)):
        matrix.add(0, column, part)
    matrix.add(1, 0, pairs[:, :size, size:])
    matrix.add_diagonal(np.full(len(matrix.dense()), 0.5))
    dense += 0.5 * np.eye(len(dense))
    np.testing.assert_allclose(matrix.dense(), dense, atol=1e-12)
    held = np.array([0, size, count * size - 1])
    matrix.hold(held)
    dense[held], dense[:, held] = 0.0, 0.0
    dense[held, held] = 1.0
    right = rng.normal(size=count * size)
    solved = matrix.solve(right)
    assert solved is not None
    np.testing.assert_allclose(dense @ solved, right, atol=1e-9)
    matrix.add_diagonal(np.full(len(matrix.dense()), -1e3))
    assert matrix.solve(right) is None


def test_what_is_added_to_a_part_is_a_share_of_its_largest_entry() -> None:
    """Where a share of the median one does not make it positive definite; parts have their own."""
    size, count, usual, share = 2, 3, 1e-9, 0.5
    rng = np.random.default_rng(3)
    matrix = Banded(2 * count, size, 1)
    diagonal = rng.uniform(1.0, 2.0, 2 * count * size)
    # One entry of the second part is below 0, by less than is added at once.
    diagonal[-2] = -0.3 * diagonal[count * size :].max()
    matrix.add_diagonal(diagonal)
    right = rng.normal(size=count * size)
    for part in (0, 1):
        own = diagonal[part * count * size :][: count * size]
        found = matrix.part_solved(part, 2, right, (usual, share, 8.0))
        assert found is not None
        sizes = np.abs(own)
        added = usual * np.median(sizes) + (share * (sizes.max() + usual) if part else 0.0)
        np.testing.assert_allclose(found, right / (own + added), rtol=1e-6)

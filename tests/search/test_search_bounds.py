"""Bounds of the search: turns of joints, and limits."""

import numpy as np

from selfmotion.planning.search.search_bounds import SearchBounds

TURN = 2.0 * np.pi
# Of sums of a few turns.
ROUNDING = 1e-12

# A joint of more than a turn, one without limits, one with a limit on one side, and a slide.
LOWER = np.array([-7.0, -np.inf, -1.0, -0.5])
UPPER = np.array([9.0, np.inf, np.inf, 0.5])
BOUNDS = SearchBounds(LOWER, UPPER, np.array([True, True, True, False]), ())


def test_a_motion_is_centred_by_whole_turns_of_joints_with_a_range() -> None:
    """The middle of what a joint passes is then no more than half a turn from its mid-range."""
    rng = np.random.default_rng(0)
    for _ in range(10):
        q = rng.uniform(-20.0, 20.0, size=4) + rng.uniform(-1.0, 1.0, size=(5, 4))
        moved = BOUNDS.centred(q) - q
        np.testing.assert_array_equal(moved[:, 1:], 0.0)
        turns = moved[:, 0] / TURN
        np.testing.assert_allclose(turns, np.round(turns[0]), atol=ROUNDING)
        centred = q[:, 0] + moved[:, 0]
        middle = 0.5 * (centred.min() + centred.max())
        assert abs(middle - 0.5 * (LOWER[0] + UPPER[0])) <= 0.5 * TURN + ROUNDING


def test_each_configuration_is_admissible_by_its_own_joints() -> None:
    inside = np.array([8.0, 50.0, 0.0, 0.4])
    rows = np.tile(inside, (5, 1))
    rows[1, 0], rows[2, 2], rows[3, 3] = 9.1, -1.1, -0.6
    assert BOUNDS.is_admissible(rows).tolist() == [True, False, False, False, True]
    # A turn less leads to the same pose; a slide has none.
    assert BOUNDS.is_admissible_modulo_turns(rows).tolist() == [True, True, True, False, True]
    assert BOUNDS.exceeded(rows).tolist() == [True, False, True, True]

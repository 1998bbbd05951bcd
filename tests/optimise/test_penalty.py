"""The exact penalty, and which of two points is better."""

import numpy as np
import pytest

from selfmotion.optimise import Residuals
from selfmotion.optimise.penalty import IGNORED, ExactPenalty, Point
from selfmotion.optimise.step import Step

X, STEP = np.array([1.0, -2.0]), np.array([0.5, 0.25])


def residuals(h: list[float], tolerance: float = 1.0, equalities: int = 0) -> Residuals:
    count = len(h)
    return Residuals(np.array(h), np.full(count, tolerance), np.arange(count) >= count - equalities)


def point(cost: float, *h: float) -> Point:
    return Point(X, cost, residuals(list(h)))


@pytest.mark.parametrize("seed", range(20))
def test_the_penalty_makes_a_step_worth_its_cost(seed: int) -> None:
    """gain + π fall ≥ 0.3 π fall, with equality where that is what raised π; π never falls."""
    rng = np.random.default_rng(seed)
    penalty, before = ExactPenalty(), 0.0
    for _ in range(5):
        here = point(1.0, *rng.uniform(1.0, 5.0, 3))
        left, gain = rng.uniform(0.0, here.at.worst - 0.2), rng.normal()
        step = Step(STEP, np.zeros(3), gain, left, relaxed=True)
        penalty.raise_for(here, step)
        fall = here.excess - max(left - IGNORED, 0.0)
        assert gain + penalty.weight * fall >= 0.3 * penalty.weight * fall - 1e-12
        if penalty.weight > before:
            assert gain + penalty.weight * fall == pytest.approx(0.3 * penalty.weight * fall)
        assert penalty.weight >= before
        before = penalty.weight


def test_the_penalty_is_above_the_multipliers_sum_where_steps_are_not_relaxed() -> None:
    here = Point(X, 1.0, Residuals(np.array([0.5, -3.0]), np.array([2.0, 0.5]), np.zeros(2) > 0))
    prices, penalty = np.array([3.0, -4.0]), ExactPenalty()
    penalty.raise_for(here, Step(STEP, prices, 1.0, 0.0, relaxed=True))
    assert penalty.weight == 0.0
    penalty.raise_for(here, Step(STEP, prices, 1.0, 0.0, relaxed=False))
    assert penalty.weight == pytest.approx(1.2 * (3.0 * 2.0 + 4.0 * 0.5))


def test_a_steps_share_is_its_fall_by_the_expected_one() -> None:
    penalty = ExactPenalty()
    penalty.weight = 2.0
    here, step = point(10.0, 3.0), Step(STEP, np.zeros(1), 4.0, 1.85, relaxed=True)
    # Expected: 4 of F, and 2 (2.15 - 1) of the penalty.
    assert penalty.share(here, point(7.0, 2.85), step) == pytest.approx((3.0 + 2.0 * 0.15) / 6.3)
    assert penalty.share(here, None, step) == -np.inf
    useless = Step(STEP, np.zeros(1), -2.3, 1.85, relaxed=True)
    assert penalty.share(here, point(7.0, 2.85), useless) == -np.inf


def test_of_two_points_the_cheaper_or_the_less_violated_is_better() -> None:
    cheap, dear, bad, worse = point(1.0, 1.0), point(2.0, 0.5), point(0.0, 1.1), point(-1.0, 2.0)
    order = [cheap, dear, bad, worse]
    for i, first in enumerate(order):
        for j, second in enumerate(order):
            assert first.better(second) is (i < j) or first is dear or second is dear
    assert cheap.better(dear)
    assert not dear.better(cheap)
    assert dear.better(bad)
    assert [p.kept for p in order] == [True, True, False, False]
    assert bad.excess == pytest.approx(1.1 - IGNORED)
    assert point(0.0, 0.5).excess == 0.0

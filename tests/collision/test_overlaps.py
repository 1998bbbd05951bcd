"""Pairs that overlap often are listed."""

import numpy as np
import pytest

from selfmotion.collision import CollisionModel, how_near
from selfmotion.collision.bodies import link_bodies
from selfmotion.collision.pairs import candidate_pairs
from selfmotion.robot import RobotModel, load_robot


def samples(robot: RobotModel, count: int, seed: int = 0) -> np.ndarray:
    lower, upper = robot.finite_limits()
    return np.random.default_rng(seed).uniform(lower, upper, (count, robot.dof))


@pytest.mark.parametrize("name", ["baxter", "pr2"])
def test_pairs_that_overlap_often_are_listed(name: str) -> None:
    model = CollisionModel(load_robot(name))
    assert model.overlapping
    pairs = candidate_pairs(link_bodies(model.robot), model.robot.urdf)
    names = [(model.bodies[i], model.bodies[j]) for i, j in pairs]
    left_out = [item for item in model.overlapping if not item.is_checked]
    assert len(names) > len(model.pairs) or not left_out
    for item in left_out:
        pair = (item.first, item.second)
        assert item.share == 1.0 or pair in model.robot.touching
        assert model.pairs.count(pair) < names.count(pair)
    q = samples(model.robot, 200, 3)
    share = (model.distances(q, 0.0) <= 0.0).mean(axis=0)
    listed = {(item.first, item.second) for item in model.overlapping}
    # Three standard deviations of a share of 200 and one of 500 samples.
    assert all(model.pairs[i] in listed for i in np.flatnonzero(share > 0.5 + 0.13))
    checked = [item for item in model.overlapping if item.is_checked]
    for item in checked:
        pieces = [i for i, pair in enumerate(model.pairs) if pair == (item.first, item.second)]
        assert share[pieces].max() == pytest.approx(item.share, abs=0.13)


def test_depths_are_told_as_such() -> None:
    assert how_near(0.01788) == "are 17.88 mm apart"
    assert how_near(-0.01788) == "overlap by 17.88 mm"

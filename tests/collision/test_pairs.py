"""Which pairs of bodies are looked at."""

from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

from selfmotion.model.collision import CollisionModel, disabled_links, how_near
from selfmotion.model.collision.bodies import Body, link_bodies
from selfmotion.model.collision.pairs import candidate_pairs
from selfmotion.model.collision.solids import Solid
from selfmotion.model.robot import RobotModel, load_robot


@pytest.fixture(scope="module")
def panda() -> RobotModel:
    return load_robot("panda")


def srdf_of(name: str) -> Path:
    urdf = Path(load_robot(name).urdf.source)
    return next(urdf.parents[1].glob("srdf/*.srdf"))


def test_pairs_of_panda_with_its_srdf(panda: RobotModel) -> None:
    """44, counted by hand from the file: 17 pieces of geometry, 35 disabled pairs of links."""
    model = CollisionModel(panda, disabled=disabled_links(srdf_of("panda")))
    assert len(model.pairs) == 44
    assert ("panda_link0", "panda_leftfinger") in model.pairs
    assert len(CollisionModel(panda).pairs) > 44


def test_a_pair_left_out_takes_no_other_pair_along(panda: RobotModel) -> None:
    """The hand and both fingers, which are held, are one rigid part with link 7."""
    every = set(CollisionModel(panda).pairs)
    for pair in (("panda_link4", "panda_link7"), ("panda_link4", "panda_hand")):
        left = set(CollisionModel(panda, disabled=[pair]).pairs)
        assert every - left == {pair}


def test_links_that_touch_by_design_are_no_pair(panda: RobotModel) -> None:
    pairs = set(CollisionModel(panda).pairs)
    joined = {(f"panda_link{i}", f"panda_link{i + 1}") for i in range(7)}
    assert not pairs & (joined | {("panda_link7", "panda_hand")})
    # What is fixed to the next link is another one.
    assert ("panda_link6", "panda_hand") in pairs


def test_the_base_is_not_checked_against_the_world(panda: RobotModel) -> None:
    here, solid = pin.SE3.Identity(), Solid(coal.Sphere(0.1), "ball")
    table = Body("table", "", 0, here, solid)
    base = Body("panda_link0", "panda_link0", 0, here, solid)
    arm = Body("panda_link1", "panda_link1", 1, here, solid)
    assert candidate_pairs([base, arm, table], panda.urdf) == [(1, 2)]


# Pairs that overlap often are listed.


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

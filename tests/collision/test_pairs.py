"""Which pairs of bodies are looked at."""

from pathlib import Path

import coal
import pinocchio as pin
import pytest

from selfmotion.collision import (
    CollisionModel,
    disabled_links,
)
from selfmotion.collision.bodies import Body
from selfmotion.collision.pairs import candidate_pairs
from selfmotion.collision.solids import Solid
from selfmotion.robot import RobotModel, load_robot


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

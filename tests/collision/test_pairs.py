"""Which pairs of bodies are looked at."""

from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest

from selfmotion.constraints import Clearance
from selfmotion.model.collision import (
    Body,
    CollisionModel,
    Solid,
    disabled_links,
    how_near,
    link_bodies,
)
from selfmotion.model.collision.pairs import candidate_pairs
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
        model = CollisionModel(panda, disabled=[pair])
        assert every - set(model.pairs) == {pair}
        # It is told, and nothing else.
        assert model.disabled == (pair,)
    assert CollisionModel(panda).disabled == ()


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
        assert item.share >= 0.95 or pair in model.robot.touching
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


# A tube that slides out of its base, and a finger that is held beside a knuckle.

_SLIDE = """<robot name="slide">
<link name="base"><collision><geometry><box size="0.2 0.2 {base}"/></geometry></collision></link>
<link name="mid"/>
<link name="end"><collision><geometry><cylinder radius="0.05" length="0.1"/></geometry>
</collision></link>
<link name="finger"><collision><origin xyz="{finger} 0 0"/><geometry><sphere radius="0.05"/>
</geometry></collision></link>
<link name="knuckle"><collision><geometry><sphere radius="0.05"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="mid"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
<joint name="slide" type="prismatic"><parent link="mid"/><child link="end"/><axis xyz="0 0 1"/>
<limit lower="0" upper="{travel}" velocity="1" effort="1"/></joint>
<joint name="grip" type="prismatic"><parent link="end"/><child link="finger"/><axis xyz="1 0 0"/>
<origin xyz="0 0 3"/><limit lower="0.02" upper="0.04" velocity="1" effort="1"/></joint>
<joint name="bolt" type="fixed"><parent link="end"/><child link="knuckle"/><origin xyz="0 0 3"/>
</joint></robot>"""


def _slide(base: float, travel: float, finger: float = 1.0, **given: Any) -> CollisionModel:
    text = _SLIDE.format(base=base, travel=travel, finger=finger)
    return CollisionModel(load_robot(text, tool="end", **given))


def test_what_overlaps_in_nearly_all_configurations_alike_is_left_out_and_told() -> None:
    """The end comes out of a base of 1 m after 0.55 m of 0.56: in 98 %, by 0.15 m sideways.

    But where it is nearly out, beyond 0.4 m.
    """
    model = _slide(1.0, 0.56)
    (found,) = (x for x in model.overlapping if {x.first, x.second} == {"base", "end"})
    assert 0.95 <= found.share < 1.0
    assert not found.is_checked
    assert found.depth == pytest.approx(0.15, abs=1e-6)
    assert ("base", "end") not in model.pairs
    (said,) = (x for x in Clearance().requirement(model.robot).remarks if "by design" in x)
    assert f"base - end (in {100 * found.share:.0f} % of all configurations, by 150.0 mm)" in said


def test_what_overlaps_in_fewer_or_ever_less_deep_is_checked() -> None:
    """A base of 0.2 m is left upwards, ever less deep: that is no design, however often."""
    fewer, less = _slide(1.0, 0.7), _slide(0.2, 0.152)
    for model, least in ((fewer, 0.5), (less, 0.95)):
        (found,) = (x for x in model.overlapping if {x.first, x.second} == {"base", "end"})
        assert found.share >= least
        assert found.is_checked
        assert ("base", "end") in model.pairs


def test_what_held_joints_keep_in_each_other_is_told_and_what_is_put_there_stays_wrong() -> None:
    """A finger rests at the nearest limit, 20 mm, in the knuckle: 100 mm less these."""
    model = _slide(1.0, 0.7, finger=0.0)
    (held,) = (x for x in model.held if {x.first, x.second} == {"finger", "knuckle"})
    assert held.value == pytest.approx(-0.08, abs=1e-6)
    assert model.stuck is None
    (said,) = (x for x in Clearance().requirement(model.robot).remarks if "moves against" in x)
    assert "(by 80.0 mm)" in said
    assert not _slide(1.0, 0.7).held
    put = _slide(1.0, 0.7, finger=0.0, lock={"grip": 0.03})
    assert put.stuck is not None
    assert put.stuck.value == pytest.approx(-0.07, abs=1e-6)


def test_depths_are_told_as_such() -> None:
    assert how_near(0.01788) == "are 17.88 mm apart"
    assert how_near(-0.01788) == "overlap by 17.88 mm"


def test_a_link_with_itself_in_an_srdf_is_passed_over(tmp_path: Path) -> None:
    """Other programs pass over it, too."""
    file = tmp_path / "arm.srdf"
    pair = '<disable_collisions link1="{}" link2="{}" reason="Default"/>'
    pairs = pair.format("a", "a") + pair.format("a", "b")
    file.write_text(f'<robot name="arm">{pairs}</robot>')
    assert disabled_links(file) == (("a", "b"),)

"""A free start stays on the paths and knows its tangent."""

import numpy as np
import pytest

from selfmotion.basics import Array
from selfmotion.model.follow import Follows
from selfmotion.planning.rollout import FreeStart
from support.arms import robot_named, short_line, start_of
from support.two_arms import both_arms

STEP = 1e-6


def _one(name: str, task: str) -> tuple[Follows, Array]:
    robot = robot_named(name)
    start = start_of(robot, task)
    return Follows.of(robot, short_line(robot, start), task), start


CASES = {
    "planar": lambda: _one("planar_3r", "planar"),
    "pose": lambda: _one("panda", "pose"),
    "position": lambda: _one("ur5", "position"),
    "both arms": lambda: both_arms("pose", "pointing"),
}


@pytest.mark.parametrize("case", CASES)
def test_free_start_stays_on_the_paths_and_knows_its_tangent(case: str) -> None:
    follows, start = CASES[case]()
    manifold, target = FreeStart(follows, start), follows.targets(np.zeros(1))[0]
    z = 0.2 * np.random.default_rng(4).normal(size=manifold.size)
    q = manifold.configuration(z, target)
    assert q is not None
    for item in follows.items:
        assert max(item.miss(item.path.pose(0.0), q)) < 1e-11

    def moved(change: Array) -> Array:
        found = manifold.configuration(z + change, target)
        assert found is not None
        return np.array(found)

    differences = [moved(STEP * e) - moved(-STEP * e) for e in np.eye(manifold.size)]
    # What it knows is of the last configuration.
    moved(np.zeros(manifold.size))
    np.testing.assert_allclose(
        manifold.tangent(), np.array(differences).T / (2.0 * STEP), atol=1e-7
    )


def test_what_is_too_far_along_the_self_motion_is_no_start() -> None:
    follows, start = CASES["position"]()
    manifold = FreeStart(follows, start)
    far = np.full(manifold.size, 50.0)
    assert manifold.configuration(far, follows.targets(np.zeros(1))[0]) is None

"""A free start stays on the path and knows its tangent."""

import numpy as np

import selfmotion as sm
from selfmotion.engine.start import FreeStart
from support.arms import robot_named, short_line, start_of
from support.followed import standing


def test_free_start_stays_on_the_path_and_knows_its_tangent() -> None:
    for name, task in (("planar_3r", "planar"), ("panda", "pose"), ("ur5", "position")):
        robot, rows = robot_named(name), sm.Task.of(task)
        start = start_of(robot, task)
        path = short_line(robot, start)
        manifold = FreeStart(standing(robot, rows), start)
        pose = path.pose(0.0)
        z = 0.2 * np.random.default_rng(4).normal(size=manifold.size)
        q = manifold.configuration(z, pose)
        assert q is not None
        assert max(rows.miss(path.pose(0.0), robot.pose(q))) < 1e-11
        tangent, _ = manifold.tangent()
        for i in range(manifold.size):
            ends = []
            for sign in (1.0, -1.0):
                shift = np.zeros_like(z)
                shift[i] = sign * 1e-6
                moved = manifold.configuration(z + shift, pose)
                assert moved is not None
                ends.append(moved)
            np.testing.assert_allclose(tangent[:, i], (ends[0] - ends[1]) / 2e-6, atol=1e-7)
    assert manifold.configuration(np.full(manifold.size, 50.0), pose) is None

"""Stretches of a path, and paths run up to speed and brought to rest."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array, restore
from selfmotion.path import Truncated
from support.paths import outward, pose


def test_a_truncated_path_is_its_path(planar: sm.RobotModel) -> None:
    line = outward(planar, 1.5)
    part = Truncated(line, 3.0)
    again = restore(sm.Path, part.to_dict())
    times: Array = np.linspace(0.0, 3.0, 7)
    for path in (part, again):
        assert path.duration == 3.0
        np.testing.assert_array_equal(path.samples(times).twist, line.samples(times).twist)
        np.testing.assert_array_equal(path.pose(2.0).homogeneous, line.pose(2.0).homogeneous)
        assert path.knots[0] == 0.0
        assert path.knots[-1] == 3.0
        assert np.all(np.diff(path.knots) > 0.0)
    with pytest.raises(sm.PathError, match=r"ends at 11\.0 s, expected a time within"):
        Truncated(line, 11.0)


def test_a_ramp_begins_and_ends_at_rest_and_keeps_the_pace_in_between() -> None:
    line = sm.Line(pose(1), pose(2), 2.0, "constant")
    ramped = sm.Ramped(line, 0.4)
    assert ramped.duration == pytest.approx(2.4)
    assert np.abs(ramped.samples([0.0, ramped.duration]).twist).max() == 0.0
    t = np.linspace(0.4, 2.0, 9)
    here, there = ramped.samples(t), line.samples(t - 0.2)
    np.testing.assert_allclose(here.translation, there.translation, rtol=0, atol=1e-14)
    np.testing.assert_allclose(here.twist, there.twist, rtol=0, atol=1e-14)

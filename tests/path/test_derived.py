"""Stretches of a path, and paths run up to speed and brought to rest."""

import itertools

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array, restore
from selfmotion.shell.testing import check_path
from support.paths import pose, random_waypoints

# A twist by two classes [m/s, rad/s].
ROUNDING = 1e-13


def test_a_section_is_the_path_between_two_times() -> None:
    path = random_waypoints()
    for crowding in (False, True):
        section = sm.paths.Section(path, 0.5, 1.7, crowding)
        again = restore(sm.paths.Path, section.to_dict())
        t: Array = np.linspace(0.0, section.duration, 50)
        for one in (section, again):
            twist = path.samples(0.5 + t).twist
            np.testing.assert_allclose(one.samples(t).twist, twist, rtol=0, atol=ROUNDING)
            assert one.duration == 1.2
            assert (one.knots[0], one.knots[-1]) == (0.0, one.duration)
            assert np.all(np.diff(one.knots) > 0.0)
            # A thousandth of the stretch before its end, or a knot of the path.
            assert (one.duration - one.knots[-2] < 1e-3 * one.duration) == crowding
        assert np.all(np.isin(section.knots, section.marks))
    for first, last in ((1.7, 0.5), (-0.1, 1.0), (1.0, 11.0)):
        with pytest.raises(sm.errors.PathError, match="two times in order within"):
            sm.paths.Section(path, first, last)


@pytest.mark.parametrize("ramp", [0.3, 1.2])
def test_a_section_rests_where_asked(ramp: float) -> None:
    path = random_waypoints()
    for ramped in itertools.product((False, True), repeat=2):
        slower = sm.paths.section_at_rest(path, 0.5, 1.7, ramp, ramped)
        check_path(slower)
        assert slower.duration == pytest.approx(1.2 + 0.5 * ramp * sum(ramped))
        speeds = [np.abs(slower.twist(time)).max() for time in (0.0, slower.duration)]
        assert [speed < 1e-12 for speed in speeds] == list(ramped)
        middle = 0.5 * slower.duration
        when = slower.when(slower.pace(np.array([middle])))
        assert when[0] == pytest.approx(middle)


def test_a_ramp_begins_and_ends_at_rest_and_keeps_the_pace_in_between() -> None:
    line = sm.paths.Line(pose(1), pose(2), 2.0, "constant")
    ramped = sm.paths.section_at_rest(line, ramp=0.4)
    assert ramped.duration == pytest.approx(2.4)
    assert np.abs(ramped.samples([0.0, ramped.duration]).twist).max() == 0.0
    t = np.linspace(0.4, 2.0, 9)
    here, there = ramped.samples(t), line.samples(t - 0.2)
    np.testing.assert_allclose(here.translation, there.translation, rtol=0, atol=1e-14)
    np.testing.assert_allclose(here.twist, there.twist, rtol=0, atol=1e-14)

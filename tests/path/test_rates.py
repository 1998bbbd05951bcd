"""What is taken of a path by steps in time does not know how long the path lasts around it."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.model.path import edges_of, path_length, spread_along, twist_rates
from selfmotion.problem.problem import rest_orders
from support.paths import pose, random_waypoints

# Of the largest acceleration: times are rounded by 1e-16 of a path that lasts 1e7 times as long as
# the piece, and a difference is taken over 1e-8 of that.
ROUNDING = 1e-6
WAITS = [(0.0, 0.0), (0.0, 600.0), (300.0, 300.0), (900.0, 0.0), (5000.0, 5000.0), (2e6, 1.0)]


def waiting(path: sm.paths.Path, before: float, after: float) -> sm.paths.Path:
    """Return a path with waits before and after it."""
    found = path
    if before:
        found = sm.paths.Dwell(path.pose(0.0), before) + found
    if after:
        found = found + sm.paths.Dwell(path.pose(path.duration), after)
    return found


def exact(line: sm.paths.Line, t: np.ndarray) -> np.ndarray:
    """Return the accelerations of a line of minimum jerk, by its formula."""
    u = t / line.duration
    bend = (60.0 * u - 180.0 * u**2 + 120.0 * u**3) / line.duration**2
    return bend[:, None] * (line.end.translation - line.start.translation)


@pytest.mark.parametrize(("before", "after"), WAITS)
def test_rates_are_those_of_the_piece(before: float, after: float) -> None:
    line = sm.paths.Line(pose(1), pose(2), 0.5)
    t = np.linspace(0.0, 0.5, 41)
    wanted = exact(line, t)
    found = twist_rates(waiting(line, before, after), before + t)[:, :3]
    assert np.abs(found - wanted).max() <= ROUNDING * np.abs(wanted).max()
    # Differences over a share of the whole duration do not see it.
    if before + after > 1e3:
        step = 1e-5 * (before + after)
        path = waiting(line, before, after)
        near = np.clip(before + t, step, path.duration - step)
        coarse = (path.twist(near + step) - path.twist(near - step))[:, :3] / (2.0 * step)
        assert np.abs(coarse - wanted).max() > 1e-3 * np.abs(wanted).max()


def test_where_rates_jump_they_are_the_means_of_both_sides() -> None:
    arc = sm.paths.Circle.around(pose(1), 0.1, 2.0, turns=0.25, time_law="constant")
    end = arc.pose(2.0)
    on = end.copy()
    on.translation = end.translation + 0.3 * arc.twist(2.0)[:3]
    path = arc + sm.paths.Line(end, on, 0.3, time_law="constant")
    each = twist_rates(path, np.array([2.0 - 1e-3, 2.0, 2.0 + 1e-3]))
    assert np.linalg.norm(each[0]) > 0.05
    assert np.abs(each[2]).max() <= 1e-8
    # A thousandth of a second turns the first one by 1e-3.
    np.testing.assert_allclose(each[1], 0.5 * each[0], atol=1e-3 * np.abs(each[0]).max())


def test_rates_of_many_loops() -> None:
    """A path may go round hundreds of times between two marks."""
    path = sm.paths.Circle.around(pose(1), 0.05, 60.0, turns=600.0, time_law="constant")
    rates = twist_rates(path, np.linspace(0.0, 60.0, 37))[:, :3]
    wanted = 0.05 * (2.0 * np.pi * 10.0) ** 2
    np.testing.assert_allclose(np.linalg.norm(rates, axis=1), wanted, rtol=1e-4)


def test_edges_are_apart() -> None:
    times = np.array([0.0, 1e-12, 0.3, 0.3 + 1e-12, 0.7, 1.0 - 1e-12, 1.0])
    assert edges_of(times).tolist() == [0.0, 0.3, 0.7, 1.0]


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("wait", [100.0, 600.0, 1800.0, 3600.0, 1e6])
def test_how_a_path_rests_does_not_depend_on_what_comes_after(order: int, wait: float) -> None:
    for seconds in (0.5, 1.0, 3.0):
        line: sm.paths.Path = sm.paths.Line(pose(1), pose(2), seconds)
        if order == 1:
            # s = 3u² - 2u³ rests at both ends, and accelerates there.
            even = sm.paths.Line(pose(1), pose(2), seconds, time_law="constant")
            line = sm.paths.Retimed(even, [0.0, seconds], [0.0, seconds], [0.0, 0.0])
        assert rest_orders(line, sm.Task.POSE) == (order, order)
        after, before = waiting(line, 0.0, wait), waiting(line, wait, 0.0)
        assert rest_orders(after, sm.Task.POSE) == (order, 2)
        assert rest_orders(before, sm.Task.POSE) == (2, order)


@pytest.mark.parametrize(("before", "after"), WAITS)
def test_looks_see_what_is_short(before: float, after: float) -> None:
    loops = sm.paths.Circle.around(pose(1), 0.05, 2.0, turns=3.0)
    path = waiting(loops, before, after)
    t = spread_along(path, 41)
    assert len(t) == 41
    assert t[0] == 0.0
    assert t[-1] == path.duration
    assert (np.diff(t) > 0.0).all()
    assert np.sum((t >= before) & (t <= before + 2.0)) >= 41 // 6
    assert np.diff(t).max() <= 2.0 * path.duration / 40 * (1.0 + 1e-9)
    # Three times round: the sides of the polygon are shorter by less than a tenth.
    assert 0.9 * 3.0 * 2.0 * np.pi * 0.05 < path_length(path) < 3.0 * 2.0 * np.pi * 0.05 * 1.001


def test_looks_are_even_where_nothing_waits() -> None:
    line = sm.paths.Line(pose(1), pose(2), 0.5)
    np.testing.assert_allclose(spread_along(line, 9), np.linspace(0.0, 0.5, 9), atol=1e-15)
    np.testing.assert_allclose(
        spread_along(random_waypoints(), 17), np.linspace(0.0, 2.0, 17), atol=1e-15
    )

"""A feed that a path cannot have is refused before planning, and one that it can have is named."""

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.model.path import FeedPossible
from support.arms import PANDA_HOME, robot_named

# A feed that is larger by this is not kept.
NEAR = 1.07


def line(length: float) -> sm.paths.Line:
    return sm.paths.Line(pin.SE3.Identity(), pin.SE3(np.eye(3), np.array([length, 0.0, 0.0])), 1.0)


def shape(seed: int) -> sm.paths.Path:
    """A line, a circle, a spline or rounded legs of some size."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.2, 0.2, (5, 3))
    size = rng.uniform(0.02, 0.2)
    match seed % 4:
        case 0:
            return line(size)
        case 1:
            return sm.paths.Circle.around(pin.SE3.Identity(), size, 1.0, turns=0.8)
        case 2:
            return sm.paths.Waypoints(np.arange(5.0), points)
    return sm.paths.Polyline(points, tolerance=0.01)


def is_kept(path: sm.paths.Path, feed: float) -> bool:
    """Whether the tool is fast enough somewhere, and slower at ends and in corners only.

    By differences of positions, and where the feed counts by what its nodes say.
    """
    t = np.linspace(0.0, path.duration, 20_001)
    places = path.samples(t).translation
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / np.diff(t)
    (found,) = path.feeds
    middles = 0.5 * (t[1:] + t[:-1])
    counts = np.interp(middles, found.t, found.required.astype(float)) == 1.0
    enough = (1.0 - found.within) * feed * (1.0 - 1e-3)
    return bool(speeds.max() >= enough and (speeds[counts] >= enough).all())


@pytest.mark.parametrize("seed", range(24))
def test_the_named_feed_is_kept_and_hardly_a_larger_one(seed: int) -> None:
    path = sm.paths.Feed(shape(seed), 2.5, acceleration=(1.0, 5.0)[seed % 2])
    (found,) = path.feeds
    assert not is_kept(path, 2.5)
    feed = FeedPossible(found).feed
    assert is_kept(path.changed({2.5: feed}), feed)
    assert not is_kept(path.changed({2.5: NEAR * feed}), NEAR * feed)


@pytest.mark.parametrize("seed", range(12))
def test_limits_that_are_named_allow_the_feed(seed: int) -> None:
    path = sm.paths.Feed(shape(seed), 0.5, acceleration=0.5)
    (found,) = path.feeds
    possible = FeedPossible(found)
    if possible.limits:
        (more,) = path.changed({}, **possible.limits).feeds
        assert more.kept
        assert not found.kept
        less = {name: 0.8 * value for name, value in possible.limits.items()}
        assert not path.changed({}, **less).feeds[0].kept


def test_a_line_is_run_up_and_down_by_half_of_the_acceleration() -> None:
    """By mechanics: v² = a/2 · L, less what smoothing takes."""
    length, acceleration = 0.72, 1.0
    (found,) = sm.paths.Feed(line(length), 1.5, acceleration=acceleration).feeds
    most = np.sqrt(0.5 * acceleration * length)
    assert 0.97 * most < FeedPossible(found).feed <= most
    limit = FeedPossible(found).limits["acceleration"]
    assert 2.0 * 1.5**2 / length < limit < 1.1 * 2.0 * 1.5**2 / length


def test_one_of_several_feeds_is_named() -> None:
    stretches = [[0.0, 0.1], [0.5, 2.0]]
    path = sm.paths.Feed(line(0.5), 0.1, acceleration=2.0, stretches=stretches)
    slow, fast = path.feeds
    assert (slow.kept, fast.kept) == (True, False)
    feed = FeedPossible(fast).feed
    assert all(item.kept for item in path.changed({2.0: feed}).feeds)
    assert "the feed of 2 m/s from t =" in FeedPossible(fast).text(path)


def test_less_than_nothing_missing_names_no_feed() -> None:
    bend = sm.paths.Waypoints(np.arange(5.0), np.random.default_rng(2).uniform(-0.2, 0.2, (5, 3)))
    (found,) = sm.paths.Feed(bend, 0.01, within=1e-13).feeds
    possible = FeedPossible(found)
    assert not found.kept
    assert possible.feed is None
    assert "ask for" not in possible.remedies


def problem(path: sm.paths.Path, **options: object) -> sm.Problem:
    panda = robot_named("panda")
    placed = sm.paths.Placed(path, panda.pose(PANDA_HOME))
    return sm.Problem(panda, placed, "position", PANDA_HOME, **options)


def test_nothing_is_planned_for_a_feed_that_cannot_be_had() -> None:
    stages = []
    with pytest.raises(sm.errors.FeedError, match=r"panda: the feed of 1\.5 m/s.*run-up") as error:
        sm.plan(problem(sm.paths.Feed(line(0.3), 1.5)), progress=lambda *told: stages.append(told))
    assert not stages
    assert error.value.asked == 1.5
    assert 0.3 < error.value.possible < 0.4
    with pytest.raises(sm.errors.FeedError):
        sm.plan_in_parts(problem(sm.paths.Feed(line(0.3), 1.5)))


def test_a_job_names_the_seam_before_it_plans_any() -> None:
    panda, stages = robot_named("panda"), []
    seams = [
        sm.Seam(
            name,
            sm.paths.Placed(sm.paths.Feed(line(0.3), feed), panda.pose(PANDA_HOME)),
            "position",
        )
        for name, feed in (("slow", 0.05), ("fast", 1.5))
    ]
    with pytest.raises(sm.errors.FeedError, match=r"^seam 'fast': the feed of 1\.5 m/s"):
        sm.plan_job(panda, seams, progress=lambda *told: stages.append(told))
    assert not stages


def test_a_feed_that_the_tool_may_not_have_is_refused() -> None:
    path = sm.paths.Feed(line(0.3), 0.2)
    with pytest.raises(
        sm.errors.FeedError, match=r"faster than the tool may be, 0\.15 m/s"
    ) as error:
        sm.plan(problem(path, constraints=[sm.constraints.ToolLimits(speed=0.15)]))
    allowed = sm.paths.Feed(line(0.3), error.value.possible)
    found = sm.plan(problem(allowed, constraints=[sm.constraints.ToolLimits(speed=0.15)]))
    assert found.certificate.verified, found.certificate.verdict


def test_what_is_possible_for_the_slowest_seam_is_for_all() -> None:
    panda = robot_named("panda")
    placed = {
        f"{length:g} m": sm.paths.Placed(sm.paths.Feed(line(length), 1.5), panda.pose(PANDA_HOME))
        for length in (0.4, 0.1, 0.2)
    }
    seams = [sm.Seam(name, path, "position") for name, path in placed.items()]
    with pytest.raises(sm.errors.FeedError, match=r"^seam '0\.1 m'") as error:
        sm.plan_job(panda, seams)
    for path in placed.values():
        assert path.original.changed({1.5: error.value.possible}).feeds[0].kept

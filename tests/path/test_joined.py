"""Pieces follow each other."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.model.task import SE3, exp3
from support.paths import pose, there_and_back


def test_pieces_follow_each_other() -> None:
    path = there_and_back()
    assert path.duration == pytest.approx(5.7)
    assert np.abs(path.samples(np.linspace(2.0, 2.7, 8)).twist).max() <= 1e-12
    np.testing.assert_allclose(path.pose(2.5).homogeneous, pose(2).homogeneous, atol=1e-12)
    np.testing.assert_allclose(path.pose(5.7).homogeneous, pose(1).homogeneous, atol=1e-12)


# Strokes that keep their feed from begin to end, whatever runs up to it.

# Speeds are those of splines of the pace [share of the feed].
SPLINED = 1e-3


def stroke(length: float, turned: float = 0.0) -> sm.paths.Line:
    first = SE3(exp3(np.array([3.0, 0.2, 0.1])), np.array([0.5, 0.1, 0.2]))
    last = SE3(
        first.rotation @ exp3(np.array([0.0, turned, 0.0])),
        first.translation + length * np.array([0.6, 0.8, 0.0]),
    )
    return sm.paths.Line(first, last, 1.0)


@pytest.mark.parametrize("feed", [0.05, 0.3, 1.0])
@pytest.mark.parametrize("acceleration", [1.0, 4.0])
@pytest.mark.parametrize("turned", [0.0, 0.2])
def test_the_feed_is_kept_from_begin_to_end(
    feed: float, acceleration: float, turned: float
) -> None:
    line = stroke(0.72, turned)
    path = sm.paths.Feed(line, feed, acceleration=acceleration)
    found = sm.paths.with_run_ups(path)
    # Where the stroke begins and ends the tool is where the line does; it rests before and after.
    for time, place in ((found.begin, line.start), (found.end, line.end)):
        np.testing.assert_allclose(found.path.pose(time).homogeneous, place.homogeneous, atol=1e-9)
    inside = found.path.samples(np.linspace(found.begin, found.end, 801)).twist[:, :3]
    speeds = np.linalg.norm(inside, axis=1)
    np.testing.assert_allclose(speeds, feed, rtol=SPLINED)
    assert np.abs(found.path.twist(0.0)).max() < 1e-9
    assert np.abs(found.path.twist(found.path.duration)).max() < 1e-9
    # The time of it follows from feed and length; it is judged all along.
    assert found.end - found.begin == pytest.approx(0.72 / feed, rel=SPLINED)
    (kept,) = found.path.feeds
    assert kept.kept
    counted = kept.path_times[kept.required]
    assert counted.min() <= found.begin
    assert counted.max() >= found.end
    # No longer than it has to be: without the least of the ways it is not at its feed.
    least = feed**2 / acceleration
    assert least <= found.run_up <= 1.3 * least + feed * 0.25
    # The stroke alone is only in its middle.
    alone = np.linalg.norm(path.samples(np.linspace(0.0, path.duration, 801)).twist[:, :3], axis=1)
    assert np.mean(alone > (1.0 - SPLINED) * feed) < 1.0


def test_events_bends_and_several_feeds_stay_where_they_are() -> None:
    corners = np.array([[0.4, -0.1, 0.3], [0.5, 0.0, 0.3], [0.4, 0.1, 0.3]])
    bent = sm.paths.Polyline(corners, np.tile([0.0, 1.0, 0.0, 0.0], (3, 1)), tolerance=2e-3)
    half = 0.5 * bent.at_constant_speed().duration
    path = sm.paths.Feed(bent, 0.1, acceleration=2.0, stretches=[[half, 0.2]])
    found = sm.paths.with_run_ups(path)
    assert found.run_down > found.run_up
    assert found.path.feed == 0.2
    again = found.path.samples(np.array([found.begin, found.end])).translation
    np.testing.assert_allclose(again, corners[[0, 2]], atol=1e-6)
    speeds = [np.linalg.norm(found.path.twist(t)[:3]) for t in (found.begin, found.end)]
    np.testing.assert_allclose(speeds, [0.1, 0.2], rtol=SPLINED)


def test_what_has_no_feed_has_no_run_up() -> None:
    with pytest.raises(sm.errors.PathError, match=r"path is Line.*expected a Feed"):
        sm.paths.with_run_ups(stroke(0.5))
    # A tool that turns far is held by its turn rate, however long it runs up: planning says so.
    slow = sm.paths.with_run_ups(sm.paths.Feed(stroke(0.5, turned=1.5), 0.9))
    assert not slow.path.feeds[0].kept
    assert slow.path.feeds[0].held_by == "the turn rate"
    said = r"going on as the path begins the tool turns by 7.5 rad"
    with pytest.raises(sm.errors.PathError, match=said):
        sm.paths.with_run_ups(sm.paths.Feed(stroke(0.05, turned=1.5), 0.5))


@pytest.mark.parametrize("feed", [0.05, 0.4, 0.8])
def test_both_ways_are_as_long(feed: float) -> None:
    """So that what is switched at the ends of a stroke is there as well where it is run back."""
    ends = [SE3(np.eye(3), np.array([0.4, y, 0.3])) for y in (-0.36, 0.36)]
    line = sm.paths.Line(*ends, 1.0)
    stroke = sm.paths.with_run_ups(sm.paths.Feed(line, feed, acceleration=4.0))
    assert stroke.run_up == stroke.run_down
    assert stroke.path.duration - stroke.end == pytest.approx(stroke.begin, abs=1e-9)

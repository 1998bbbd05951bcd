"""A feed that was asked for is kept, or the motion is not verified."""

import re
from itertools import pairwise
from pathlib import Path as FilePath

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.certificate import Stretch
from selfmotion.certificate.feed import _Along, _rounded_down
from selfmotion.path import section_at_rest
from selfmotion.testing.majorants import check_majorants
from support.arms import PANDA_HOME
from support.gantries import gantry


def saddle(feed: float, **options) -> sm.Feed:
    """The seam of two pipes, 60 and 30 mm in radius."""
    a = np.linspace(0.0, 2.0 * np.pi, 200)
    y = 0.03 * np.sin(a)
    places = np.stack([0.5 + 0.03 * np.cos(a), y, 0.2 + np.sqrt(0.06**2 - y**2)], axis=1)
    return sm.Feed(sm.Waypoints(a, places), feed, **options)


def followed(
    path: sm.Path,
    folder: FilePath,
    hurry: float = 0.0,
    during: tuple[float, float] = (0.0, np.inf),
) -> sm.Certificate:
    """A certificate of three slides on a path, for a while each second sample faster by a share."""
    robot = gantry(folder)
    t = np.unique(np.append(path.marks, np.linspace(0.0, path.duration, 500)))
    t = np.append(t[:-1][np.diff(t) > 1e-6 * path.duration], path.duration)
    samples = path.samples(t)
    still = np.zeros((len(t), 1))
    here = (t >= during[0]) & (t <= during[1])
    factor = 1.0 + hurry * (here * (-1.0) ** np.arange(len(t)))[:, None]
    qd = np.hstack([samples.twist[:, :3] * factor, still])
    motion = sm.Trajectory(t, np.hstack([samples.translation, still]), qd, robot.joint_names)
    return sm.certify(robot, path, "position", motion, 10.0)


def test_a_feed_of_millimetres_is_refused_at_once() -> None:
    with pytest.raises(sm.PathError, match=r"10 m/s is faster than any arm.*not mm/s"):
        saddle(10.0)


@pytest.mark.parametrize("feed", [0.005, 0.01, 0.03])
def test_a_feed_that_is_kept_is_told(feed: float, tmp_path: FilePath) -> None:
    path = saddle(feed)
    (found,) = path.feeds
    assert found.kept
    certificate = followed(path, tmp_path)
    assert certificate.verified, certificate.verdict
    assert "feed" in certificate.covers
    assert f"the feed of {feed:g} m/s is reached" in certificate.findings[-1].text
    # Where it counts, and that is nearly everywhere, by the path's own twist.
    t = np.linspace(0.0, path.duration, 20_001)
    speeds = np.linalg.norm(path.samples(t).twist[:, :3], axis=1)
    assert np.mean(speeds >= 0.98 * feed) >= 0.9
    waiting = path + sm.Dwell(path.pose(path.duration), 1.0)
    for placed in (sm.Placed(path, pin.SE3.Identity()), waiting):
        assert placed.feeds[0].slowest == found.slowest


@pytest.mark.parametrize(
    ("options", "held_by"),
    [
        ({"acceleration": 0.02}, "the acceleration in a bend"),
        ({"within": 1e-12}, "the"),
    ],
)
def test_a_feed_that_is_held_is_not_verified(
    options: dict, held_by: str, tmp_path: FilePath
) -> None:
    path = saddle(0.03, **options)
    (found,) = path.feeds
    certificate = followed(path, tmp_path)
    assert not certificate.verified
    assert f"held by {held_by}" in certificate.verdict
    assert found.slowest < (1.0 - found.within) * 0.03
    speed = np.linalg.norm(path.twist(found.time)[:3])
    assert speed == pytest.approx(found.slowest, rel=1e-6)
    if "acceleration" in options:
        # What the message says to ask for is kept.
        advised = _rounded_down(found.slowest)
        assert f"ask for {advised:g} m/s" in certificate.verdict
        assert saddle(advised, **options).feeds[0].kept


@pytest.mark.parametrize("hurry", [0.003, 0.1])
def test_the_tool_itself_keeps_the_feed(hurry: float, tmp_path: FilePath) -> None:
    """A path at its feed says nothing of a tool that hurries and lags beside it."""
    certificate = followed(saddle(0.01), tmp_path, hurry)
    assert certificate.verified is (hurry < 0.02), certificate.verdict
    if not certificate.verified:
        assert "kept by the path, but not by 'l3'" in certificate.verdict


def of_several_feeds(kind: str) -> tuple[sm.Path, list[float]]:
    """A path at feeds that change twice, and when."""
    legs = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0], [0.2, 0.1, 0.0]])
    feeds = 0.05, 0.011, 0.02
    if kind == "joined":
        ends = [pin.SE3(np.eye(3), leg) for leg in legs]
        pieces = [
            sm.Feed(sm.Line(*pair, 1.0), feed)
            for pair, feed in zip(pairwise(ends), feeds, strict=True)
        ]
        return sm.Joined(pieces), np.cumsum([0.0, *(item.duration for item in pieces)]).tolist()
    through = {
        "corners": lambda: sm.Polyline(legs, tolerance=2e-3),
        "spline": lambda: sm.Waypoints(np.arange(4.0), legs),
    }
    path = through[kind]()
    changes = path.duration * np.array([0.3, 0.7])
    feed = sm.Feed(path, feeds[0], stretches=np.stack([changes, feeds[1:]], axis=1))
    return feed, [0.0, *feed.when(changes), feed.duration]


@pytest.mark.parametrize("kind", ["corners", "spline", "joined"])
def test_each_of_several_feeds_is_judged_where_it_is_asked_for(
    kind: str, tmp_path: FilePath
) -> None:
    path, changes = of_several_feeds(kind)
    certificate = followed(path, tmp_path)
    assert certificate.verified, certificate.verdict
    for k, found in enumerate(path.feeds):
        start, end = changes[k], changes[k + 1]
        assert found.during.ravel() == pytest.approx([start, end], abs=1e-9)
        assert start <= found.time <= end
        t = np.linspace(start, end, 2001)
        # No faster at any time of its own, whatever the feeds beside it.
        speeds = np.linalg.norm(path.samples(t).twist[:, :3], axis=1)
        assert speeds.max() <= (1.0 + 0.1 * found.within) * found.asked
        # What a tool does in a stretch is held against that one's feed, and no other.
        inner = 0.7 * start + 0.3 * end, 0.3 * start + 0.7 * end
        assert followed(path, tmp_path, 0.005, inner).verified
        refused = followed(path, tmp_path, 0.1, inner)
        broken = [item for item in refused.findings if not item.kept]
        assert len(broken) == 1, refused.verdict
        assert inner[0] <= broken[0].time <= inner[1]
        assert f"{found.asked:g} m/s from t = {start:.3f} to {end:.3f} s" in broken[0].text


def test_a_section_is_judged_by_the_feeds_in_it(tmp_path: FilePath) -> None:
    path, changes = of_several_feeds("spline")
    first, last = changes[1] + 1.0, changes[3] - 2.0
    section = sm.Section(path, first, last)
    assert [item.asked for item in section.feeds] == [0.011, 0.02]
    assert all(0.0 <= item.time <= section.duration and item.kept for item in section.feeds)
    ends = [0.0, changes[2] - first, section.duration]
    for found, expected in zip(section.feeds, pairwise(ends), strict=True):
        assert found.during.ravel() == pytest.approx(expected, abs=1e-9)
    # Where it runs up no feed counts.
    assert not sm.Section(path, 0.0, 0.01).feeds
    back = path.feeds[1].timed(lambda t: path.duration - t)
    assert back.during.ravel() == pytest.approx(path.duration - path.feeds[1].during[0, ::-1])
    assert back.slowest == path.feeds[1].slowest


@pytest.mark.parametrize("ramped", [(True, True), (False, True)])
def test_a_section_at_rest_keeps_its_feed_but_in_its_ramps(
    ramped: tuple[bool, bool], tmp_path: FilePath
) -> None:
    path = saddle(0.02)
    first = 2.0 if ramped[0] else 0.0
    section = section_at_rest(path, first, 6.0, 0.5, ramped)
    (found,) = section.feeds
    assert found.kept
    certificate = followed(section, tmp_path)
    assert certificate.verified, certificate.verdict
    assert "feed" in certificate.covers
    assert not followed(section, tmp_path, 0.1, (2.0, 3.0)).verified
    # At another pace no feed is kept, and none is claimed.
    t = np.array([0.0, path.duration])
    other = sm.Retimed(path, 1.5 * t, t, np.full(2, 1.0 / 1.5))
    assert not other.feeds
    assert "feed" not in followed(other, tmp_path).covers


def test_each_stretch_of_a_feed_has_to_reach_it() -> None:
    line = sm.Line(pin.SE3.Identity(), pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0])), 1.0)
    stretches = [[0.4, 0.02], [0.6, 0.2], [0.602, 0.02]]
    found = {item.asked: item for item in sm.Feed(line, 0.2, stretches=stretches).feeds}
    assert found[0.02].kept
    assert not found[0.2].kept
    assert found[0.2].held_by == "run-up and run-down"
    assert found[0.2].during[1, 0] <= found[0.2].time <= found[0.2].during[1, 1]


def test_a_feed_is_proved_where_its_path_has_bounds(tmp_path: FilePath) -> None:
    class Own(sm.Path):
        """A line, without saying how large its derivatives are."""

        duration = 10.0
        knots = np.array([0.0, 10.0])

        def evaluate(self, t: np.ndarray) -> sm.PathSamples:
            along = np.outer(t, [0.03, 0.0, 0.0])
            twist = np.tile([0.03, 0.0, 0.0, 0.0, 0.0, 0.0], (len(t), 1))
            return sm.PathSamples(t, along, np.tile(np.eye(3), (len(t), 1, 1)), twist)

    for path, told in ((sm.Feed(Own(), 0.03), 1), (saddle(0.01), 0)):
        certificate = followed(path, tmp_path)
        assert certificate.verified, certificate.verdict
        assert len(certificate.notes) == told
        assert certificate.verdict.count("as measured between its marks") == told
        assert ["feed" in text for text in certificate.remarks].count(True) == told
        robot, still = gantry(tmp_path), np.zeros((2, 4))
        motion = sm.Trajectory([0.0, path.duration], still, still, robot.joint_names)
        stretch = Stretch(robot, motion, np.array([[0.4, 0.6]]) * path.duration)
        follow = sm.Follows.of(robot, path, "position").only
        known = _Along(follow, path.feeds[0]).series(stretch)
        assert (known is None) is bool(told)


def test_majorants_of_the_speed_along_a_path_are_above_all_derivatives(tmp_path: FilePath) -> None:
    robot, path, rng = gantry(tmp_path), saddle(0.02), np.random.default_rng(0)
    t = path.marks[np.append(True, np.diff(path.marks) > 1e-3)]
    wild = [rng.normal(size=(len(t), 4)) for _ in range(3)]
    motion = sm.Trajectory(t, *wild[:2], robot.joint_names, wild[2])
    follow = sm.Follows.of(robot, path, "position").only
    stretch = Stretch(robot, motion, np.stack([t[:-1], t[1:]], axis=1))
    alone = np.isin(t[1:], path.marks[1:][np.diff(path.marks) > 1e-3])
    check_majorants(_Along(follow, path.feeds[0]), stretch.some(np.flatnonzero(alone)))


def test_an_arm_at_rest_keeps_no_feed(tmp_path: FilePath) -> None:
    path, robot = saddle(0.01), gantry(tmp_path)
    q = np.zeros((2, 4))
    rest = sm.Trajectory([0.0, path.duration], q, q, robot.joint_names)
    certificate = sm.certify(robot, path, "position", rest, 10.0)
    assert certificate.on_path
    assert not certificate.verified


def test_a_way_too_short_to_run_up_reaches_no_feed() -> None:
    start = pin.SE3.Identity()
    end = pin.SE3(np.eye(3), np.array([0.01, 0.0, 0.0]))
    (found,) = sm.Feed(sm.Line(start, end, 1.0), 0.5).feeds
    assert not found.kept
    assert found.held_by == "run-up and run-down"


def test_rounded_corners_and_turning_on_the_spot_do_not_count() -> None:
    corner = sm.Polyline([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.3, 0.3, 0.0]], tolerance=2e-3)
    (found,) = sm.Feed(corner, 0.2).feeds
    assert found.kept
    t = np.linspace(0.0, sm.Feed(corner, 0.2).duration, 20_001)
    speeds = np.linalg.norm(sm.Feed(corner, 0.2).samples(t).twist[:, :3], axis=1)
    inner = (t > 1.0) & (t < t[-1] - 1.0)
    # In the corner it is slower indeed.
    assert speeds[inner].min() < 0.9 * 0.2
    turned = np.array([[1.0, 0.0, 0.0, 0.0], [0.9, 0.4, 0.0, 0.0], [0.9, 0.4, 0.0, 0.0]])
    spot = sm.Polyline([[0.0] * 3, [0.0] * 3, [0.3, 0.0, 0.0]], turned, turn_tolerance=1e-3)
    assert sm.Feed(spot, 0.05).feeds[0].kept


@pytest.mark.parametrize("speed", [0.0123, 0.05, 0.0999, 1.0])
def test_an_advised_feed_has_two_digits_and_is_no_larger(speed: float) -> None:
    advised = _rounded_down(speed)
    assert 0.9 * speed < advised <= speed


def test_a_feed_that_the_arm_can_keep_is_named() -> None:
    panda = sm.load_robot("panda")
    pose = panda.pose(PANDA_HOME)
    end = pin.SE3(pose.rotation, pose.translation + np.array([0.0, 0.35, 0.0]))
    fast = sm.Feed(sm.Line(pose, end, 1.0), 2.0, acceleration=60.0)
    refused = sm.plan(sm.Problem(panda, fast, "position", PANDA_HOME)).certificate
    assert not refused.verified
    named = re.search(r"a feed of ([0-9.]+) m/s.*Feed\.slower\(([0-9.]+)\)", refused.verdict)
    assert named is not None
    slower = fast.slower(float(named[2]))
    assert slower.feed == pytest.approx(float(named[1]), rel=1e-3)
    found = sm.plan(sm.Problem(panda, slower, "position", PANDA_HOME)).certificate
    assert found.verified, found.verdict
    assert "Feed.slower" not in found.verdict


def test_a_feed_is_named_that_both_path_and_arm_keep() -> None:
    """Where bends hold the tool, and the arm is too slow even for what is left of the feed."""
    kinova = sm.load_robot("kinova")
    q = np.array([0.5, 2.6, 1.3, 0.4, 1.2, 0.8])
    path = sm.Circle.around(kinova.pose(q), 0.2, 1.0, turns=0.5)
    feed = sm.Feed(path, 1.2, acceleration=8.0)
    refused = sm.plan(sm.Problem(kinova, feed, "position", q)).certificate
    assert not feed.feeds[0].kept
    named = re.search(r"ask for ([0-9.]+) m/s, then Feed\.slower\(([0-9.]+)\)", refused.verdict)
    assert named is not None, refused.verdict
    slower = sm.Feed(path, float(named[1]), acceleration=8.0).slower(float(named[2]))
    found = sm.plan(sm.Problem(kinova, slower, "position", q)).certificate
    assert found.verified, found.verdict


@pytest.mark.parametrize("brief", [1e-4, 1e-8, 1e-10])
def test_a_feed_that_is_asked_for_an_instant_ends_in_a_verdict(brief: float) -> None:
    panda = sm.load_robot("panda")
    pose = panda.pose(PANDA_HOME)
    end = pin.SE3(pose.rotation, pose.translation + np.array([0.0, 0.1, 0.0]))
    line = sm.Line(pose, end, 2.0, time_law="constant")
    path = sm.Feed(line, 0.05, stretches=[[1.0, 0.02], [1.0 + brief, 0.05]])
    assert sm.plan(sm.Problem(panda, path, "position", PANDA_HOME)).certificate.verified

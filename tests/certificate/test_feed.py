"""A feed that was asked for is kept, or the motion is not verified."""

import re
from itertools import pairwise
from pathlib import Path as FilePath

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.certificate import MotionSegments
from selfmotion.certificate.feed import FeedReached, _Along, _OwnPace, _Pace, _rounded_down
from selfmotion.model.follow import Follows
from selfmotion.model.path import section_at_rest
from selfmotion.shell.testing.constraints import check_majorants
from support.arms import PANDA_HOME, robot_named
from support.gantries import gantry

# What a path at 20 mm/s leaves over [m/s].
LEFT = _OwnPace(4e-4, None, 0.0199)


def saddle(feed: float, **options) -> sm.paths.Feed:
    """The seam of two pipes, 60 and 30 mm in radius."""
    a = np.linspace(0.0, 2.0 * np.pi, 200)
    y = 0.03 * np.sin(a)
    places = np.stack([0.5 + 0.03 * np.cos(a), y, 0.2 + np.sqrt(0.06**2 - y**2)], axis=1)
    return sm.paths.Feed(sm.paths.Waypoints(a, places), feed, **options)


def followed(
    path: sm.paths.Path,
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
    with pytest.raises(sm.errors.PathError, match=r"10 m/s is faster than any arm.*not mm/s"):
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
    assert certificate.findings[-1].allowed == pytest.approx((1.0 - found.within) * feed)
    # Where it counts, and that is nearly everywhere, by the path's own twist.
    t = np.linspace(0.0, path.duration, 20_001)
    speeds = np.linalg.norm(path.samples(t).twist[:, :3], axis=1)
    assert np.mean(speeds >= 0.98 * feed) >= 0.9
    waiting = path + sm.paths.Dwell(path.pose(path.duration), 1.0)
    for placed in (sm.paths.Placed(path, pin.SE3.Identity()), waiting):
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
        # What the message says to ask for is kept, or with the limits that it names.
        advised = re.search(
            r"ask for ([0-9.]+) m/s, or .*acceleration=([0-9.]+)", certificate.verdict
        )
        assert saddle(float(advised[1]), **options).feeds[0].kept
        assert saddle(0.03, acceleration=float(advised[2])).feeds[0].kept


@pytest.mark.parametrize("hurry", [0.003, 0.1])
def test_the_tool_itself_keeps_the_feed(hurry: float, tmp_path: FilePath) -> None:
    """A path at its feed says nothing of a tool that hurries and lags beside it."""
    certificate = followed(saddle(0.01), tmp_path, hurry)
    assert certificate.verified is (hurry < 0.02), certificate.verdict
    if not certificate.verified:
        assert "kept by the path, but not by 'l3'" in certificate.verdict


@pytest.mark.parametrize("feed", [0.002, 0.03])
def test_what_a_path_leaves_of_its_feed_is_a_share_of_it(feed: float, tmp_path: FilePath) -> None:
    """A tool that hurries and lags by half of what is allowed keeps slow feeds and quick ones."""
    path = saddle(feed)
    (found,) = path.feeds
    assert followed(path, tmp_path, 0.5 * found.within).verified


def of_several_feeds(kind: str) -> tuple[sm.paths.Path, list[float]]:
    """A path at feeds that change twice, and when."""
    legs = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0], [0.2, 0.1, 0.0]])
    feeds = 0.05, 0.011, 0.02
    if kind == "joined":
        ends = [pin.SE3(np.eye(3), leg) for leg in legs]
        pieces = [
            sm.paths.Feed(sm.paths.Line(*pair, 1.0), feed)
            for pair, feed in zip(pairwise(ends), feeds, strict=True)
        ]
        return sm.paths.Joined(pieces), np.cumsum(
            [0.0, *(item.duration for item in pieces)]
        ).tolist()
    through = {
        "corners": lambda: sm.paths.Polyline(legs, tolerance=2e-3),
        "spline": lambda: sm.paths.Waypoints(np.arange(4.0), legs),
    }
    path = through[kind]()
    changes = path.duration * np.array([0.3, 0.7])
    feed = sm.paths.Feed(path, feeds[0], stretches=np.stack([changes, feeds[1:]], axis=1))
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
        broken = [item for item in refused.findings if not item.satisfied]
        assert len(broken) == 1, refused.verdict
        assert inner[0] <= broken[0].time <= inner[1]
        assert f"{found.asked:g} m/s from t = {start:.3f} to {end:.3f} s" in broken[0].text


def test_a_section_is_judged_by_the_feeds_in_it(tmp_path: FilePath) -> None:
    path, changes = of_several_feeds("spline")
    first, last = changes[1] + 1.0, changes[3] - 2.0
    section = sm.paths.Section(path, first, last)
    assert [item.asked for item in section.feeds] == [0.011, 0.02]
    assert all(0.0 <= item.time <= section.duration and item.kept for item in section.feeds)
    ends = [0.0, changes[2] - first, section.duration]
    for found, expected in zip(section.feeds, pairwise(ends), strict=True):
        assert found.during.ravel() == pytest.approx(expected, abs=1e-9)
    # Where it runs up no feed counts.
    assert not sm.paths.Section(path, 0.0, 0.01).feeds
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
    other = sm.paths.Retimed(path, 1.5 * t, t, np.full(2, 1.0 / 1.5))
    assert not other.feeds
    assert "feed" not in followed(other, tmp_path).covers


def test_each_stretch_of_a_feed_has_to_reach_it() -> None:
    line = sm.paths.Line(pin.SE3.Identity(), pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0])), 1.0)
    stretches = [[0.4, 0.02], [0.6, 0.2], [0.602, 0.02]]
    found = {item.asked: item for item in sm.paths.Feed(line, 0.2, stretches=stretches).feeds}
    assert found[0.02].kept
    assert not found[0.2].kept
    assert found[0.2].held_by == "run-up and run-down"
    assert found[0.2].during[1, 0] <= found[0.2].time <= found[0.2].during[1, 1]


def test_a_feed_is_proved_where_its_path_has_bounds(tmp_path: FilePath) -> None:
    class Own(sm.paths.Path):
        """A line, without saying how large its derivatives are."""

        duration = 10.0
        knots = np.array([0.0, 10.0])

        def evaluate(self, t: np.ndarray) -> sm.paths.PathSamples:
            along = np.outer(t, [0.03, 0.0, 0.0])
            twist = np.tile([0.03, 0.0, 0.0, 0.0, 0.0, 0.0], (len(t), 1))
            return sm.paths.PathSamples(t, along, np.tile(np.eye(3), (len(t), 1, 1)), twist)

    for path, told in ((sm.paths.Feed(Own(), 0.03), 1), (saddle(0.01), 0)):
        certificate = followed(path, tmp_path)
        assert certificate.verified, certificate.verdict
        assert len(certificate.notes) == told
        assert certificate.verdict.count("checked at samples only") == told
        assert ["feed" in text for text in certificate.remarks].count(True) == told
        robot, still = gantry(tmp_path), np.zeros((2, 4))
        motion = sm.Trajectory([0.0, path.duration], still, still, robot.joint_names)
        segments = MotionSegments(robot, motion, np.array([[0.4, 0.6]]) * path.duration)
        follow = sm.Follows.of(robot, path, "position").items[0]
        known = _Along(follow, LEFT).series(segments)
        assert (known is None) is bool(told)


def test_majorants_of_the_speed_along_a_path_are_above_all_derivatives(tmp_path: FilePath) -> None:
    robot, path, rng = gantry(tmp_path), saddle(0.02), np.random.default_rng(0)
    t = path.marks[np.append(True, np.diff(path.marks) > 1e-3)]
    wild = [rng.normal(size=(len(t), 4)) for _ in range(3)]
    motion = sm.Trajectory(t, *wild[:2], robot.joint_names, wild[2])
    follow = sm.Follows.of(robot, path, "position").items[0]
    segments = MotionSegments(robot, motion, np.stack([t[:-1], t[1:]], axis=1))
    alone = np.isin(t[1:], path.marks[1:][np.diff(path.marks) > 1e-3])
    check_majorants(_Along(follow, LEFT), segments.some(np.flatnonzero(alone)))
    # The path's own speed, of one that varies: a constant one is rounding alone.
    places = np.array([[0.4, 0.0, 0.4], [0.5, 0.1, 0.4], [0.5, 0.2, 0.5], [0.4, 0.3, 0.5]])
    free = sm.paths.Waypoints([0.0, 1.0, 1.5, 3.0], places)
    own = MotionSegments(robot, motion, np.stack([free.marks[:-1], free.marks[1:]], axis=1))
    for low in (-0.2, 0.1):
        check_majorants(_Pace(free, low, 0.2), own)


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
    (found,) = sm.paths.Feed(sm.paths.Line(start, end, 1.0), 0.5).feeds
    assert not found.kept
    assert found.held_by == "run-up and run-down"


def test_rounded_corners_and_turning_on_the_spot_do_not_count() -> None:
    corner = sm.paths.Polyline([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.3, 0.3, 0.0]], tolerance=2e-3)
    (found,) = sm.paths.Feed(corner, 0.2).feeds
    assert found.kept
    t = np.linspace(0.0, sm.paths.Feed(corner, 0.2).duration, 20_001)
    speeds = np.linalg.norm(sm.paths.Feed(corner, 0.2).samples(t).twist[:, :3], axis=1)
    inner = (t > 1.0) & (t < t[-1] - 1.0)
    # In the corner it is slower indeed.
    assert speeds[inner].min() < 0.9 * 0.2
    turned = np.array([[1.0, 0.0, 0.0, 0.0], [0.9, 0.4, 0.0, 0.0], [0.9, 0.4, 0.0, 0.0]])
    spot = sm.paths.Polyline([[0.0] * 3, [0.0] * 3, [0.3, 0.0, 0.0]], turned, turn_tolerance=1e-3)
    assert sm.paths.Feed(spot, 0.05).feeds[0].kept


@pytest.mark.parametrize("speed", [0.0123, 0.05, 0.0999, 1.0])
def test_an_advised_feed_has_two_digits_and_is_no_larger(speed: float) -> None:
    advised = _rounded_down(speed)
    assert 0.9 * speed < advised <= speed


SLOWER = re.compile(r"keeps its limits ([0-9.]+) times slower, at a feed of ([0-9.]+) m/s")


def test_a_feed_that_the_arm_can_keep_is_named() -> None:
    panda = sm.load_robot("panda")
    pose = panda.pose(PANDA_HOME)
    end = pin.SE3(pose.rotation, pose.translation + np.array([0.0, 0.35, 0.0]))
    fast = sm.paths.Feed(sm.paths.Line(pose, end, 1.0), 2.0, acceleration=60.0)
    refused = sm.plan(sm.Problem(panda, fast, "position", PANDA_HOME)).certificate
    assert not refused.verified
    # In the short verdict, in words, and no duration, which a feed leaves nobody to choose.
    named = SLOWER.search(refused.summary)
    assert named is not None
    assert "Feed." not in refused.verdict
    assert "duration" not in refused.verdict
    slower = fast.slower(float(named[1]))
    assert slower.feed == pytest.approx(float(named[2]), rel=1e-3)
    found = sm.plan(sm.Problem(panda, slower, "position", PANDA_HOME)).certificate
    assert found.verified, found.verdict
    assert "slower" not in found.verdict


def test_a_feed_is_named_that_both_path_and_arm_keep() -> None:
    """Where bends hold the tool, and the arm is too slow even for what is left of the feed."""
    kinova = sm.load_robot("kinova")
    q = np.array([0.5, 2.6, 1.3, 0.4, 1.2, 0.8])
    path = sm.paths.Circle.around(kinova.pose(q), 0.2, 1.0, turns=0.5)
    feed = sm.paths.Feed(path, 1.2, acceleration=8.0)
    with pytest.raises(sm.errors.FeedError) as error:
        sm.plan(sm.Problem(kinova, feed, "position", q))
    possible = sm.paths.Feed(path, error.value.possible, acceleration=8.0)
    refused = sm.plan(sm.Problem(kinova, possible, "position", q)).certificate
    named = SLOWER.search(refused.verdict)
    assert named is not None, refused.verdict
    slower = possible.slower(float(named[1]))
    found = sm.plan(sm.Problem(kinova, slower, "position", q)).certificate
    assert found.verified, found.verdict


@pytest.mark.parametrize("brief", [1e-4, 1e-8, 1e-10])
def test_a_feed_that_is_asked_for_an_instant_ends_in_a_verdict(brief: float) -> None:
    panda = sm.load_robot("panda")
    pose = panda.pose(PANDA_HOME)
    end = pin.SE3(pose.rotation, pose.translation + np.array([0.0, 0.1, 0.0]))
    line = sm.paths.Line(pose, end, 2.0, time_law="constant")
    path = sm.paths.Feed(line, 0.05, stretches=[[1.0, 0.02], [1.0 + brief, 0.05]])
    assert sm.plan(sm.Problem(panda, path, "position", PANDA_HOME)).certificate.verified


# A path whose own pace changes fast between its rows [s, m]: its feed is held by nothing that its
# limits say, but the steps between its rows do.
HASTY = (
    [0.0, 1.0158335869593629, 1.1273602389174961, 19.684792992314637, 24.836557175401545],
    [
        [0.41183804471935753, 0.0017455991695705143, 0.4],
        [0.4282843962271138, 0.015441242881589162, 0.4],
        [0.4704684581066368, 0.06660961977353601, 0.4],
        [0.5046118547624597, 0.11146610137665532, 0.4],
        [0.5644143748773229, 0.23928026755704418, 0.4],
    ],
)


def test_a_feed_is_proved_between_the_nodes_of_its_path(tmp_path: FilePath) -> None:
    """At its nodes the path keeps it; the tool is five times slower in between, by differences."""
    limits = {"acceleration": 500.0, "turn_acceleration": 5000.0, "smoothing": 0.005}
    path = sm.paths.Feed(sm.paths.Waypoints(HASTY[0], np.array(HASTY[1])), 0.02, **limits)
    assert path.feeds[0].kept
    t = np.linspace(0.5, path.duration - 0.5, 200_001)
    places = path.samples(t).translation
    speed = np.linalg.norm(np.diff(places, axis=0), axis=1) / np.diff(t)
    assert speed.min() < 0.5 * 0.02
    robot = gantry(tmp_path)
    times = np.union1d(path.marks, np.linspace(0.0, path.duration, 20_001))
    times = times[np.append(True, np.diff(times) > 1e-7)]
    found, still = path.samples(times), np.zeros((len(times), 1))
    motion = sm.Trajectory(
        times,
        np.hstack([found.translation, still]),
        np.hstack([found.twist[:, :3], still]),
        robot.joint_names,
    )
    verdict = sm.certify(robot, path, "position", motion).verdict
    assert "is kept by the path where it was laid out, but not in between" in verdict
    # What it is made of keeps it, at a third of the pace.
    calm = path.slower(3.0)
    assert calm.feeds[0].asked == pytest.approx(0.02 / 3.0)


def test_random_paths_keep_what_is_proved_of_their_feeds(tmp_path: FilePath) -> None:
    """By speeds at many times: no verdict says 'feed' of a path that does not keep it."""
    robot, rng, kept = gantry(tmp_path), np.random.default_rng(3), 0
    for _ in range(12):
        count = int(rng.integers(3, 7))
        t = np.append(0.0, np.cumsum(rng.exponential(1.0, count) + 0.02))
        steps = rng.normal(0.0, 1.0, (count, 3)) * rng.uniform(0.01, 0.1, (count, 1))
        points = np.array([0.5, 0.0, 0.5]) + np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
        path = sm.paths.Feed(
            sm.paths.Waypoints(t, points),
            float(rng.uniform(0.01, 0.05)),
            acceleration=float(rng.uniform(0.5, 50.0)),
            smoothing=float(rng.uniform(0.005, 0.05)),
            within=0.05,
        )
        found = FeedReached(path.feeds[0], Follows.of(robot, path, "position").items[0])
        intervals, counts = path.feeds[0].pieces
        motion = sm.certificate.FinishedMotion(robot, followed_motion(robot, path))
        if not found.judge(motion).satisfied:
            continue
        kept += 1
        inside = intervals[counts]
        looks = (inside[:, :1] + np.diff(inside) * np.linspace(0.0, 1.0, 21)).ravel()
        speeds = np.linalg.norm(path.samples(looks).twist[:, :3], axis=1)
        assert speeds.min() >= 0.95 * path.feed
        assert speeds.max() <= 1.05 * path.feed
    assert kept


def followed_motion(robot: sm.RobotModel, path: sm.paths.Path) -> sm.Trajectory:
    """Return the motion of three slides along a path, at its marks and between them."""
    t = np.union1d(path.marks, np.linspace(0.0, path.duration, 2000))
    t = t[np.append(True, np.diff(t) > 1e-7)]
    found, still = path.samples(t), np.zeros((len(t), 1))
    q, qd = (np.hstack([x, still]) for x in (found.translation, found.twist[:, :3]))
    return sm.Trajectory(t, q, qd, robot.joint_names)


def test_what_a_weave_moves_along_its_seam_is_told_as_it_is() -> None:
    """A tool that weaves fast has |v_d| many times its feed: little of that is along the path."""
    panda = robot_named("panda")
    start = panda.dexterous_configuration()
    here = panda.pose(start)
    seam = sm.paths.Feed(
        sm.paths.Line(here, here * pin.SE3(np.eye(3), np.array([0.05, 0.05, 0.0])), 4.0), 0.02
    )
    path = sm.paths.Weave(seam, 2e-3, 1e-3)
    plan = sm.plan(sm.Problem(panda, path, task="position", start=start, constraints=[]))
    t = np.linspace(0.0, path.duration, 20_001)
    tool = np.einsum(
        "kcn,kn->kc", panda.chain.along(plan.trajectory(t))[0][:, :3], plan.trajectory(t, 1)
    )
    wanted = path.samples(t).twist[:, :3]
    size = np.maximum(np.linalg.norm(wanted, axis=1), 1e-9)
    along = np.abs(np.einsum("kc,kc->k", tool - wanted, wanted)) / size
    assert along.max() < 4e-4
    assert all(item.satisfied for item in plan.certificate.findings if item.requirement == "feed")

"""Constant feeds, rounded corners, leads and rests: the tool does what the process asks for."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.ndimage import binary_dilation
from scipy.spatial.transform import Rotation

import selfmotion as sm
from selfmotion.basics import restore
from selfmotion.model.path import Retimed, Reversed, Section
from selfmotion.model.task import SE3
from selfmotion.shell import testing
from support.arms import PANDA_HOME
from support.paths import polygon
from support.shell import complaint

# The tool rests where it is slower than this [m/s, rad/s].
RESTS = 1e-9


# A feed is kept where it is within this share.
WITHIN = 0.01


# Speeds are the same up to rounding within this share.
SAME = 1e-9
ACCELERATION, TURN_ACCELERATION, SMOOTHING = 2.0, 20.0, 0.04


def geometric(seed: int) -> sm.paths.Path:
    """Return a path of one of five kinds whose own pace means nothing."""
    points, turns = polygon(seed)
    start = pin.SE3(pin.Quaternion(*turns[0]).matrix(), points[0])
    match seed % 5:
        case 0:
            return sm.paths.Polyline(points, turns)
        case 1:
            return sm.paths.Polyline(points, tolerance=5e-3)
        case 2:
            return sm.paths.Waypoints(np.arange(len(points)), points, turns)
        case 3:
            return sm.paths.Circle.around(start, 0.05 + 0.01 * seed, 1.0, turn_tool=True)
    return sm.paths.Line(
        start, start * pin.SE3(Rotation.from_rotvec([0, 0.3, 0]).as_matrix(), points[1]), 1
    )


def at_feed(seed: int) -> sm.paths.Feed:
    feed = (0.02, 0.05, 0.1)[seed % 3]
    return sm.paths.Feed(
        geometric(seed),
        feed,
        acceleration=ACCELERATION,
        turn_acceleration=TURN_ACCELERATION,
        smoothing=SMOOTHING,
    )


@pytest.mark.parametrize("seed", range(40))
def test_the_feed_is_kept_where_limits_allow_and_nowhere_passed(seed: int) -> None:
    path = at_feed(seed)
    t = np.linspace(0.0, path.duration, 20_001)
    twist = path.samples(t).twist
    speed, turning = (np.linalg.norm(part, axis=1) for part in (twist[:, :3], twist[:, 3:]))
    share = np.maximum(speed / path.feed, turning / 1.0)
    assert share.max() <= 1.0 + WITHIN
    # Whatever is slower than the feed is so for a bend, or on the way to one or to an end.
    change = np.gradient(twist, t, axis=0)
    linear, angular = (np.linalg.norm(part, axis=1) for part in (change[:, :3], change[:, 3:]))
    used = np.maximum(linear / ACCELERATION, angular / TURN_ACCELERATION)
    assert used.max() <= 1.0
    reach = int(2.0 * SMOOTHING / (t[1] - t[0]))
    busy = binary_dilation(used > 0.02, iterations=reach)
    assert np.all(busy | (share > 1.0 - WITHIN))
    assert np.any(share > 1.0 - WITHIN)
    testing.check_path(path)


# Numbers of paths on which equal steps passed a limit by up to 160 %.
@pytest.mark.parametrize("seed", [29, 124, 134, 145, 152, 245, 342, 600, 817, 843, 857, 876])
def test_where_turning_and_moving_hold_in_turn_nothing_is_passed(seed: int) -> None:
    """Short legs with large turns: the turn rate holds here, the feed there, and the tool dips."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 9))
    points = np.cumsum(rng.normal(scale=0.08, size=(count, 3)), axis=0)
    turns = rng.normal([1.0, 0.0, 0.0, 0.0], 0.2, (count, 4))
    rounded = sm.paths.Polyline(
        points,
        turns,
        tolerance=10.0 ** rng.uniform(-5.0, -2.0),
        turn_tolerance=10.0 ** rng.uniform(-4.0, -1.0),
    )
    limits = {
        "turn_rate": 10.0 ** rng.uniform(-1.0, 1.0),
        "acceleration": 10.0 ** rng.uniform(-1.0, 1.0),
        "turn_acceleration": 10.0 ** rng.uniform(-0.5, 1.5),
    }
    path = sm.paths.Feed(rounded, 10.0 ** rng.uniform(-2.0, 0.0), **limits)
    t = np.linspace(0.0, path.duration, 20_001)
    twist = path.samples(t).twist
    change = np.diff(twist, axis=0) / t[1]
    for part, rate, most in (
        (slice(3), path.feed, limits["acceleration"]),
        (slice(3, 6), limits["turn_rate"], limits["turn_acceleration"]),
    ):
        assert np.linalg.norm(twist[:, part], axis=1).max() <= (1.0 + WITHIN) * rate
        assert np.linalg.norm(change[:, part], axis=1).max() <= (1.0 + WITHIN) * most


def test_a_straight_line_is_run_through_without_a_dip() -> None:
    """Two nodes of its pace differ by rounding: between them its slope was 0."""
    line = sm.paths.Line(pin.SE3.Identity(), pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0])), 10.0)
    path = sm.paths.Feed(line, 0.03)
    assert np.diff(path.marks).min() > 1e-6
    for t in (path.marks, np.arange(0.0, path.duration, 5e-3)):
        inner = t[(t > 0.2) & (t < path.duration - 0.2)]
        speeds = np.linalg.norm(path.samples(inner).twist[:, :3], axis=1)
        np.testing.assert_allclose(speeds, 0.03, rtol=1e-6)


@pytest.mark.parametrize("seed", range(40))
def test_the_tool_rests_where_it_is_asked_to(seed: int) -> None:
    path = at_feed(seed)
    first = sm.paths.Dwell(path.pose(0.0), 0.3)
    last = path.pose(path.duration)
    joined = first + path + sm.paths.Dwell(last, 0.2) + sm.paths.Line(last, path.pose(0.0), 2.0)
    led = sm.paths.with_leads(joined, 0.02, 0.5)
    ends = [piece.duration for piece in led.pieces]
    for time in (0.0, *np.minimum(np.cumsum(ends), led.duration)):
        assert np.abs(led.twist(time)).max() <= RESTS
    inside = led.samples(0.5 + np.linspace(0.0, 0.3, 20))
    assert np.abs(inside.twist).max() <= RESTS
    np.testing.assert_allclose(led.pose(0.0).homogeneous, led.pose(led.duration).homogeneous)
    back = led.pose(0.5).actInv(led.pose(0.0))
    np.testing.assert_allclose(back.translation, [0.0, 0.0, -0.02], atol=1e-12)


def test_positions_alone_are_for_tasks_that_leave_orientations_free(panda: sm.RobotModel) -> None:
    pose = panda.pose(PANDA_HOME)
    points = pose.translation + np.array([[0.0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0]])
    for path in (
        sm.paths.Feed(sm.paths.Polyline(points), 0.05),
        sm.paths.Placed(sm.paths.Waypoints([0, 1, 2], points), np.eye(4)),
        sm.paths.section_at_rest(sm.paths.Waypoints([0, 1, 2], points)),
    ):
        with pytest.raises(
            sm.errors.PathError, match="no orientations, which task 'pose' prescribes"
        ):
            sm.Problem(panda, path, start=PANDA_HOME)
        sm.Problem(panda, path, "position", start=PANDA_HOME)
    plan = sm.plan(sm.Problem(panda, sm.paths.Feed(sm.paths.Polyline(points), 0.05), "position"))
    assert plan.certificate.verified, plan.certificate.verdict
    with pytest.raises(sm.errors.PathError, match="no orientations"):
        sm.certify(panda, plan.path, "pose", plan.trajectory)


def test_a_seam_at_a_feed_is_planned_and_verified(panda: sm.RobotModel) -> None:
    pose = panda.pose(PANDA_HOME)
    points = pose.translation + np.array(
        [[0.0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0.0, 0.1, 0.05]]
    )
    turn = np.roll(pin.Quaternion(pose.rotation).coeffs(), 1)
    path = sm.paths.with_leads(
        sm.paths.Feed(sm.paths.Polyline(points, np.tile(turn, (4, 1))), 0.05), 0.03, 1.0
    )
    start = panda.inverse_kinematics(path.pose(0.0), "pose", seed=PANDA_HOME)
    plan = sm.plan(sm.Problem(panda, path, start=start))
    assert plan.certificate.verified, plan.certificate.verdict
    assert "rest at both ends" in plan.certificate.covers


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sm.paths.Polyline([[0, 0, 0]]), "shape (1, 3), expected (N, 3) with N ≥ 2"),
        (lambda: sm.paths.Polyline([[0, 0, 0]] * 2), "all 2 poses are the same"),
        (
            lambda: sm.paths.Polyline([[0, 0, 0], [1, 0, 0]], [[1, 0, 0, 0]]),
            "quaternions have shape",
        ),
        (
            lambda: sm.paths.Polyline([[0, 0, 0], [1, 0, 0], [0, 0, 0]]),
            "poses[1] the tool turns straight",
        ),
        (lambda: sm.paths.Polyline([[0, 0, 0], [1, 0, 0]], tolerance=0.0), "tolerance is 0.0"),
        (lambda: sm.paths.Feed(sm.paths.Polyline([[0, 0, 0], [1, 0, 0]]), 0.0), "feed is 0.0"),
        (
            lambda: sm.paths.Feed(sm.paths.Waypoints([0, 1, 2], np.eye(3), corners="stop"), 0.1),
            "the path rests at",
        ),
        (
            lambda: sm.paths.with_leads(sm.paths.Polyline([[0, 0, 0], [1, 0, 0]]), 0.1, 1.0),
            "faster or slower",
        ),
        (
            lambda: sm.paths.with_leads(sm.paths.Dwell(np.eye(4), 1.0), 0.1, 1.0, axis=[0, 0, 0]),
            "axis is zero",
        ),
    ],
)
def test_what_cannot_be_fed(make, message: str) -> None:
    with pytest.raises(sm.errors.PathError) as refused:
        make()
    assert message in str(refused.value)


def test_files_at_a_feed(tmp_path) -> None:
    file = tmp_path / "seam.csv"
    file.write_text("x,y,z\n0.4,0,0.3\n0.5,0,0.3\n0.5,0.1,0.3\n")
    t = {}
    for corners in ("blend", "stop", "round"):
        path = sm.files.read_path(file, feed=0.05, corners=corners)
        assert not path.oriented
        assert np.abs(path.samples([0.0, path.duration]).twist).max() <= RESTS
        inside = path.samples(np.linspace(0.2, 0.4, 5) * path.duration)
        speeds = np.linalg.norm(inside.twist[:, :3], axis=1)
        np.testing.assert_allclose(speeds, 0.05, rtol=WITHIN)
        t[corners] = path.duration
    assert t["round"] < t["stop"]
    assert "corners are 'round', which needs --feed" in complaint(
        "plan", "panda", "--path", file, "--set", "path.duration=4", "--set", "path.corners=round"
    )


def test_feeds_of_stretches_are_kept_and_judged_each_by_itself() -> None:
    legs = np.array([[0.4, -0.2, 0.3], [0.4, 0.2, 0.3], [0.5, 0.2, 0.3]])
    asked = ((0.0, 0.05), (0.1, 0.15), (0.25, 0.03))
    path = sm.paths.Feed(sm.paths.Polyline(legs, tolerance=2e-3), 0.05, stretches=asked[1:])
    assert [item.asked for item in path.feeds] == [feed for _, feed in asked]
    assert all(item.kept for item in path.feeds)
    t = np.linspace(0.0, path.duration, 4001)
    speeds = np.linalg.norm(path.samples(t).twist[:, :3], axis=1)
    passed, _ = path.pace(t)
    for (start, feed), end in zip(asked, (0.1, 0.25, 0.5), strict=True):
        here = speeds[(passed >= start) & (passed < end)]
        # Near a slower stretch the mean over the smoothing reaches into the faster one.
        assert here.max() <= (1.0 + path.feeds[0].within) * feed
        assert np.median(here) == pytest.approx(feed, rel=0.02)
    described = path.to_dict()
    again = sm.paths.Feed.from_dict({key: described[key] for key in described if key != "kind"})
    np.testing.assert_array_equal(again.samples(t).twist, path.samples(t).twist)
    # Too short to run up to: that stretch alone is refused, with the feed that it reaches.
    short = sm.paths.Feed(sm.paths.Polyline(legs), 0.05, stretches=[[0.1, 1.0], [0.12, 0.05]])
    kept = {item.asked: item for item in short.feeds}
    assert kept[0.05].kept
    assert not kept[1.0].kept
    # A bound half a window before and after leaves it the feed beside it.
    assert 0.05 * (1.0 - SAME) <= kept[1.0].slowest < 0.5


@pytest.mark.parametrize(
    "stretches", [[[0.3, 0.1], [0.2, 0.1]], [[0.1, 0.0]], [[-0.1, 0.1]], [[0.1, 0.1, 0.1]], []]
)
def test_stretches_that_are_none(stretches: list[list[float]]) -> None:
    path = sm.paths.Polyline(np.array([[0.4, -0.2, 0.3], [0.4, 0.2, 0.3]]))
    with pytest.raises(sm.errors.PathError, match="feed: stretches"):
        sm.paths.Feed(path, 0.05, stretches=stretches)


def test_a_table_has_a_feed_from_each_pose_on(tmp_path: Path) -> None:
    file = tmp_path / "seam.csv"
    rows = [f"{400.0},{20.0 * k},300,{30.0 if k < 5 else 60.0}" for k in range(11)]
    file.write_text("\n".join(["x_mm,y_mm,z_mm,feed_mm", *rows]) + "\n", encoding="utf-8")
    for corners in ("blend", "round"):
        path = sm.files.read_path(file, corners=corners, acceleration=0.4)
        assert isinstance(path, sm.paths.Feed)
        assert [item.asked for item in path.feeds] == [0.03, 0.06]
        assert all(item.kept for item in path.feeds)
        assert path.to_dict()["acceleration"] == 0.4
    with pytest.raises(
        sm.errors.FileFormatError, match="has a column feed, so that feed has no effect"
    ):
        sm.files.read_path(file, feed=0.1)
    file.write_text("x,y,z,feed\n0.4,0,0.3,0.1\n0.4,0.1,0.3,-1\n", encoding="utf-8")
    with pytest.raises(
        sm.errors.FileFormatError, match="line 3: feed is -1 m/s, expected a number above"
    ):
        sm.files.read_path(file)
    file.write_text("x,y,z\n0.4,0,0.3\n0.4,0.1,0.3\n", encoding="utf-8")
    with pytest.raises(sm.errors.FileFormatError, match="turn_rate has no effect without a feed"):
        sm.files.read_path(file, duration=1.0, turn_rate=2.0)


def test_a_slower_feed_is_the_same_motion_in_more_time() -> None:
    points = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.2, 0.3, 0.0]])
    inner = sm.paths.Polyline(points, tolerance=5e-3)
    feed = sm.paths.Feed(inner, 0.1, acceleration=2.0, stretches=[[0.5 * inner.duration, 0.05]])
    slower = feed.slower(1.7)
    assert slower.duration == pytest.approx(1.7 * feed.duration, rel=1e-12)
    t = np.linspace(0.0, feed.duration, 301)
    one, other = feed.samples(t), slower.samples(np.minimum(1.7 * t, slower.duration))
    np.testing.assert_allclose(other.translation, one.translation, atol=1e-12)
    np.testing.assert_allclose(1.7 * other.twist, one.twist, atol=1e-9)
    assert [item.asked for item in slower.feeds] == [item.asked / 1.7 for item in feed.feeds]
    with pytest.raises(sm.errors.PathError, match="factor"):
        feed.slower(0.0)


def test_a_stretch_from_the_start_is_kept_by_files_and_slower_feeds() -> None:
    line = sm.paths.Line(pin.SE3.Identity(), pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0])), 1.0)
    feed = sm.paths.Feed(line, 0.05, stretches=[[0.0, 0.02]])
    again = restore(sm.paths.Path, feed.to_dict())
    assert again.duration == feed.duration
    assert feed.slower(2.0).duration == pytest.approx(2.0 * feed.duration)


def test_a_path_made_of_another_one_keeps_a_feed_as_that_does() -> None:
    legs = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0], [0.2, 0.1, 0.0]])
    cornered = sm.paths.Polyline(legs, np.tile([1.0, 0.0, 0.0, 0.0], (4, 1)), tolerance=2e-3)
    frame = pin.SE3(np.eye(3), np.array([0.1, 0.2, 0.3]))
    evenly = cornered.at_constant_speed()
    derived = {
        "placed": sm.paths.Placed(cornered, frame),
        "reversed": Reversed(cornered),
        "joined": sm.paths.Joined([evenly]),
        "section": Section(evenly, 0.0, evenly.duration),
        "retimed": Retimed(
            evenly, [0.0, 2.0], [0.0, evenly.duration], [0.5 * evenly.duration] * 2, [0.0, 0.0]
        ),
    }
    # Rounded corners are slower, and do not count.
    (own,) = sm.paths.Feed(cornered, 0.1).feeds
    assert own.kept
    assert not sm.paths.Feed(cornered, 0.1, smoothing=1e-3).feeds[0].required.all()
    for name, path in derived.items():
        feed = sm.paths.Feed(path, 0.1)
        assert feed.duration == pytest.approx(sm.paths.Feed(cornered, 0.1).duration, rel=1e-3), name
        assert feed.feeds[0].kept, name
    # A shape's own pace does not matter, wherever it stands.
    line = sm.paths.Line(pin.SE3.Identity(), frame, 3.0)
    for path in (sm.paths.Placed(line, frame), Reversed(line)):
        assert sm.paths.Feed(path, 0.05).duration == pytest.approx(
            sm.paths.Feed(line, 0.05).duration, rel=1e-9
        )
    assert (
        sm.paths.Feed(sm.paths.Weave(line, 0.002, 0.02), 0.05).duration
        > sm.paths.Feed(line, 0.05).duration
    )


@pytest.mark.parametrize("aside", [1e-3, 1e-5, 1e-6])
def test_time_never_runs_backwards_where_a_path_nearly_turns_back(aside: float) -> None:
    """Nor is it faster than its feed, or harder than its acceleration: by differences."""
    points = [[0, 0, 0], [0.05, 0, 0], [0.1, aside, 0], [0.05, 2 * aside, 0], [0, 2 * aside, 0]]
    places = np.array(points) + np.array([0.4, 0.0, 0.4])
    path = sm.paths.Feed(sm.paths.Waypoints([0, 1, 2, 3, 4], places), 0.05)
    t = np.linspace(0.0, path.duration, 100_001)
    sigma, rate = path.pace(t)
    assert np.diff(sigma).min() >= 0.0
    assert rate.min() >= 0.0
    found = path.samples(t)
    assert np.linalg.norm(found.twist[:, :3], axis=1).max() < 1.01 * 0.05
    assert all(pace.falls_at() is None for _, _, pace in path._paces)
    push = np.linalg.norm(np.diff(found.twist[:, :3], axis=0), axis=1).max() / t[1]
    assert push < 1.0


def test_a_pace_that_runs_backwards_between_its_samples_is_none() -> None:
    line = sm.paths.Line(SE3.Identity(), SE3(np.eye(3), np.array([0.1, 0, 0])), 2.0)
    t, sigma = [0.0, 1.0, 2.0], [0.0, 0.2, 2.0]
    with pytest.raises(sm.errors.PathError, match=r"falls between its samples near t = 0\.[23]"):
        Retimed(line, t, sigma, [0.0, 3.0, 0.0])
    rates = Retimed(line, t, sigma, [0.0, 0.6, 0.0]).pace(np.linspace(0.0, 2.0, 1001), 1)
    assert rates.min() >= 0.0
    with pytest.raises(sm.errors.PathError, match="falls between its samples"):
        Retimed(line, t, [0.0, 1.0, 2.0], [1.0, 1.0, 1.0], [0.0, 60.0, 0.0])


@pytest.mark.parametrize(
    ("t", "sigma"), [([1.0, 2.0], [0.0, 2.0]), ([0.0, 2.0], [0.5, 2.0]), ([0.0, 2.0], [0.0, 2.1])]
)
def test_a_pace_begins_with_its_path_and_goes_no_further(
    t: list[float], sigma: list[float]
) -> None:
    """What it leaves out at the start would be left out by who joins it to others."""
    line = sm.paths.Line(SE3.Identity(), SE3(np.eye(3), np.array([0.1, 0, 0])), 2.0)
    with pytest.raises(
        sm.errors.PathError, match="expected from 0 at t = 0 to 2 s at most; take a Sect"
    ):
        Retimed(line, t, sigma, [0.0, 0.0])
    assert Retimed(line, [0.0, 3.0], [0.0, 1.5], [0.0, 0.0]).duration == 3.0


def test_a_feed_counts_where_a_pace_is_its_own_all_the_way() -> None:
    """One that is its own at each sample, and three times as fast in between, keeps no feed."""
    line = sm.paths.Line(SE3.Identity(), SE3(np.eye(3), np.array([0.1, 0, 0])), 2.0)
    path = sm.paths.Feed(line, 0.02)
    same = Retimed(path, [0.0, path.duration], [0.0, path.duration], [1.0, 1.0])
    assert same.feeds[0].kept
    times = np.linspace(0.0, path.duration, 9)
    wavy = Retimed(path, times, times, np.ones(9), np.zeros(9))
    assert wavy.feeds[0].kept
    bent = np.zeros(9)
    bent[4] = 8.0
    assert len(Retimed(path, times, times, np.ones(9), bent).feeds[0].pieces[0]) < len(
        wavy.feeds[0].pieces[0]
    )

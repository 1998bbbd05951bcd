"""A target that is seen now and then is followed, and what is missing is told."""

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion import realtime
from selfmotion.realtime import Flag, MovingPose, Replanner
from selfmotion.shell.testing import check_path
from support.arms import PANDA_HOME

# A conveyor's speed [m/s], how often a camera sees it [s], and how late it tells [s].
SPEED, RATE, LATE = 0.08, 1.0 / 30.0, 0.02
# What is left when the tool has caught up: the middle rule's error over cycles of 1 ms [m, rad].
CAUGHT = 1e-4


def seen_at(panda: sm.RobotModel, t: float) -> pin.SE3:
    """Return where a part is that moves along y and turns about the vertical axis."""
    turn = pin.exp3(np.array([0.0, 0.0, 0.1 * t]))
    here = panda.pose(PANDA_HOME)
    return pin.SE3(turn @ here.rotation, here.translation + np.array([0.0, SPEED * t, 0.0]))


TWIST = np.array([0.0, SPEED, 0.0, 0.0, 0.0, 0.1])


def test_a_moving_pose_is_a_path(panda: sm.RobotModel) -> None:
    pose = panda.pose(PANDA_HOME)
    check_path(MovingPose(pose, (0.1, 0.0, 0.02, 0.3, -0.2, 0.5), 0.4, 2.0))
    # The oracle: one exponential after the other.
    path = MovingPose(pose, TWIST, 0.5)
    for t in (0.0, 0.5, 1.7):
        turned = pin.exp3(TWIST[3:] * (t - 0.5)) @ pose.rotation
        np.testing.assert_allclose(path.pose(t).rotation, turned, atol=1e-14)
        moved = pose.translation + TWIST[:3] * (t - 0.5)
        np.testing.assert_allclose(path.pose(t).translation, moved, atol=1e-14)


def followed(panda: sm.RobotModel, replanner: Replanner, seconds: float, late: float, until=np.inf):
    """Return the segments and where the arm is at the end, for a camera with its own rate."""
    t, q, qd, told = 0.0, PANDA_HOME, np.zeros(7), -np.inf
    segments = []
    while t < seconds:
        given = {}
        if t - told >= RATE and t < until:
            told, when = t, t - late
            given = {"target": seen_at(panda, when), "twist": TWIST, "seen": when}
        segment = replanner.step(t, q, qd, **given)
        segments.append(segment)
        t += replanner.period
        now = segment.index(t)
        q, qd = segment.q[now], segment.qd[now]
    return segments, t, q


@pytest.mark.parametrize("late", [0.0, LATE])
def test_a_target_at_its_own_rate_is_followed(panda: sm.RobotModel, late: float) -> None:
    segments, t, q = followed(panda, Replanner(panda), 1.5, late)
    miss = sm.Task.POSE.miss(seen_at(panda, t), panda.pose(q))
    assert max(miss) < CAUGHT
    assert all(item.flag is Flag.PLANNED for item in segments)
    assert not any(item.reasons for item in segments)


def test_a_target_that_is_seen_no_more_goes_on_for_a_while(panda: sm.RobotModel) -> None:
    replanner = Replanner(panda, patience=0.1)
    segments, _, _ = followed(panda, replanner, 1.0, 0.0, until=0.5)
    flags = [item.flag for item in segments]
    assert flags[55] is Flag.PLANNED
    assert flags[70:] == [Flag.STOPPING] * len(flags[70:])
    assert "there was no target for 0." in segments[70].reasons[0]
    assert np.all(segments[-1].qd[-1] == 0.0)


@pytest.mark.parametrize("as_path", [False, True])
def test_a_target_that_is_sent_again_is_as_old_as_it_was_seen(
    panda: sm.RobotModel, as_path: bool
) -> None:
    """A camera that stopped seeing, and sends its last target on: the arm stops as without one."""
    replanner, home = Replanner(panda, patience=0.1), panda.pose(PANDA_HOME)
    sent = realtime.MovingPose(home, TWIST, 0.0)
    given = {"path": sent} if as_path else {"target": home, "twist": TWIST, "seen": 0.0}
    t, q, qd, flags, reasons = 0.0, PANDA_HOME, np.zeros(7), list[Flag](), list[str]()
    for _ in range(60):
        segment = replanner.step(t, q, qd, **given)
        t += replanner.period
        now = segment.index(t)
        q, qd = segment.q[now], segment.qd[now]
        flags.append(segment.flag)
        reasons += segment.reasons
    assert flags[5] is Flag.PLANNED
    assert flags[12:] == [Flag.STOPPING] * len(flags[12:])
    assert any("it was seen 0.11 s ago (patience: 0.1 s)" in text for text in reasons)
    assert np.all(qd == 0.0)


def test_a_target_of_another_clock_is_none(panda: sm.RobotModel) -> None:
    segment = Replanner(panda).step(
        0.0, PANDA_HOME, np.zeros(7), target=panda.pose(PANDA_HOME), twist=TWIST, seen=1.7e9
    )
    assert segment.flag is Flag.STOPPING
    assert "on another clock?" in segment.reasons[0]


def test_a_target_within_another_path_has_its_age(panda: sm.RobotModel) -> None:
    seen = realtime.MovingPose(panda.pose(PANDA_HOME), TWIST, 0.0)
    for path in (sm.paths.Placed(seen, np.eye(4)), realtime.Conveyed(seen, (0.0, 0.0, 0.0))):
        segment = Replanner(panda).step(5.0, PANDA_HOME, np.zeros(7), path)
        assert segment.flag is Flag.STOPPING
        assert "it was seen 5 s ago" in segment.reasons[0]


def test_what_a_camera_cannot_have_seen_is_left_out_and_told(panda: sm.RobotModel) -> None:
    replanner, home = Replanner(panda), panda.pose(PANDA_HOME)
    assert replanner.step(0.0, PANDA_HOME, np.zeros(7)).reasons == ("there was no target yet",)
    replanner.step(0.01, PANDA_HOME, np.zeros(7), target=home)
    for k, bad in enumerate((np.full((4, 4), np.nan), np.zeros((4, 4)), np.eye(3))):
        t = 0.02 + 0.01 * k
        segment = replanner.step(t, PANDA_HOME, np.zeros(7), target=bad)
        assert segment.flag is Flag.PLANNED
        assert "the target is of no use" in segment.reasons[0]
    segment = replanner.step(0.06, PANDA_HOME, np.zeros(7), target=home, twist=[np.inf] * 6)
    assert "twist" in segment.reasons[0]


def test_a_path_and_a_target_at_once_are_refused(panda: sm.RobotModel) -> None:
    home = panda.pose(PANDA_HOME)
    replanner = Replanner(panda)
    for given in (
        {"path": sm.paths.Dwell(home, 1.0), "target": home},
        {"twist": TWIST},
        {"path": sm.paths.Dwell(home, 1.0), "seen": 0.0},
    ):
        with pytest.raises(sm.errors.ProblemError, match="give target= with them, and no path"):
            replanner.step(0.0, PANDA_HOME, np.zeros(7), **given)


# A conveyed path is a path.


def test_a_conveyed_path_is_a_path(panda: sm.RobotModel, slow_circle: sm.paths.Circle) -> None:
    check_path(realtime.Conveyed(slow_circle, (0.1, 0.0, 0.02), (0.0, 0.3, 0.0)))

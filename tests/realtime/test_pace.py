"""The pace: the tool stays on its path, later, where limits, bodies or reach hold the arm back."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.realtime import Conveyed, Flag, MovingPose, Replanner, Segment
from selfmotion.realtime.pace import Pace, Times, sampled
from selfmotion.realtime.settings import CATCH_UP
from support.arms import PANDA_HOME, robot_named
from support.loops import closed_loop
from support.realtime_bodies import ROUNDED, limits_exceeded

# What the tool is off its path [m]: where a limit of the joints binds, plans see it at times 0.1 s
# apart, and the command holds joints back in between.
ON_PATH = 5e-4
# The same where the arm is stretched out, where commands are damped.
STRETCHED = 5e-3


def late_by(replanner: Replanner, path: sm.paths.Path, seconds: float) -> tuple[Array, Array]:
    """Return the delay of each step [s], and how far the tool is off its path then [m]."""
    robot, task = replanner.robot, replanner.task
    segments, places = closed_loop(replanner, path, PANDA_HOME, seconds)
    assert limits_exceeded(replanner, [(one, np.zeros(3)) for one in segments]) <= ROUNDED
    off = [
        task.miss(path.pose(min(max(one.t[0] - one.delay, 0.0), path.duration)), robot.pose(q))[0]
        for one, q in zip(segments, [PANDA_HOME, *places[:-1]], strict=True)
    ]
    return np.array([segment.delay for segment in segments]), np.array(off)


@pytest.mark.site
@pytest.mark.parametrize(
    "constraints",
    [
        [sm.constraints.JointVelocityLimits(0.2), sm.constraints.JointAccelerationLimits(1.0)],
        [sm.constraints.ToolLimits(speed=0.15, acceleration=0.5)],
    ],
    ids=["joints", "tool"],
)
def test_limits_make_the_tool_late_and_not_leave_its_path(
    panda: sm.RobotModel, constraints: list[sm.constraints.Constraint]
) -> None:
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.1, 4.0, normal=(1.0, 0.0, 0.0))
    delay, off = late_by(Replanner(panda, "pose", constraints=constraints), path, 9.0)
    assert off.max() < ON_PATH
    assert delay.max() > 0.5
    # It catches up while the path lasts, and rests where that ends.
    assert delay[-1] == 0.0
    assert off[-1] < 1e-6
    # Not ahead of the clock, but between knots; and it catches up by no more than it may.
    assert delay.min() > -5e-3
    late = delay > 0.01
    assert np.diff(delay)[late[1:]].min() > -1.1 * CATCH_UP * 0.01


def test_without_a_reason_the_tool_is_on_time(
    panda: sm.RobotModel, slow_circle: sm.paths.Circle
) -> None:
    delay, _ = late_by(Replanner(panda), slow_circle, 1.0)
    assert np.all(delay == 0.0)


def test_a_path_that_begins_at_full_speed_is_followed_from_rest(panda: sm.RobotModel) -> None:
    pose = panda.pose(PANDA_HOME)
    goal = sm.model.task.SE3(pose.rotation, pose.translation + np.array([0.0, 0.3, 0.0]))
    path = sm.paths.Line(pose, goal, 2.0, time_law="constant")
    assert np.linalg.norm(path.samples(np.zeros(1)).twist) > 0.1
    delay, off = late_by(Replanner(panda), path, 3.0)
    # Where the path ends it does so at full speed, as no arm can.
    assert off[:180].max() < ON_PATH
    assert 0.0 < delay.max() < 0.5
    assert delay[-1] == 0.0


def test_an_arm_without_self_motion_is_late_as_well() -> None:
    robot = robot_named("ur5")
    start = robot.dexterous_configuration()
    path = sm.paths.Circle.around(robot.pose(start), 0.1, 2.0, normal=(1.0, 0.0, 0.0))
    limits = [sm.constraints.JointVelocityLimits(0.3), sm.constraints.JointAccelerationLimits(5.0)]
    replanner = Replanner(robot, "pose", constraints=limits)
    segments, places = closed_loop(replanner, path, start, 5.0)
    off = [
        replanner.task.miss(path.pose(min(max(one.t[0] - one.delay, 0.0), 2.0)), robot.pose(q))[0]
        for one, q in zip(segments[1:], places[:-1], strict=True)
    ]
    assert max(off) < 2.0 * ON_PATH
    assert max(segment.delay for segment in segments) > 0.5
    assert segments[-1].delay == 0.0


class Out(sm.paths.Path):
    """Out along x by twice a distance, and back."""

    def __init__(self, pose: sm.model.task.SE3, distance: float, duration: float) -> None:
        self.duration, self._pose, self._distance = duration, pose, distance

    def evaluate(self, t: Array) -> sm.paths.PathSamples:
        pace = 2.0 * np.pi / self.duration
        along = np.eye(6)[0]
        x = self._distance * (1.0 - np.cos(pace * t))
        speed = self._distance * pace * np.sin(pace * t)
        places = self._pose.translation + np.outer(x, along[:3])
        turns = np.broadcast_to(self._pose.rotation, (len(t), 3, 3)).copy()
        return sm.paths.PathSamples(t, places, turns, np.outer(speed, along))


@pytest.mark.site
@pytest.mark.parametrize("distance", [0.29, 0.3, 0.33])
def test_where_a_path_leaves_reach_the_tool_waits_on_it(
    panda: sm.RobotModel, distance: float
) -> None:
    """Stretched out, the arm may or may not follow when the path is back: it is nowhere else."""
    path = Out(panda.pose(PANDA_HOME), distance, 6.0)
    delay, off = late_by(Replanner(panda), path, 8.0)
    assert off.max() < STRETCHED
    waits = (delay[1:] - delay[:-1]) > 0.009
    assert waits.sum() > 100
    assert delay.max() > 1.0
    # It is on time again, or it rests.
    assert delay[-1] == 0.0 or waits[-50:].all()


def test_targets_and_chunks_have_times_of_their_own(panda: sm.RobotModel) -> None:
    replanner = Replanner(panda, constraints=[sm.constraints.JointVelocityLimits(0.05)])
    t, q, found = 0.0, PANDA_HOME, list[Segment]()
    for _ in range(60):
        found.append(replanner.step(t, q, np.zeros(7), target=panda.pose(PANDA_HOME),
                                    twist=[0.0, 0.2, 0.0, 0.0, 0.0, 0.0], seen=t))  # fmt: skip
        t += replanner.period
        q = found[-1].q[found[-1].index(t)]
    assert all(segment.delay == 0.0 for segment in found)
    assert any(segment.flag is Flag.PLANNED for segment in found)


def test_of_a_conveyed_path_what_is_carried_has_the_pace(panda: sm.RobotModel) -> None:
    line = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.1, 4.0)
    velocity = np.array([0.1, 0.0, 0.0])
    t, s, rate = np.array([1.0, 1.5]), np.array([0.4, 0.6]), np.array([0.4, 0.2])
    found = sampled(Conveyed(line, velocity), Times(t, s, rate))
    carried = line.samples(s)
    np.testing.assert_allclose(
        found.path.translation, carried.translation + t[:, None] * velocity, atol=1e-15
    )
    twist = rate[:, None] * carried.twist + np.append(velocity, np.zeros(3))
    np.testing.assert_allclose(found.path.twist, twist, atol=1e-15)
    np.testing.assert_array_equal(found.along, carried.twist)
    seen = MovingPose(panda.pose(PANDA_HOME), np.ones(6))
    assert not sampled(seen, Times(t, s, rate)).along.any()


def pace_of(rates: list[float], delay: float = 0.3) -> Pace:
    pace = Pace(2.0, np.linspace(0.0, 2.0, 21))
    pace.rates, pace.delay = np.array(rates), delay
    pace.command()
    return pace


RATES = [0.2, 0.5, 0.9, 1.0, 0.4, 0.0, 1.2]


def test_rates_are_derivatives_of_the_paths_time_and_time_passes() -> None:
    pace = pace_of(RATES)
    since = np.linspace(0.0, 1.9, 190)
    h = 1e-6
    around = [pace.times(5.0 + x, x, pace.weights(x)) for x in (since - h, since, since + h)]
    slopes = (around[2].s - around[0].s)[1:] / (2.0 * h)
    kinks = np.abs(since[1:, None] - pace.knots).min(axis=1) < 2.0 * h
    np.testing.assert_allclose(slopes[~kinks], around[1].rate[1:][~kinks], atol=1e-7)
    assert around[1].s[0] == pytest.approx(5.0 - 0.3)
    before = pace.times(np.array([5.05]), np.array([0.05]), pace.weights(np.array([0.05])))
    pace.shift(0.05)
    after = pace.times(np.array([5.05]), np.zeros(1), pace.weights(np.zeros(1)))
    np.testing.assert_allclose(np.ravel(after), np.ravel(before), atol=1e-12)


def test_what_is_commanded_is_not_what_is_planned_meanwhile() -> None:
    pace = pace_of(RATES)
    pace.change(np.full(6, -0.1))
    pace.shift(0.01)
    other = pace_of(RATES)
    other.shift(0.01)
    assert pace.delay == other.delay
    assert pace.rates[0] == other.rates[0]
    assert np.all(pace.rates[1:-1] < other.rates[1:-1] + 1e-12)


def test_the_programme_of_the_pace_allows_no_step_back_and_none_ahead_of_the_clock() -> None:
    pace = pace_of(RATES, 0.0)
    metric, _, (rows, low, high) = pace.programme(1.0)
    assert np.linalg.eigvalsh(metric).min() > 0.0
    rng, knots = np.random.default_rng(0), pace.knots
    for _ in range(200):
        step = rng.uniform(-0.5, 0.5, 6)
        rates = pace.rates.copy()
        rates[1:] += step
        s = np.concatenate([[0.0], np.cumsum(np.diff(knots) * 0.5 * (rates[1:] + rates[:-1]))])
        if np.all((rows @ step >= low) & (rows @ step <= high)):
            assert rates.min() >= -1e-12
            assert np.all(s <= knots + 1e-12)
    pace.retreat(0.5)
    assert np.all(pace.rates[pace.knots >= 0.5] == 0.0)


def test_another_path_elsewhere_is_followed_on_time(panda: sm.RobotModel) -> None:
    slow = [sm.constraints.JointVelocityLimits(0.1)]
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.1, 4.0, normal=(1.0, 0.0, 0.0))
    replanner = Replanner(panda, constraints=slow)
    segments, places = closed_loop(replanner, path, PANDA_HOME, 1.5)
    assert segments[-1].delay > 0.1
    pose = panda.pose(PANDA_HOME)
    same = sm.paths.Circle.around(pose, 0.1, 4.0, normal=(1.0, 0.0, 0.0))
    again = replanner.step(1.5, places[-1], np.zeros(7), same)
    assert again.delay > 0.1
    pose.translation[2] += 0.05
    other = replanner.step(1.51, again.q[10], np.zeros(7), sm.paths.Dwell(pose, 4.0))
    assert other.delay == 0.0

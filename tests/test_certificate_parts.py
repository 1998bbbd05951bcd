"""Laws of the certificate's parts: each by itself, on motions whose extremes are known."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from conftest import PANDA_HOME, robot_named
from selfmotion.basics.arrays import Array
from selfmotion.certificate import AtRest, ClosedMotion, EndState, JointLimits, JointTorques
from selfmotion.certificate.apart import Approach, KeepsApart, _nearer, closest_at_all_times
from selfmotion.certificate.band import CoordinateBand
from selfmotion.certificate.check import _because, _damped_stretches, _undecided
from selfmotion.certificate.deviation import _turns, deviation_from, deviation_size, excess
from selfmotion.certificate.findings import Extreme
from selfmotion.certificate.interpolation import stencil
from selfmotion.certificate.path_error import _TRAVEL, _edges, _larger, bound_errors
from selfmotion.certificate.shares import largest_share, too_far
from selfmotion.certificate.tool import ToolMotion
from selfmotion.collision import Closest
from selfmotion.task import DampingLaw

ROUNDING = 1e-12


def rotation(rng: np.random.Generator, size: float = 1.5) -> Array:
    return np.asarray(pin.exp3(rng.uniform(-size, size, 3)))


def motion_of(
    q: Array | list[list[float]], qd: Array | list[list[float]], t: list[float] | None = None
) -> sm.FinishedMotion:
    """Return a motion of the planar arm, by default in 1 s steps."""
    robot = robot_named("planar_3r")
    times = [float(k) for k in range(len(q))] if t is None else t
    return sm.FinishedMotion(robot, sm.Trajectory(times, q, qd, robot.joint_names))


# --- deviation from the path


@pytest.mark.parametrize("count", [5, 9])
def test_polynomials_are_known_from_their_points(count: int) -> None:
    """Of as high a degree as the points determine, and of no higher one."""
    shares, predict, between, dense = stencil(count)
    assert (between[0], between[-1], len(between)) == (0.0, 1.0, 33)
    np.testing.assert_allclose(np.diff(between), 1.0 / 32.0)
    half = (count - 1) // 2
    np.testing.assert_allclose(predict @ shares[::2] ** half, shares[1::2] ** half, atol=ROUNDING)
    full = shares ** (count - 1)
    np.testing.assert_allclose(dense @ full, between ** (count - 1), atol=ROUNDING)
    missed = predict @ shares[::2] ** (half + 1) - shares[1::2] ** (half + 1)
    assert np.abs(missed).max() > 1e-4


@pytest.mark.parametrize("in_tool_axes", [False, True])
@pytest.mark.parametrize("task", list(sm.Task))
def test_the_deviation_is_that_of_the_poses(task: sm.Task, in_tool_axes: bool) -> None:
    """Against Pinocchio's logarithm; the tool's axis alone by the turn between two vectors."""
    panda, rng = robot_named("panda"), np.random.default_rng(1)
    lower, upper = panda.finite_limits()
    q = rng.uniform(lower, upper, (6, 7))
    targets = [(rotation(rng) @ panda.pose(x).rotation, rng.normal(size=3)) for x in q]
    turns, places = (np.array(part) for part in zip(*targets, strict=True))
    path: Any = SimpleNamespace(
        samples=lambda t: SimpleNamespace(rotation=turns, translation=places)
    )
    found = deviation_from(panda, path, task, np.zeros(6), q, in_tool_axes)
    for k, configuration in enumerate(q):
        pose = panda.pose(configuration)
        miss = (pose.translation - places[k]) * np.isin(range(3), task.rows)
        expected = turns[k].T @ miss if in_tool_axes else miss
        np.testing.assert_allclose(found[k, :3], expected, atol=ROUNDING)
        relative = turns[k].T @ pose.rotation
        turn = np.zeros(3)
        if task.tool_axes:
            axis = relative[:, 2]
            normal = np.cross([0.0, 0.0, 1.0], axis)
            turn = normal / np.linalg.norm(normal) * np.arccos(axis[2])
        elif np.any(task.rows >= 3):
            turn = pin.log3(relative)
        np.testing.assert_allclose(found[k, 3:], turn, atol=1e-9)


@pytest.mark.parametrize("task", ["pose", "pointing"])
def test_half_a_turn_and_none_are_what_they_are(task: str) -> None:
    half = np.diag([1.0, -1.0, -1.0])
    actual = np.array([half, np.eye(3)])
    found = _turns(sm.Task.of(task), np.tile(np.eye(3), (2, 1, 1)), actual)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), [np.pi, 0.0])


def test_what_is_relaxed_is_taken_off_its_rows_in_its_window() -> None:
    item = sm.Relaxation(("x", "y"), 0.5, during=(1.0, 2.0))
    deviation = np.tile([3.0, 4.0, 7.0, 0.1, 0.2, 0.3], (6, 1))
    deviation[4] *= 0.1
    deviation[5, :2] = 0.0
    t = np.array([0.5, 1.0, 2.0, 2.5, 1.5, 1.5])
    size = deviation_size(item, 3.0, t, deviation)
    np.testing.assert_allclose(size, [0.0, 5.0, 5.0, 0.0, 0.5, 0.0])
    beyond = excess([item], 3.0, t, deviation)
    expected = deviation.copy()
    expected[1:3, :2] *= 0.9
    expected[4:, :2] = 0.0
    np.testing.assert_allclose(beyond, expected)


def test_the_error_is_bounded_at_all_times_and_hardly_more() -> None:
    """A tool at rest, and a path that swings beside it between the trajectory's two samples."""
    robot = robot_named("planar_3r")
    q = robot.dexterous_configuration("planar")
    pose = robot.pose(q)

    class Swinging(sm.Path):
        """Sideways by a tenth of a millimetre, most at 0.8 s."""

        duration = 1.0
        knots = np.array([0.0, 1.0])

        def evaluate(self, t: Array) -> sm.PathSamples:
            swing = 1e-4 * np.exp(-((t - 0.8) ** 2) / 0.02)
            twist = np.outer(-swing * 100.0 * (t - 0.8), np.eye(6)[1])
            places = pose.translation + np.outer(swing, [0.0, 1.0, 0.0])
            return sm.PathSamples(t, places, np.tile(pose.rotation, (len(t), 1, 1)), twist)

    trajectory = sm.Trajectory([0.0, 1.0], [q, q], np.zeros((2, 3)), robot.joint_names)

    def check(tolerance: float, *relaxed: sm.Relaxation) -> Any:
        given = sm.Tolerance(tolerance, 1e-6)
        return bound_errors(robot, Swinging(), sm.Task.PLANAR, trajectory, given, relaxed)

    for tolerance in (1.001e-4, 1e-4 / 1.001):
        found = check(tolerance)
        assert 1e-4 - 1e-9 <= found.position.value <= 1.03e-4
        assert found.position.time == pytest.approx(0.8, abs=0.05)
        assert found.position.name == "tool"
        assert (found.rotation.value, found.rotation.time, found.undecided) == (0.0, 0.0, ())
    settled = check(1.001e-4)
    assert settled.position.value <= 1.001e-4
    within = check(5.05e-5, sm.Relaxation("y", 5e-5, during=(0.5, 1.0)))
    assert 5e-5 - 1e-9 <= within.position.value <= 5.1e-5
    assert within.deviations[0].value == pytest.approx(1e-4, rel=0.03)
    assert (within.deviations[0].name, within.undecided) == ("(y)", ())
    outside = check(1e-6, sm.Relaxation("y", 1e-3, during=(0.0, 0.5)))
    # So far beyond the tolerance nothing has to be known more closely.
    assert 1e-4 - 1e-9 <= outside.position.value <= 1.2e-4
    # One pose less per interval than is looked at, and the last one.
    assert check(1.0).samples == 9


@pytest.mark.parametrize("angular", [False, True])
def test_no_peak_between_the_points_looked_at_is_missed(angular: bool) -> None:
    """A tool at rest, and a path beside it by a parabola whose top is anywhere."""
    robot, most = robot_named("panda"), 1e-4
    q = robot.dexterous_configuration("pose")
    pose = robot.pose(q)
    trajectory = sm.Trajectory([0.0, 1.0], [q, q], np.zeros((2, 7)), robot.joint_names)

    class Arched(sm.Path):
        duration = 1.0
        knots = np.array([0.0, 1.0])

        def __init__(self, top: float) -> None:
            self.top = top

        def evaluate(self, t: Array) -> sm.PathSamples:
            sizes = most * (1.0 - (t - self.top) ** 2)
            motions = np.outer(sizes, np.eye(6)[5 if angular else 1])
            places = [pose * pin.exp6(pin.Motion(motion)) for motion in motions]
            translation = np.array([place.translation for place in places])
            rotation = np.array([place.rotation for place in places])
            return sm.PathSamples(t, translation, rotation, np.zeros((len(t), 6)))

    for top in np.random.default_rng(0).uniform(0.05, 0.95, 40):
        for allowed in (1.0, most * (1.0 - 1e-5)):
            given = sm.Tolerance(allowed, allowed)
            path = Arched(float(top))
            found = bound_errors(robot, path, sm.Task.POSE, trajectory, given, ())
            value = (found.rotation if angular else found.position).value
            assert most - ROUNDING <= value <= 1.01 * most


@pytest.mark.parametrize("row", range(6))
def test_errors_of_every_row_count(row: int) -> None:
    """A tool at rest, and a path that is a constant bit beside it, or turned."""
    robot, size = robot_named("panda"), 1e-4
    q = robot.dexterous_configuration("pose")
    beside = robot.pose(q) * pin.exp6(pin.Motion(size * np.eye(6)[row]))
    path = sm.Waypoints.from_poses([0.0, 1.0], [beside, beside])
    trajectory = sm.Trajectory([0.0, 1.0], [q, q], np.zeros((2, 7)), robot.joint_names)
    found = bound_errors(robot, path, sm.Task.POSE, trajectory, sm.Tolerance(1.0, 1.0), ())
    expected = [size, 0.0] if row < 3 else [0.0, size]
    errors = [found.position.value, found.rotation.value]
    np.testing.assert_allclose(errors, expected, atol=1e-3 * size)


def test_where_a_path_bends_sharply_a_short_interval_stays_undecided() -> None:
    """Its error peaks at the tolerance in a corner that nothing announces: halved twelve times."""
    robot = robot_named("planar_3r")
    q = robot.dexterous_configuration("planar")
    pose = robot.pose(q)

    class Bent(sm.Path):
        duration = 1.0

        def evaluate(self, t: Array) -> sm.PathSamples:
            swing = 1e-4 * (1.0 - np.abs(t - 1.0 / 3.0))
            places = pose.translation + np.outer(swing, [0.0, 1.0, 0.0])
            turns = np.tile(pose.rotation, (len(t), 1, 1))
            return sm.PathSamples(t, places, turns, np.zeros((len(t), 6)))

    trajectory = sm.Trajectory([0.0, 1.0], [q, q], np.zeros((2, 3)), robot.joint_names)
    allowed = sm.Tolerance(1e-4 * (1.0 + 1e-9), 1.0)
    found = bound_errors(robot, Bent(), sm.Task.PLANAR, trajectory, allowed, ())
    ((start, end),) = found.undecided
    assert start <= 1.0 / 3.0 <= end
    assert end - start == pytest.approx(2.0**-12)
    assert 1e-4 < found.position.value < 1.001e-4


@pytest.mark.parametrize("moving", [0, 1])
@pytest.mark.parametrize("turn", [0.1, 7.0, -60.0])
def test_intervals_are_cut_where_a_joint_goes_far(turn: float, moving: int) -> None:
    robot = robot_named("planar_3r")
    q = np.zeros((3, 3))
    q[1 + moving :, 2] = turn
    trajectory = sm.Trajectory([0.0, 0.5, 1.0], q, np.zeros((3, 3)), robot.joint_names)
    pose = robot.pose(q[0])
    edges = _edges(sm.Waypoints.from_poses([0.0, 1.0], [pose, pose]), trajectory, ())
    fine = np.linspace(0.0, 1.0, 20001)
    way = np.append(0.0, np.cumsum(np.abs(np.diff(trajectory(fine)[:, 2]))))
    travel = np.diff(np.interp(edges, fine, way))
    # The way is spread evenly over the pieces of an interval, as its mean speed is not.
    assert travel.max() <= 2.0 * _TRAVEL
    assert {0.0, 0.5, 1.0} <= set(edges)
    assert np.all(np.diff(edges) > 0.0)
    # Where nothing moves nothing is cut.
    still = edges > 0.5 if moving == 0 else edges < 0.5
    assert np.count_nonzero(still) == 1


def test_what_turns_wildly_is_not_cut_at_all() -> None:
    robot = robot_named("planar_3r")
    q = np.array([[0.0] * 3, [0.0, 0.0, 1e4], [0.0, 0.0, 1e4]])
    trajectory = sm.Trajectory([0.0, 0.5, 1.0], q, np.zeros((3, 3)), robot.joint_names)
    pose = robot.pose(q[0])
    edges = _edges(sm.Waypoints.from_poses([0.0, 1.0], [pose, pose]), trajectory, ())
    np.testing.assert_array_equal(edges, [0.0, 0.5, 1.0])


def test_a_distance_that_is_only_a_bound_is_no_approach() -> None:
    model: Any = SimpleNamespace(pairs=(("a", "b"), ("c", "d")))
    before = Approach(Closest(1.0, "a", "b"), 0.2)
    t, values = np.array([0.3, 0.4]), np.array([[0.9, 0.5], [0.5, 0.7]])
    for bound in (0.5, 0.4):
        assert _nearer(before, model, t, values, np.full((2, 2), bound)) is before
    found = _nearer(before, model, t, values, np.array([[1.0, 0.5], [0.5, 1.0]]))
    assert (found.closest.value, found.time) == (0.7, 0.4)
    assert (found.closest.first, found.closest.second) == ("c", "d")


@pytest.mark.parametrize(("intervals", "each"), [(4096, 8), (4097, 4)])
def test_of_many_intervals_fewer_points_are_looked_at(intervals: int, each: int) -> None:
    robot = robot_named("planar_3r")
    q = robot.dexterous_configuration("planar")
    pose, t = robot.pose(q), np.linspace(0.0, 1.0, intervals + 1)
    rest = np.zeros((len(t), 3))
    trajectory = sm.Trajectory(t, np.tile(q, (len(t), 1)), rest, robot.joint_names)
    path = sm.Dwell(pose, 1.0)
    found = bound_errors(robot, path, sm.Task.PLANAR, trajectory, sm.Tolerance(), ())
    assert found.samples == each * intervals + 1
    assert found.position.value < 1e-12


# --- limits of joints


def test_margins_are_those_of_the_nearest_side() -> None:
    """A cubic from 0 to 0 with speeds ± 4 reaches 1 in the middle."""
    motion = motion_of([[0.0, 0.2, 0.0]] * 2, [[4.0, 0.0, -4.0], [-4.0, 0.0, 4.0]])
    infinite = np.full(3, np.inf)
    for lower, upper, joint, amount, time in (
        (-infinite, np.array([1.5, 1.0, np.inf]), 0, 0.5, 0.5),
        (-infinite, np.array([0.75, 1.0, np.inf]), 0, -0.25, 0.5),
        (np.array([-np.inf, -np.inf, -0.9]), infinite, 2, -0.1, 0.5),
        (np.array([-0.3, -0.05, -9.0]), np.array([9.0, 0.3, 9.0]), 1, 0.1, 0.0),
    ):
        found = JointLimits(0, lower, upper).judge(motion)
        assert found.subject == motion.robot.joint_names[joint]
        assert (found.amount, found.allowed) == (pytest.approx(amount), 0.0)
        assert found.kept is (amount >= 0.0)
        assert found.time == pytest.approx(time)
        assert f"is {-amount:.3g} beyond its limit" in found.text
    kept = JointLimits(0, np.array([0.0, 0.0, -1.0]), np.array([1.0, 1.0, 0.0])).judge(motion)
    assert (kept.kept, kept.amount) == (True, pytest.approx(0.0, abs=ROUNDING))


@pytest.mark.parametrize(("order", "longer"), [(1, 2.0), (2, 2.0**0.5), (3, 2.0 ** (1.0 / 3.0))])
def test_shares_of_rates_say_how_much_longer_it_takes(order: int, longer: float) -> None:
    """From rest to rest by 1 in 1 s: 1.5 of speed, 6 of acceleration, 12 of jerk at most."""
    most = {1: 1.5, 2: 6.0, 3: 12.0}[order]
    motion = motion_of([[0.0] * 3, [0.0, -1.0, 0.0]], np.zeros((2, 3)))
    limit = np.array([1e-3, 0.5 * most, np.inf])
    limits = JointLimits(order, -limit, limit)
    found = limits.judge(motion)
    assert (found.subject, found.allowed, found.kept) == (motion.robot.joint_names[1], 1.0, False)
    assert found.amount == pytest.approx(2.0)
    assert f"{found.amount:.5g} times its limit" in found.text
    assert f"give it {longer:.5g} times the duration" in found.text
    known = ("speeds", "accelerations", "jerks")[order - 1]
    assert limits.covers == ((known,) if order == 1 else ())
    exact = JointLimits(order, np.full(3, -most), np.full(3, most))
    assert exact.covers == (known,)
    assert exact.judge(motion).amount == pytest.approx(1.0)
    one_sided = JointLimits(order, np.full(3, -0.5 * most), np.full(3, 9.0 * most)).judge(motion)
    # The jerk of such a motion has one sign.
    assert one_sided.amount == pytest.approx(2.0 if order < 3 else 1.0 / 9.0)


def test_a_jump_of_acceleration_breaks_any_limit_of_jerk() -> None:
    """Two cubics from rest to rest: from -6 to 6 at the middle sample."""
    motion = motion_of([[0.0] * 3, [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], np.zeros((3, 3)))
    wide = np.full(3, 1e3)
    found = JointLimits(3, -wide, wide).judge(motion)
    assert (found.kept, found.subject, found.time) == (False, motion.robot.joint_names[0], 1.0)
    assert found.amount == pytest.approx(12.0 / (1e-6 * 1e3))
    assert "jumps by 12" in found.text
    assert JointLimits(3, -1e8 * wide, 1e8 * wide).judge(motion).kept
    # A jump just beyond what a limited jerk does in an instant, and just within.
    for share in (1.01, 0.99):
        narrow = np.full(3, 12.0 / (1e-6 * share))
        found = JointLimits(3, -narrow, narrow).judge(motion)
        assert found.kept is (share < 1.0)


@pytest.mark.parametrize(("order", "power"), [(2, 0.5), (3, 1.0 / 3.0)])
def test_slow_rates_say_how_much_shorter_it_could_take(order: int, power: float) -> None:
    motion = motion_of([[0.0] * 3, [0.0, -1.0, 0.0]], np.zeros((2, 3)))
    limit = np.full(3, {2: 6.0, 3: 12.0}[order] / 0.25)
    found = JointLimits(order, -limit, limit).judge(motion)
    assert f"give it {0.25**power:.5g} times the duration" in found.text


def test_of_equal_errors_the_first_is_told() -> None:
    first = _larger(Extreme(0.0, 0.0, "it"), np.array([1.0, 2.0, 2.0]), np.array([0.1, 0.2, 0.3]))
    assert first == Extreme(2.0, 0.2, "it")
    assert _larger(first, np.array([2.0]), np.array([0.7])) == first
    assert _larger(first, np.zeros(0), np.zeros(0)) == first
    assert np.isnan(_larger(first, np.array([3.0, np.nan]), np.array([0.7, 0.8])).value)


def test_where_nothing_is_used_the_first_column_is_told_at_the_start() -> None:
    motion = motion_of([[0.0] * 3, [1.0, 0.0, 0.0]], np.zeros((2, 3)), [2.0, 3.0]).trajectory
    assert largest_share(motion, lambda q, *_: 0.0 * q) == (0.0, 2.0, 0)


@pytest.mark.parametrize(
    ("order", "lower", "upper"),
    [
        (4, -1.0, 1.0),
        (0, 1.0, -1.0),
        (0, np.nan, 1.0),
        (1, 0.0, 1.0),
        (1, -1.0, 0.0),
        (2, 0.5, 1.0),
    ],
)
def test_limits_that_cannot_be_kept_are_refused(order: int, lower: float, upper: float) -> None:
    with pytest.raises(sm.ProblemError, match="expected"):
        JointLimits(order, np.full(3, lower), np.full(3, upper))
    assert JointLimits(0, np.zeros(3), np.zeros(3)).order == 0
    with pytest.raises(sm.ProblemError, match="expected"):
        JointLimits(0, np.zeros(3), np.ones(2))


# --- ends


@pytest.mark.parametrize("miss", [0.9e-6, 1.1e-6, -1.1e-6])
def test_ends_are_judged_to_a_micrometre(miss: float) -> None:
    rest = np.zeros((2, 3))
    q = np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]])
    motion, kept = motion_of(q, rest), abs(miss) <= 1e-6
    off, far = np.array([0.0, miss, 0.0]), 9.0 * np.ones(3)
    cases: list[tuple[sm.Requirement, sm.FinishedMotion, float]] = [
        (EndState(0, q[1] + off), motion, 1.0),
        (EndState(0, q[0] + off, at_start=True), motion, 0.0),
        (EndState(1, off), motion, 1.0),
        (EndState(1, off, at_start=True), motion, 0.0),
        (AtRest(True, True), motion_of(q, [off, 0.0 * off]), 0.0),
        (AtRest(False, True), motion_of(q, [9.0 * np.ones(3), off]), 1.0),
        (AtRest(True, False), motion_of(q, [off, 9.0 * np.ones(3)]), 0.0),
        (ClosedMotion(False), motion_of([q[0], q[1], q[0] + off], [off, off, far]), 2.0),
        (ClosedMotion(True), motion_of([q[0], q[1], q[0]], [q[0], off, q[0] + off]), 2.0),
    ]
    for requirement, given, time in cases:
        found = requirement.judge(given)
        assert found.kept is kept, requirement
        assert (found.subject, found.time) == (given.robot.joint_names[1], time)
        assert (found.amount, found.allowed) == (pytest.approx(abs(miss), rel=1e-6), 1e-6)
        assert f"{'ends' if time else 'starts'}" in found.text
    given = motion_of([q[0], q[0] + 1e-3], [q[0], q[0]])
    told = ClosedMotion(True).judge(given).text
    assert told == f"joint '{given.robot.joint_names[0]}' ends 1.00e-03 away from the start"


@pytest.mark.parametrize(
    ("order", "words"), [(0, "away from where it should"), (1, "off the one asked for")]
)
def test_ends_are_told_in_words_of_their_own(order: int, words: str) -> None:
    motion = motion_of(np.zeros((2, 3)), np.zeros((2, 3)))
    assert words in EndState(order, np.ones(3)).judge(motion).text


def test_end_accelerations_are_judged_less_closely() -> None:
    motion = motion_of([[0.0] * 3, [1.0, 0.0, 0.0]], np.zeros((2, 3)))
    for miss, kept in ((0.9e-4, True), (1.1e-4, False)):
        found = EndState(2, np.array([-6.0, miss, 0.0])).judge(motion)
        assert (found.kept, found.allowed) == (kept, 1e-4)
        assert "with an acceleration" in found.text
    assert EndState(2, np.array([6.0, 0.0, 0.0]), at_start=True).judge(motion).kept


def test_rest_covers_the_ends_that_it_is_asked_for() -> None:
    assert AtRest(True, True).covers == ("rest at both ends",)
    assert AtRest(True, False).covers == ("rest at the start",)
    assert AtRest(False, True).covers == ("rest at the end",)


# --- distances


class Bodies:
    """Pairs of bodies whose distances are given functions of q, with one lever on all joints."""

    open_meshes = overlapping = disabled = obstacles = ()
    checks_links = True

    def __init__(self, *distances: Callable[[Array], Array], lever: float = 1.0) -> None:
        self._given, self._lever, self.asked = distances, lever, 0
        self.pairs = tuple((f"first{k}", f"second{k}") for k in range(len(distances)))

    def pair_levers_up_to(self, farthest: Array) -> Array:
        return np.full((len(self.pairs), len(farthest)), self._lever)

    def distances(self, q: Array, below: Array, exact_below: Array) -> Array:
        self.asked += len(q)
        exact = np.stack([given(q) for given in self._given], axis=1)
        # Hulls are nearer to each other by up to a centimetre.
        hulls = exact - 0.005 * (1.0 + np.sin(1e3 * exact))
        near = np.where(hulls < exact_below, exact, hulls)
        # As GJK does: beyond what matters, any number that is not smaller.
        return np.where(exact < below, near, np.maximum(below, exact - 0.01))

    def worst(self, q: Array) -> Closest:
        if not self.pairs:
            return Closest(np.inf, "", "")
        exact = np.stack([given(q) for given in self._given], axis=1)
        row, pair = np.unravel_index(int(np.argmin(exact)), exact.shape)
        return Closest(float(exact[row, pair]), *self.pairs[pair], int(row))

    def distance(self, q: Array) -> Closest:
        return self.worst(q[None])


@pytest.mark.parametrize("most", [1, 4, 200_000])
def test_what_is_not_looked_at_is_never_kept(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two bodies that meet for an instant, while another pair nearly does all the time."""
    monkeypatch.setattr("selfmotion.certificate.apart._MOST", most)
    motion = motion_of([[0.0] * 3, [3.0, 0.0, 0.0]], [[3.0, 0.0, 0.0]] * 2, [0.0, 1.0])
    bodies = Bodies(
        lambda q: np.full(len(q), 1e-7),
        lambda q: np.minimum(np.abs(q[:, 0] - 1.234567), 0.3) - 1e-3,
    )
    found = closest_at_all_times(bodies, motion.trajectory, 0.0)  # type: ignore[arg-type]
    assert found.open_until is not None or found.closest.value < 0.0


@pytest.mark.parametrize("above", [-1e-10, -1e-17, 0.0, 1e-17, 1e-12])
def test_bodies_that_come_exactly_as_near_as_they_may_are_told(above: float) -> None:
    motion = motion_of([[0.0] * 3, [3.0, 0.0, 0.0]], [[3.0, 0.0, 0.0]] * 2, [0.0, 1.0])
    bodies = Bodies(lambda q: 0.1 + np.abs(q[:, 0] - 1.234567))
    found = closest_at_all_times(bodies, motion.trajectory, 0.1 + above)  # type: ignore[arg-type]
    assert found.names == "first0 - second0"
    assert found.closest.value == pytest.approx(0.1, abs=0.002)


@pytest.mark.parametrize("seed", range(8))
def test_the_closest_approach_is_found_wherever_it_is(seed: int) -> None:
    """Dips as narrow as levers allow, at times that nothing looks at by itself."""
    rng = np.random.default_rng(seed)
    motion = motion_of([[0.0] * 3, [3.0, 0.0, 0.0]], [[3.0, 0.0, 0.0]] * 2, [0.0, 1.0])
    place, depth = rng.uniform(0.0, 3.0), rng.uniform(0.01, 0.2)
    bodies = Bodies(
        lambda q: np.full(len(q), 0.35), lambda q: depth + np.minimum(np.abs(q[:, 0] - place), 0.3)
    )
    found = closest_at_all_times(bodies, motion.trajectory, 0.0)  # type: ignore[arg-type]
    assert depth <= found.closest.value <= depth + max(0.021 * depth, 1e-4)
    assert found.names == "first1 - second1"
    assert found.time == pytest.approx(place / 3.0, abs=0.01)
    assert found.open_until is None
    assert bodies.asked < 3000
    for distance, kept in ((0.999 * depth, True), (1.001 * depth, False)):
        judged = KeepsApart(bodies, distance).judge(motion)  # type: ignore[arg-type]
        assert judged.kept is kept
        assert (judged.subject, judged.allowed) == ("first1 - second1", distance)


def test_a_distance_that_is_grazed_is_undecided_and_said_to_be() -> None:
    motion = motion_of([[0.0] * 3, [3.0, 0.0, 0.0]], [[3.0, 0.0, 0.0]] * 2, [0.0, 1.0])
    bodies = Bodies(lambda q: 0.1 + np.minimum(np.abs(q[:, 0] - 1.0), 0.3), lever=2.0)
    judged = KeepsApart(bodies, 0.1).judge(motion)  # type: ignore[arg-type]
    assert not judged.kept
    assert "whether first0 - second0 keep 100.00 mm from t = 0.333333 to 0.333333 s" in judged.text
    assert "is not decided: they come to 100.0000 mm" in judged.text
    assert judged.time == pytest.approx(1.0 / 3.0, abs=1e-3)
    found = closest_at_all_times(bodies, motion.trajectory, 0.1)  # type: ignore[arg-type]
    assert found.open_until is not None
    # Sixteen intervals, halved 26 times.
    assert (found.open_until - found.time) * 16.0 * 2.0**26 == pytest.approx(1.0)
    far = Bodies(lambda q: np.full(len(q), 50.0))
    assert closest_at_all_times(far, motion.trajectory, 0.1).open_until is None  # type: ignore[arg-type]
    assert far.asked == 17


def test_how_near_bodies_come_is_told_in_millimetres() -> None:
    motion = motion_of(np.zeros((2, 3)), np.zeros((2, 3)))
    text = KeepsApart(Bodies(lambda q: np.full(len(q), 0.05)), 0.1).judge(motion).text  # type: ignore[arg-type]
    assert text.startswith("first0 - second0 are 50.00 mm apart at t = 0.000 s (wanted: 100.00 mm)")


def test_links_that_overlap_as_they_are_made_are_told_with_how_often() -> None:
    motion = motion_of(np.zeros((2, 3)), np.zeros((2, 3)))
    bodies = Bodies(lambda q: np.full(len(q), -0.05))
    bodies.overlapping = (SimpleNamespace(first="first0", second="second0", share=0.3),)
    text = KeepsApart(bodies, 0.1).judge(motion).text  # type: ignore[arg-type]
    assert "overlap in 30 % of all configurations" in text


def test_a_finished_motion_is_looked_at_from_its_start_to_its_end() -> None:
    motion = motion_of(np.zeros((3, 3)), np.zeros((3, 3)))
    times = motion.trajectory.t
    assert motion.t[0] == times[0]
    assert motion.t[-1] == times[-1]
    assert set(times) <= set(motion.t)
    assert np.all(np.diff(motion.t) > 0.0)


def test_a_joint_that_needs_nothing_may_have_no_limit() -> None:
    """0 of infinity is no number."""
    dynamics: Any = SimpleNamespace(torques=lambda q, qd, qdd: 0.0 * q)
    motion = motion_of(np.zeros((2, 3)), np.zeros((2, 3)))
    found = JointTorques(dynamics, np.full(3, np.inf)).judge(motion)
    assert found.kept
    assert "needs 0 Nm or N" in found.text
    assert "nan" not in found.text


def test_nothing_to_be_near_to_is_far_enough() -> None:
    motion = motion_of(np.zeros((2, 3)), np.zeros((2, 3)))
    found = KeepsApart(Bodies(), 0.1).judge(motion)  # type: ignore[arg-type]
    assert (found.kept, found.subject, found.amount) == (True, "nothing", np.inf)


@pytest.mark.parametrize(
    ("value", "words"),
    [(0.05, "too near already: first0 - second0 are 50.00 mm"), (-0.01, "overlap by 10.00 mm")],
)
def test_a_start_that_is_too_near_is_told(value: float, words: str) -> None:
    motion = motion_of(np.zeros((2, 3)), np.zeros((2, 3)))
    bodies = Bodies(lambda q: np.full(len(q), value))
    assert words in KeepsApart(bodies, 0.1).judge(motion).text  # type: ignore[arg-type]
    assert words not in KeepsApart(bodies, -1.0).judge(motion).text  # type: ignore[arg-type]
    # Of the start it is said, not of what comes later.
    later = motion_of([[0.0] * 3, [1.0] * 3], np.zeros((2, 3)))
    nearer = Bodies(lambda q: np.where(q[:, 0] > 0.5, value, 1.0))
    assert "the start" not in KeepsApart(nearer, 0.1).judge(later).text  # type: ignore[arg-type]


# --- shares of limits


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("most", [0.5, 0.99, 0.9999, 1.0001, 1.01, 3.0])
def test_the_largest_share_is_bounded_and_hardly_more(most: float, sign: float) -> None:
    """Of forces that swing ten times, with a peak between all samples."""
    motion = motion_of([[0.0] * 3, [0.0, 6.2, 0.0]], [[0.0, 6.2, 0.0]] * 2).trajectory

    def shares(q: Array, qd: Array, qdd: Array) -> Array:
        swing = sign * most * np.cos(10.0 * (q[:, 1] - 2.345)) * np.exp(-((q[:, 1] - 2.345) ** 2))
        return np.stack([0.0 * swing, swing], axis=1)

    found = largest_share(motion, shares)
    assert found is not None
    assert most - ROUNDING <= found.share <= 1.05 * most
    assert (found.share <= 1.0) is (most <= 1.0)
    assert found.column == 1
    assert motion(np.array([found.time]))[0, 1] == pytest.approx(2.345, abs=0.05)


def test_rates_are_seen_on_both_sides_of_a_sample() -> None:
    """Accelerations jump there: from -6 to 6."""
    motion = motion_of([[0.0] * 3, [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], np.zeros((3, 3))).trajectory
    for sign in (1.0, -1.0):
        found = largest_share(motion, lambda q, qd, qdd, sign=sign: np.maximum(sign * qdd, 0.0))
        assert found is not None
        assert found.share == pytest.approx(6.0, rel=1e-3)


def test_a_corner_is_cut_to_a_few_thousandths_of_an_interval() -> None:
    """A peak just below 1 that no polynomial follows is over-estimated by what is left of it."""
    motion = motion_of([[0.0] * 3, [0.0, 1.0, 0.0]], [[0.0, 1.0, 0.0]] * 2).trajectory
    found = largest_share(motion, lambda q, *_: 1.0 - 1e-9 - np.abs(q[:, 1:2] - 1.0 / 3.0))
    assert found is not None
    assert found.share - 1.0 == pytest.approx(1.6e-7, rel=0.2)


def test_what_is_not_a_number_is_no_share() -> None:
    motion = motion_of([[0.0] * 3, [1.0, 0.0, 0.0]], np.zeros((2, 3))).trajectory
    found = largest_share(motion, lambda q, qd, qdd: np.where(q > 0.99, np.nan, 0.1))
    assert found is not None
    assert not found.share <= 1.0


def test_joints_that_go_too_far_are_not_looked_at() -> None:
    far = motion_of([[0.0] * 3, [0.0, 1e6, 3.0]], np.zeros((2, 3)))
    assert largest_share(far.trajectory, lambda *state: state[0]) is None
    found = too_far("it", far)
    assert (found.kept, found.subject) == (False, far.robot.joint_names[1])
    assert "travels 1e+06 rad" in found.text
    assert (found.time, found.amount, found.allowed) == (far.trajectory.t[0], np.inf, 1.0)


def test_a_band_is_half_its_width_from_its_middle() -> None:
    robot = robot_named("planar_3r")
    name = robot.joint_names[1]
    motion = motion_of([[0.0, 0.2, 0.0], [0.0, 0.5, 0.0]], [[0.0, 0.3, 0.0]] * 2)
    for center, half, share in ((0.1, 0.5, 0.8), (0.1, 0.3, 4.0 / 3.0), (0.7, 1.0, 0.5)):
        found = CoordinateBand(robot, sm.JointCoordinate(name), center, half).judge(motion)
        assert found.amount == pytest.approx(share, rel=1e-3)
        assert found.kept is (share <= 1.0)
        assert f"expected {center - half:.4g} to {center + half:.4g}" in found.text


@pytest.mark.parametrize("column", range(4))
def test_the_tools_rates_are_told_with_the_time_they_take(column: int) -> None:
    """The stretched arm turning about its base at 2 rad/s: ω r, ω, ω² r, and no turn faster."""
    robot = robot_named("planar_3r")
    reach = float(np.linalg.norm(robot.pose(np.zeros(3)).translation[:2]))
    motion = motion_of([[0.0] * 3, [2.0, 0.0, 0.0]], [[2.0, 0.0, 0.0]] * 2)
    rates = [2.0 * reach, 2.0, 4.0 * reach, 0.0]
    limit = np.full(4, np.inf)
    limit[column] = rates[column] / 4.0 if column < 3 else 1.0
    requirement = ToolMotion(robot, limit)
    found = requirement.judge(motion)
    names = ("speed", "turn rate", "acceleration", "turn acceleration")
    assert requirement.covers == (f"tool {names[column]}",)
    assert found.amount == pytest.approx(4.0 if column < 3 else 0.0, rel=1e-3, abs=1e-6)
    assert found.kept is (column == 3)
    if column < 3:
        longer = found.amount if column < 2 else found.amount**0.5
        assert f"a {names[column]} of {found.amount * limit[column]:.4g}" in found.text
        assert f"give it {longer:.5g} times the duration" in found.text


# --- the words of the verdict


def test_where_damping_acts_is_told_stretch_by_stretch() -> None:
    law, t = DampingLaw(0.2, 0.1), np.arange(8.0)
    singular = np.array([0.1, 0.3, 0.3, 0.15, 0.05, 0.2, 0.3, 0.1])
    damped = _damped_stretches(law, t, singular)
    assert [(x.start, x.end, x.singular_value) for x in damped] == [
        (0.0, 0.0, 0.1),
        (3.0, 4.0, 0.05),
        (7.0, 7.0, 0.1),
    ]
    np.testing.assert_allclose([x.factor for x in damped], law.factor(np.array([0.1, 0.05, 0.1])))
    assert _damped_stretches(law, t, np.full(8, 0.2)) == ()
    for time, words in (
        (0.0, "where"),
        (1.0, "after"),
        (3.0, "where"),
        (4.0, "where"),
        (5.0, "after"),
    ):
        last = damped[0] if time < 3.0 else damped[1]
        assert _because(time, damped) == f", {words} damping was active, {last}"
    assert _because(2.0, damped[1:]) == ""


def test_what_is_undecided_is_counted() -> None:
    assert _undecided(()) == ()
    for count, words in (
        (1, "decided:"),
        (2, "and on 1 other interval:"),
        (3, "2 other intervals:"),
    ):
        (text,) = _undecided(((0.25, 0.5),) * count)
        assert "from t = 0.25 to 0.5 s is not decided" in text
        assert words in text


def test_a_verdict_names_each_fault_and_what_was_looked_at() -> None:
    """Off the path in place and angle, too short, with limits: and nothing of that when kept."""
    robot = robot_named("panda")
    pose = robot.pose(PANDA_HOME)
    still = sm.Waypoints.from_poses([0.0, 1.0], [pose, pose])
    motion = sm.Trajectory([0.0, 1.0], [PANDA_HOME] * 2, np.zeros((2, 7)), robot.joint_names)
    good = sm.certify(robot, still, "pose", motion)
    assert good.verified
    assert good.on_path
    assert good.closure == 0.0
    assert "verified at all times (path, joint limits, speeds)" in good.verdict
    assert good.not_checked == ("accelerations", "self-collision")
    aside = pose.copy()
    aside.translation = pose.translation + np.array([0.0, 3e-6, 4e-6])
    aside.rotation = pose.rotation @ pin.exp3(np.array([0.0, 0.0, 2e-6]))
    beside = sm.Waypoints.from_poses([0.0, 2.0], [aside, aside])
    bad = sm.certify(robot, beside, "pose", motion)
    assert bad.position_error.value == pytest.approx(5e-6, rel=1e-3)
    assert bad.rotation_error.value == pytest.approx(2e-6, rel=1e-3)
    assert len(bad.failures) == 3
    for words in ("5.00e-06 m off", "2.00e-06 rad off", "lasts 1 s, the path 2 s"):
        assert words in bad.verdict
    for tolerance, kept in ((sm.Tolerance(6e-6, 1e-6), False), (sm.Tolerance(6e-6, 3e-6), True)):
        assert sm.certify(robot, beside, "pose", motion, tolerance).on_path is kept
    exact = sm.Tolerance(bad.position_error.value, bad.rotation_error.value)
    assert len(sm.certify(robot, beside, "pose", motion, exact).failures) == 1
    moved = motion.q + np.outer([0.0, 1.0], [0.0, 0.3, 0.0, -0.1, 0.0, 0.0, 0.0])
    gone = sm.Trajectory([0.0, 1.0], moved, np.zeros((2, 7)), robot.joint_names)
    assert sm.certify(robot, still, "pose", gone).closure == pytest.approx(0.3)
    ended = sm.certify(robot, still, "pose", motion, ending="it stops here")
    assert ended.failures == ("it stops here",)

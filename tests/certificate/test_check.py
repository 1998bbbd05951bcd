"""Verdicts: each fault is named, broken plans are refused, and another computation agrees."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.certificate import check
from selfmotion.certificate.check import _damped_intervals, _damping_cause, _undecided, _violations
from selfmotion.certificate.path_error import PathCheck, smallest_singular_values
from selfmotion.model.follow import Follows
from selfmotion.model.task import DampingLaw
from support.arms import PANDA_HOME, Case, robot_named, short_line
from support.motions import motion_of


def test_a_finished_motion_is_looked_at_from_its_start_to_its_end() -> None:
    motion = motion_of(np.zeros((3, 3)), np.zeros((3, 3)))
    times = motion.trajectory.t
    assert motion.t[0] == times[0]
    assert motion.t[-1] == times[-1]
    assert set(times) <= set(motion.t)
    assert np.all(np.diff(motion.t) > 0.0)


def test_where_damping_acts_is_told_stretch_by_stretch() -> None:
    law, t = DampingLaw(0.2, 0.1), np.arange(8.0)
    singular = np.array([0.1, 0.3, 0.3, 0.15, 0.05, 0.2, 0.3, 0.1])
    damped = _damped_intervals(law, t, singular)
    assert [(x.start, x.end, x.singular_value) for x in damped] == [
        (0.0, 0.0, 0.1),
        (3.0, 4.0, 0.05),
        (7.0, 7.0, 0.1),
    ]
    np.testing.assert_allclose([x.factor for x in damped], law.factor(np.array([0.1, 0.05, 0.1])))
    assert _damped_intervals(law, t, np.full(8, 0.2)) == ()
    for time, words in (
        (0.0, "where"),
        (1.0, "after"),
        (3.0, "where"),
        (4.0, "where"),
        (5.0, "after"),
    ):
        last = damped[0] if time < 3.0 else damped[1]
        assert _damping_cause(time, damped) == f", {words} damping was active, {last}"
    assert _damping_cause(2.0, damped[1:]) == ""


def test_what_is_undecided_is_counted() -> None:
    extreme = sm.certificate.Extreme(0.0, 0.0, "tip")

    def said(count: int) -> tuple[str, ...]:
        open_ = tuple((0.25 * k, 0.25 * k + 0.25) for k in range(1, count + 1))
        return _undecided(PathCheck(extreme, extreme, (), open_, True, 1))

    assert said(0) == ()
    for count, words in (
        (1, "decided:"),
        (2, "and on 1 other interval:"),
        (3, "2 other intervals:"),
    ):
        (text,) = said(count)
        assert "from t = 0.25 to 0.5 s is not decided" in text
        assert words in text


def test_a_verdict_names_each_fault_and_what_was_looked_at() -> None:
    """Off the path in place and angle, too short, with limits: and nothing of that when kept."""
    robot = robot_named("panda")
    pose = robot.pose(PANDA_HOME)
    still = sm.paths.Waypoints.from_poses([0.0, 1.0], [pose, pose])
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
    beside = sm.paths.Waypoints.from_poses([0.0, 2.0], [aside, aside])
    bad = sm.certify(robot, beside, "pose", motion)
    assert bad.position_error.value == pytest.approx(5e-6, rel=1e-3)
    assert bad.rotation_error.value == pytest.approx(2e-6, rel=1e-3)
    assert len(bad.failures) == 3
    for words in ("5 µm off", "2 µrad off", "lasts 1 s, the path 2 s"):
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


@pytest.mark.parametrize("apart", [-9e-5, -1e-6, 1e-6, 9e-5, -2e-4, 2e-4])
@pytest.mark.parametrize("speed", [0.0, 0.02, 1.0])
def test_a_motion_whose_times_are_rounded_is_judged_by_where_it_ends(
    apart: float, speed: float
) -> None:
    """Within 0.1 ms of the path's duration, if what lasts longer stays within the tolerance."""
    panda = robot_named("panda")
    begin = panda.pose(PANDA_HOME)
    end = begin.copy()
    end.translation = begin.translation + np.array([0.0, speed, 0.0])
    path = (
        sm.paths.Line(begin, end, 1.0, time_law="constant") if speed else sm.paths.Dwell(begin, 1.0)
    )
    q = PANDA_HOME
    motion = sm.Trajectory([0.0, 1.0 + apart], [q, q], np.zeros((2, 7)), panda.joint_names)
    # The arm stands, off the path by the whole way, which is allowed, and some more.
    for more in (1e-6, 1e-5):
        within = sm.Tolerance(speed + more, 1e-6)
        found = sm.certify(panda, path, "pose", motion, within)
        # What lasts longer is the arm, which stands, or the path, off by all of the way then.
        assert any("lasts" in text for text in found.failures) == (abs(apart) > 1e-4)
    # It goes: by its last moments it is farther away than is allowed.
    t = np.array([0.0, 1.0 + apart])
    rate = np.tile([0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], (2, 1))
    gone = sm.Trajectory(t, q + t[:, None] * rate, rate, panda.joint_names)
    long = sm.certify(panda, path, "pose", gone, sm.Tolerance(2.0, 0.5 + 1e-7))
    late = [text for text in long.failures if "lasts" in text]
    assert bool(late) == (apart > 1e-7 or abs(apart) > 1e-4)
    if late:
        assert f"{abs(apart):.2g} s too {'long' if apart > 0 else 'short'}" in late[0]


@pytest.mark.parametrize(("most", "times"), [(1000, [11]), (11, [6, 3]), (6, [6, 3]), (5, [4, 4])])
def test_of_long_motions_fewer_poses_are_looked_at_for_singular_ones(
    most: int, times: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two intervals of five times each, and the end: all, each second, each third; then nearby."""
    robot, looked = robot_named("panda"), list[int]()
    motion = sm.Trajectory([0.0, 1.0, 2.0], [PANDA_HOME] * 3, np.zeros((3, 7)), robot.joint_names)

    def counting(follows: sm.Follows, q: Array) -> Array:
        looked.append(len(q))
        return smallest_singular_values(follows, q)

    monkeypatch.setattr(check, "_MAX_POSES", most)
    monkeypatch.setattr(check, "smallest_singular_values", counting)
    found = sm.certify(robot, sm.paths.Dwell(robot.pose(PANDA_HOME), 2.0), "pose", motion)
    assert looked == times
    assert found.smallest_singular_value.time == 0.0


def test_the_nearest_of_few_poses_is_that_of_all(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot, task, start, path = case
    plan = sm.plan(sm.Problem(robot, path, task, start))
    every = plan.certificate.smallest_singular_value
    monkeypatch.setattr(check, "_MAX_POSES", 40)
    assert plan.check().smallest_singular_value == every


@pytest.mark.parametrize("most", [20, 40, 100])
def test_of_many_loops_the_nearest_pose_is_found(
    most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each has a dip, between two of the few poses that are looked at first."""
    robot, t = robot_named("panda"), np.linspace(0.0, 40.0, 201)
    angle, first = 0.5 * np.pi * t, robot.pose(PANDA_HOME)
    poses = [first.copy() for _ in t]
    for pose, s, a in zip(poses, t, angle, strict=True):
        pose.translation += 0.12 * np.array([0.02 * s, np.sin(a), np.cos(a) - 1.0])
    path = sm.paths.Waypoints.from_poses(t, poses)
    plan = sm.plan(
        sm.Problem(robot, path, "pose", PANDA_HOME, rest=False, constraints=(), clearance=None)
    )
    monkeypatch.setattr(check, "_MAX_POSES", 1_000_000)
    every = plan.check().smallest_singular_value
    monkeypatch.setattr(check, "_MAX_POSES", most)
    assert plan.check().smallest_singular_value == every


def test_long_motions_tell_how_far_their_check_is() -> None:
    robot, q = robot_named("panda"), robot_named("panda").dexterous_configuration()
    t = np.linspace(0.0, 10.0, 5001)
    motion = sm.Trajectory(t, np.tile(q, (5001, 1)), np.zeros((5001, 7)), robot.joint_names)
    told: list[tuple[str, int, int]] = []
    problem = sm.Problem(robot, sm.paths.Dwell(robot.pose(q), 10.0), "position")
    certificate = problem.certify(motion, progress=lambda *given: told.append(given))
    assert certificate.on_path
    assert told[:3] == [("checking", k, 3) for k in (1, 2, 3)]
    told.clear()
    short = sm.Trajectory([0.0, 10.0], motion.q[:2], motion.qd[:2], robot.joint_names)
    assert problem.certify(short, progress=lambda *given: told.append(given)).on_path
    assert not told


# Of a few additions of numbers of order 1.
ROUNDING = 1e-12
# Errors are interpolated to a ten-thousandth of the tolerance.
INTERPOLATED = 2e-10


Circle = Callable[..., sm.Problem]


@pytest.fixture(scope="module")
def sample() -> sm.Plan:
    return sm.plan(sm.sample_problem())


def test_certificate_equals_an_independent_recomputation(
    case: tuple[sm.RobotModel, sm.Task, Array, sm.paths.Path],
) -> None:
    robot, task, start, path = case
    plan = sm.plan(sm.Problem(robot, path, task, start))
    certificate = plan.certificate
    t = np.concatenate(
        [
            np.linspace(a, b, 5, endpoint=False)
            for a, b in zip(plan.trajectory.t[:-1], plan.trajectory.t[1:], strict=True)
        ]
        + [plan.trajectory.t[-1:]]
    )
    misses, singular, margins, ratios = [], [], [], []
    for time in t:
        q, qd = plan.trajectory(time), plan.trajectory(time, order=1)
        misses.append(task.miss(path.pose(time), robot.pose(q)))
        jacobian = robot.task_jacobian(q, task)
        singular.append(np.sqrt(np.linalg.eigvalsh(jacobian @ jacobian.T)[0]))
        margins.append(min((q - robot.lower).min(), (robot.upper - q).min()))
        ratios.append((np.abs(qd) / robot.velocity_limit).max())
    position, rotation = np.max(misses, axis=0)
    # Errors are bounds at all times: never milder than what is found here, and near it.
    found = certificate.position_error.value, certificate.rotation_error.value
    assert position - ROUNDING <= found[0] <= 1.5 * position + INTERPOLATED
    assert rotation - 1e-9 <= found[1] <= 1.5 * rotation + 1e-9
    assert certificate.smallest_singular_value.value == pytest.approx(min(singular), rel=1e-6)
    # Limits are judged between these times as well: never milder than here, and hardly stricter.
    assert min(margins) - 1e-5 <= certificate.limit_margin.value <= min(margins) + ROUNDING
    assert max(ratios) - ROUNDING <= certificate.velocity_ratio.value <= max(ratios) * (1 + 1e-3)
    assert certificate.samples >= 3 * (len(plan.trajectory.t) - 1)
    assert certificate.position_error.value <= 1e-6
    assert certificate.rotation_error.value <= 1e-6


def broken(plan: sm.Plan, **changes: Array) -> sm.Certificate:
    trajectory = dataclasses.replace(plan.trajectory, **changes)
    return sm.certify(plan.robot, plan.path, plan.task, trajectory)


def test_broken_plans_are_refused(panda_circle: Circle) -> None:
    plan = sm.plan(panda_circle())
    motion = plan.trajectory
    assert broken(plan).verified

    q = motion.q.copy()
    q[20, 2] += 1e-4
    certificate = broken(plan, q=q)
    assert not certificate.verified
    assert "off the path" in certificate.verdict
    assert certificate.position_error.time == pytest.approx(motion.t[20], abs=0.1)

    qd = motion.qd.copy()
    qd[20, 2] += 0.1
    assert not broken(plan, qd=qd).verified

    assert "lasts" in broken(plan, t=motion.t * 0.9).verdict

    shifted = motion.q.copy()
    shifted[:, 6] += 3.0
    assert "joint 'panda_joint7' is" in broken(plan, q=shifted).verdict


def test_too_fast_plans_are_refused_with_the_factor(panda: sm.RobotModel) -> None:
    start = panda.dexterous_configuration()
    path = sm.paths.Circle.around(panda.pose(start), 0.15, 0.8, normal=(1, 0, 0))
    plan = sm.plan(sm.Problem(panda, path, start=start))
    assert "times its limit" in plan.certificate.verdict
    assert plan.certificate.position_error.value <= 1e-6
    with pytest.raises(sm.errors.PlanError, match="times the duration"):
        plan.require()


def test_verified_plans_pass_require(sample: sm.Plan) -> None:
    assert sample.require() is sample


def test_what_no_slower_motion_mends_is_told_first() -> None:
    fast, near = (
        sm.certificate.Finding(name, "a", 0.0, 2.0, 1.0, False, name)
        for name in ("speeds", "clearance")
    )
    fast = dataclasses.replace(fast, of_pace=True, factor=1.5)
    assert list(_violations((fast, near))) == ["clearance", "speeds"]
    assert list(_violations((dataclasses.replace(near, satisfied=True), fast))) == ["speeds"]


@pytest.mark.parametrize("speed", [0.0, 0.3])
def test_what_lasts_longer_than_its_path_is_judged_by_what_the_tool_does_in_it(
    panda: sm.RobotModel, speed: float
) -> None:
    """By no more than a tick of a controller's clock, and only where the tool stays there."""
    plan = sm.plan(sm.Problem(panda, short_line(panda, PANDA_HOME), start=PANDA_HOME)).require()
    motion, more = plan.trajectory, 0.5 * check._CLOCK
    rates = np.zeros((1, 7))
    rates[0, 3] = speed
    longer = dataclasses.replace(
        motion,
        t=np.append(motion.t, motion.t[-1] + more),
        q=np.vstack([motion.q, motion.q[-1:] + more * rates]),
        qd=np.vstack([motion.qd, rates]),
        qdd=None if motion.qdd is None else np.vstack([motion.qdd, np.zeros((1, 7))]),
    )
    found = plan.problem.certify(longer, plan.tolerance)
    assert ("too long" in found.verdict) is (speed > 0.0)
    assert found.verified is (speed == 0.0)


def test_singular_values_are_those_of_the_task_jacobian(planar: sm.RobotModel) -> None:
    """Also next to a singular pose, with the arm stretched: there squares have no digits."""
    bent = np.array([0.0, 1e-9, 1e-6, 1e-4, 1e-2, 0.3])
    q = 0.3 + np.outer(bent, [0.0, 1.0, -0.4]) - [0.0, 0.3, 0.3]
    path = sm.paths.Dwell(planar.pose(q[0]), 1.0)
    follows = Follows.of(planar, path, sm.Task.PLANAR)
    expected = [
        np.linalg.svd(planar.task_jacobian(each, sm.Task.PLANAR), compute_uv=False)[-1]
        for each in q
    ]
    assert expected[0] < 1e-12 < expected[1] < 1e-8 < expected[2] < 1e-5 < 1e-2 < expected[-1]
    np.testing.assert_allclose(smallest_singular_values(follows, q), expected, atol=1e-12)

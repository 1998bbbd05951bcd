"""Segments: no jumps, the tool on its path, and what happens when not."""

from itertools import pairwise

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.realtime import Flag, Replanner
from selfmotion.realtime.quantities import is_quantity
from support import realtime_scenarios as scenarios
from support.arms import PANDA_HOME
from support.followed import standing
from support.loops import closed_loop

# Segments meet in the same numbers, computed in the same way but for one shift of an index.
SAME = 1e-12


# What the tool is off its path without noise or lag: the middle rule's error over cycles of 1 ms.
TRACKED = 1e-5


# The loop.


@pytest.mark.parametrize(
    ("arm", "task", "horizon"),
    [
        ("panda", "pose", 2.0),
        ("panda", "position", 2.0),
        # Steps far ahead are longer than near ones.
        ("panda", "position", 8.0),
        ("xarm7", "pointing", 2.0),
    ],
)
def test_segments_go_on_without_a_jump_and_the_tool_stays_on_its_path(
    arm: str, task: str, horizon: float
) -> None:
    robot = sm.load_robot(arm)
    start = robot.dexterous_configuration()
    path = sm.paths.Circle.around(robot.pose(start), 0.05, 4.0, normal=(1.0, 0.0, 0.0))
    replanner = Replanner(robot, task, horizon=horizon)
    segments, places = closed_loop(replanner, path, start, 1.5)
    for one, other in pairwise(segments):
        here = one.index(other.t[0])
        for name in ("q", "qd", "qdd"):
            before, after = getattr(one, name)[here], getattr(other, name)[0]
            assert np.abs(before - after).max() <= SAME
    assert all(item.flag is Flag.PLANNED and item.follows for item in segments)
    for k, q in enumerate(places):
        miss = sm.Task.of(task).miss(path.pose((k + 1) * replanner.period), robot.pose(q))
        assert max(miss) < TRACKED


def test_each_segment_ends_at_rest_and_keeps_all_limits(
    panda: sm.RobotModel, slow_circle: sm.paths.Circle
) -> None:
    replanner = Replanner(panda, "position")
    for segment in closed_loop(replanner, slow_circle, PANDA_HOME, 1.5)[0][::20]:
        assert np.all(segment.qd[-1] == 0.0)
        assert np.all(segment.qdd[-1] == 0.0)
        assert np.all(np.abs(segment.qdd) <= replanner.limits[3])
        assert segment.t[-1] - segment.t[0] > replanner.period
        jerk = np.abs(np.diff(segment.qdd, axis=0)) / replanner.cycle
        assert np.all(jerk <= replanner.jerk_limit)


@pytest.mark.parametrize("share", [1.0, 0.3])
def test_jerks_keep_limits_also_where_the_path_jumps(panda: sm.RobotModel, share: float) -> None:
    """Between any two cycles, from the commands alone; without the limit they are exceeded."""
    worst = []
    for limit in (share * panda.jerk_limit, 1e9):
        constraints = [sm.constraints.JointJerkLimits(limit, replace=True)]
        replanner = Replanner(panda, "position", constraints=constraints)
        t, q, qd, commands = 0.0, PANDA_HOME, np.zeros(7), []
        for k in range(60):
            pose = panda.pose(PANDA_HOME)
            pose.translation[1] += 0.05 * (-1.0) ** (k // 10)
            segment = replanner.step(t, q, qd, target=pose)
            t += replanner.period
            now = segment.index(t)
            q, qd = segment.q[now], segment.qd[now]
            commands.append(segment.qdd[:now])
        jerk = np.abs(np.diff(np.concatenate(commands), axis=0)) / replanner.cycle
        worst.append(float((jerk / (share * panda.jerk_limit)).max()))
    assert worst[0] <= 1.0 + 1e-9
    assert worst[1] > 1.0


def test_an_arm_that_moves_at_first_goes_on_from_there(panda: sm.RobotModel) -> None:
    qd = np.array([0.3, -0.2, 0.1, 0.2, 0.0, -0.1, 0.4])
    segment = Replanner(panda).step(
        0.0, PANDA_HOME, qd, sm.paths.Dwell(panda.pose(PANDA_HOME), 1.0)
    )
    assert np.abs(segment.q[0] - PANDA_HOME).max() <= SAME
    assert np.abs(segment.qd[0] - qd).max() <= SAME
    assert np.abs(segment.qdd[0]).max() <= SAME


def test_jerks_that_only_a_long_mean_would_keep_are_refused(panda: sm.RobotModel) -> None:
    limits = sm.constraints.JointJerkLimits(100.0)
    with pytest.raises(sm.errors.ProblemError, match="JointAccelerationLimits of 1 rad/s²"):
        Replanner(panda, constraints=[limits])


def test_the_same_inputs_give_the_same_segments(
    panda: sm.RobotModel, slow_circle: sm.paths.Circle
) -> None:
    runs = [closed_loop(Replanner(panda), slow_circle, PANDA_HOME, 0.3)[1] for _ in range(2)]
    assert np.array_equal(*runs)


@pytest.mark.site
def test_a_closed_loop_costs_little_more_than_planning_all_at_once(panda: sm.RobotModel) -> None:
    # The paper's cost (eq. 12), on a path where the self-motion saves more than 5 %.
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 20.0, normal=(1.0, 0.0, 0.0))
    costs = sm.costs.JointVelocity(), sm.costs.InverseManipulability(mu=0.02)
    full = sm.plan(
        sm.Problem(panda, path, "position", PANDA_HOME, costs=costs, clearance=None)
    ).report
    assert full.cost < 0.95 * full.initial_cost
    replanner = Replanner(panda, "position", costs)
    segments, _ = closed_loop(replanner, path, PANDA_HOME, 20.0)
    count = round(replanner.period / replanner.cycle)
    q = np.concatenate([segment.q[:count] for segment in segments])
    qd = np.concatenate([segment.qd[:count] for segment in segments])
    sampling = sm.model.motion.Sampling.trapezoidal(replanner.cycle * np.arange(len(q)))
    samples = sm.costs.Samples.along(standing(panda, sm.Task.POSITION), sampling, q, qd)
    cost = sum(float(samples.weights @ item.value(samples)) for item in costs)
    assert cost < 1.03 * full.cost
    assert cost < full.initial_cost


# What fails.


def test_a_path_that_fails_is_kept_for_a_while_and_then_the_arm_stops(
    panda: sm.RobotModel, slow_circle: sm.paths.Circle
) -> None:
    replanner = Replanner(panda, patience=0.05)
    segments, _ = closed_loop(replanner, slow_circle, PANDA_HOME, 0.5)
    broken = scenarios.Broken(nan=False)
    t, q = 0.5, segments[-1].q[10]
    flags = []
    for k in range(60):
        segment = replanner.step(t + k * replanner.period, q, np.zeros(7), broken)
        q = segment.q[segment.index(t + (k + 1) * replanner.period)]
        flags.append(segment.flag)
        assert "no camera" in segment.reasons[0]
    assert flags[:4] == [Flag.PLANNED] * 4
    assert flags[6:] == [Flag.STOPPING] * len(flags[6:])
    assert np.all(segment.qd == 0.0)


def test_without_a_plan_the_tool_is_tracked(
    panda: sm.RobotModel, slow_circle: sm.paths.Circle, monkeypatch: pytest.MonkeyPatch
) -> None:
    replanner = Replanner(panda, "position")
    monkeypatch.setattr(replanner._horizon, "improve", scenarios.no_plan(replanner))
    segments, places = closed_loop(replanner, slow_circle, PANDA_HOME, 0.5)
    assert {item.flag for item in segments} == {Flag.TRACKING}
    miss = np.linalg.norm(panda.pose(places[-1]).translation - slow_circle.pose(0.5).translation)
    assert miss < TRACKED


def test_a_cost_that_is_not_finite_is_told_and_the_tool_is_tracked(
    panda: sm.RobotModel, slow_circle: sm.paths.Circle
) -> None:
    cost = sm.costs.FunctionCost(lambda qd, q, t: np.full(len(t), np.nan))
    segments, _ = closed_loop(Replanner(panda, "position", [cost]), slow_circle, PANDA_HOME, 0.1)
    assert {item.flag for item in segments} == {Flag.TRACKING}
    assert all("not finite" in reason for item in segments for reason in item.reasons)


def test_a_late_step_goes_on_from_what_was_commanded_meanwhile(
    panda: sm.RobotModel, slow_circle: sm.paths.Circle
) -> None:
    replanner = Replanner(panda)
    last = closed_loop(replanner, slow_circle, PANDA_HOME, 1.0)[0][-1]
    # When the arm is coming to rest already.
    k = len(last.t) - 4
    segment = replanner.step(last.t[k], last.q[k], np.zeros(7), slow_circle)
    assert np.abs(segment.q[0] - last.q[k]).max() <= SAME
    assert np.array_equal(segment.qdd[0], last.qdd[k])
    assert np.any(segment.qd[0] != 0.0)


def test_an_arm_that_is_elsewhere_than_its_command_stops(
    panda: sm.RobotModel, slow_circle: sm.paths.Circle
) -> None:
    replanner = Replanner(panda)
    closed_loop(replanner, slow_circle, PANDA_HOME, 0.2)
    off = PANDA_HOME + 0.8 * np.eye(7)[0]
    segment = replanner.step(0.2, off, np.zeros(7), slow_circle)
    assert segment.flag is Flag.STOPPING
    assert "panda_joint1" in segment.reasons[0]


def test_time_does_not_go_back(panda: sm.RobotModel, slow_circle: sm.paths.Circle) -> None:
    replanner = Replanner(panda)
    replanner.step(1.0, PANDA_HOME, np.zeros(7), slow_circle)
    with pytest.raises(sm.errors.ProblemError, match=r"t is 0\.5"):
        replanner.step(0.5, PANDA_HOME, np.zeros(7), slow_circle)


# What cannot be kept is refused before the first step.


def no_limits(robot: sm.RobotModel) -> Replanner:
    return Replanner(sm.load_robot("ur5"), "position")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (no_limits, "no limit of speed or acceleration"),
        (
            lambda arm: Replanner(arm, constraints=[sm.constraints.ClosedPath()]),
            "ClosedPath is not kept",
        ),
        (lambda arm: Replanner(arm, period=0.0), "period"),
        (lambda arm: Replanner(arm, steps=3), "steps"),
        (
            lambda arm: Replanner(arm, null_motion=sm.PolynomialNullMotion(space="joint")),
            "expected 'null'",
        ),
    ],
)
def test_what_cannot_be_kept_is_refused(panda: sm.RobotModel, make: object, words: str) -> None:
    with pytest.raises(sm.errors.ProblemError, match=words):
        make(panda)  # type: ignore[operator]


def test_a_first_state_that_cannot_be_stopped_in_time_is_refused(
    panda: sm.RobotModel, slow_circle: sm.paths.Circle
) -> None:
    near = PANDA_HOME.copy()
    near[3] = panda.upper[3] - 0.01
    fast = np.zeros(7)
    fast[3] = 2.0
    with pytest.raises(sm.errors.StartError, match="panda_joint4"):
        Replanner(panda).step(0.0, near, fast, slow_circle)


def test_a_first_state_in_degrees_is_asked_about(
    panda: sm.RobotModel, slow_circle: sm.paths.Circle
) -> None:
    near = PANDA_HOME.copy()
    near[3] = panda.upper[3] + 0.1
    rad = r"is at .* rad, 0 rad/s, from where it cannot stop within .* rad at up to .* rad/s"
    for q, asked in ((np.degrees(PANDA_HOME), True), (near, False)):
        with pytest.raises(sm.errors.StartError, match=rad) as caught:
            Replanner(panda).step(0.0, q, np.zeros(7), slow_circle)
        assert ("in degrees?" in str(caught.value)) is asked


@pytest.mark.parametrize("name", sm.constraints.__all__)
def test_each_constraint_is_kept_or_refused_by_name(panda: sm.RobotModel, name: str) -> None:
    """None is left out in silence: of all that a problem may have."""
    wall = sm.obstacles.Sphere("wall", np.array([0.0, 0.0, 9.0]), 0.1)
    asked = {
        "Band": lambda kind: kind(sm.robot.JointCoordinate("panda_joint2"), 0.0, 1.0),
        "ToolLimits": lambda kind: kind(speed=1.0),
        "Tilt": lambda kind: kind("panda_hand_tcp"),
        "Clearance": lambda kind: kind([wall]),
        "EndConfiguration": lambda kind: kind(PANDA_HOME),
        "PositionDependentVelocityLimits": lambda kind: kind(3.0),
        **{f"{end}{rate}": lambda kind: kind(np.zeros(7)) for end in ("Start", "End")
           for rate in ("Velocity", "Acceleration")},
    }  # fmt: skip
    kind = getattr(sm.constraints, name)
    if not (isinstance(kind, type) and issubclass(kind, sm.constraints.Constraint)):
        return
    if kind is sm.constraints.Constraint:
        return
    item = asked.get(name, lambda kind: kind())(kind)
    if item.kept_moving or is_quantity(item):
        assert Replanner(panda, constraints=[item]).limits.shape == (4, 7)
        return
    with pytest.raises(sm.errors.ProblemError, match=f"{name} is not kept while moving"):
        Replanner(panda, constraints=[item])

"""The loop's laws: viable commands, no jumps, the tool on its path, and what happens when not."""

import gc
import sys
import tracemalloc
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pinocchio as pin
import pytest
from numba.core import event
from scipy.optimize import linprog
from typer.testing import CliRunner

import realtime_scenarios as scenarios
import selfmotion as sm
from selfmotion import realtime
from selfmotion.cli import app
from selfmotion.realtime import Flag, Replanner, Segment, SimulatedArm, State
from selfmotion.realtime.law import brake, saturated_rates
from selfmotion.realtime.viable import (
    advance_state,
    braking_distance,
    fastest,
    tightened,
    viable_box,
)
from selfmotion.testing import check_path

Array = npt.NDArray[np.float64]
# Segments meet in the same numbers, computed in the same way but for one shift of an index.
SAME = 1e-12
# What the tool is off its path without noise or lag: the middle rule's error over cycles of 1 ms.
TRACKED = 1e-5

HOME = np.array(sm.NAMED_ARMS["panda"].home)


@pytest.fixture
def slow_circle(panda: sm.RobotModel) -> sm.Circle:
    return sm.Circle.around(panda.pose(HOME), 0.08, 6.0, normal=(1.0, 0.0, 0.0))


def closed_loop(
    replanner: Replanner, path: sm.Path, start: Array, seconds: float
) -> tuple[list[Segment], Array]:
    """Let the arm do exactly what is commanded; return the segments and q at each step."""
    t, q, qd = 0.0, start, np.zeros(len(start))
    segments, places = [], []
    for _ in range(round(seconds / replanner.period)):
        segment = replanner.step(t, q, qd, path)
        segments.append(segment)
        t += replanner.period
        here = segment.index(t)
        q, qd = segment.q[here], segment.qd[here]
        places.append(q)
    return segments, np.array(places)


# What commands are viable.


def wishes(rng: np.random.Generator, kind: int, hardest: Array) -> Array:
    """Accelerations that nobody should ask for."""
    if kind == 0:
        return 3.0 * hardest * rng.standard_normal(len(hardest))
    if kind == 1:
        return np.full(len(hardest), np.inf)
    if kind == 2:
        return np.full(len(hardest), np.nan)
    return np.asarray(-1e9 * hardest * np.sign(rng.standard_normal(len(hardest))))


def random_limits(rng: np.random.Generator, n: int = 7) -> Array:
    lower, upper = -rng.uniform(0.01, 3.0, n), rng.uniform(0.01, 3.0, n)
    return np.array([lower, upper, rng.uniform(0.1, 3.0, n), rng.uniform(0.5, 20.0, n)])


def beyond(limits: Array, c: Array, w: Array, a: Array) -> float:
    return max(
        float(np.max([limits[0] - c, c - limits[1]])),
        float(np.max(np.abs(w) - limits[2])),
        float(np.max(np.abs(a) - limits[3])),
    )


@pytest.mark.parametrize("seed", range(20))
def test_whatever_is_asked_for_limits_hold_for_ever(seed: int) -> None:
    rng = np.random.default_rng(seed)
    limits, h = random_limits(rng), float(rng.choice([1e-3, 4e-3, 1e-2]))
    inner = tightened(limits)
    c = rng.uniform(limits[0] + 1e-6, limits[1] - 1e-6)
    w, a = np.zeros(7), np.zeros(7)
    kind = 0
    for k in range(4000):
        if k % 50 == 0:
            kind = int(rng.integers(4))
        advance_state(c, w, a, wishes(rng, kind, limits[3]), inner, h)
        assert beyond(limits, c, w, a) <= 0.0


def test_the_law_of_limits_rejects_a_command_that_is_only_clipped() -> None:
    limits = np.array([[-0.5], [0.5], [2.0], [10.0]])
    c, w, worst = np.zeros(1), np.zeros(1), 0.0
    for _ in range(1000):
        a = np.clip((limits[2] - w) / 1e-3, -limits[3], limits[3])
        w += 1e-3 * a
        c += 1e-3 * w
        worst = max(worst, beyond(limits, c, w, a))
    assert worst > 0.1


@pytest.mark.parametrize("seed", range(50))
def test_the_fastest_rate_uses_all_the_room(seed: int) -> None:
    rng = np.random.default_rng(seed)
    room, most, h = 10.0 ** rng.uniform(-8, 1), rng.uniform(0.5, 20.0), 10.0 ** rng.uniform(-3, -2)
    w = fastest(room, most, h)
    # Rounding, where thousands of cycles are added up.
    assert h * w + braking_distance(w, most, h) == pytest.approx(room, rel=1e-9)


def test_a_stop_from_any_viable_state_stays_within_limits() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        limits, h = random_limits(rng), 2e-3
        inner = np.vstack([tightened(limits), np.zeros(7)])
        states = np.zeros((4000, 3, 7))
        c, w, a = states[0]
        c[:] = rng.uniform(limits[0] + 1e-6, limits[1] - 1e-6)
        for _ in range(int(rng.integers(1, 400))):
            advance_state(c, w, a, wishes(rng, 3, limits[3]), inner, h)
        end = brake(states, 0, inner, h)
        assert end < len(states) - 1
        assert np.all(states[end, 1:] == 0.0)
        for k in range(end + 1):
            assert beyond(limits, *states[k]) <= 0.0


def test_rates_are_those_of_eq_4_where_no_bound_is_in_the_way(panda: sm.RobotModel) -> None:
    rng = np.random.default_rng(1)
    for task in ("pose", "position"):
        jacobian = panda.task_jacobian(HOME, task)
        u, epsilon = rng.standard_normal(len(jacobian)), rng.standard_normal(7)
        rates, wide = np.empty(7), np.full(7, 1e3)
        assert saturated_rates(jacobian, u, epsilon, -wide, wide, rates)
        inverse = np.linalg.pinv(jacobian)
        expected = inverse @ u + (np.eye(7) - inverse @ jacobian) @ epsilon
        assert rates == pytest.approx(expected, abs=1e-9)


def test_the_self_motion_gives_before_the_tool_does(panda: sm.RobotModel) -> None:
    rng = np.random.default_rng(2)
    jacobian = np.ascontiguousarray(panda.task_jacobian(HOME, "position"))
    followed = possible = 0
    for _ in range(200):
        u, epsilon = 0.3 * rng.standard_normal(3), 3.0 * rng.standard_normal(7)
        rates, bound = np.empty(7), rng.uniform(0.3, 1.5, 7)
        follows = saturated_rates(jacobian, u, epsilon, -bound, bound, rates)
        assert np.all(np.abs(rates) <= bound + SAME)
        programme = linprog(
            np.zeros(7), A_eq=jacobian, b_eq=u, bounds=np.stack([-bound, bound], axis=1)
        )
        possible += programme.status == 0
        if follows:
            followed += 1
            assert jacobian @ rates == pytest.approx(u, abs=2e-3)
    # One joint after the other is no search over all sets of joints: a few are not found.
    assert possible > 100
    assert followed >= 0.97 * possible


def test_a_box_without_any_acceleration_to_choose_is_no_trouble() -> None:
    low, high = np.empty(1), np.empty(1)
    limits = np.array([[-1.0], [1.0], [1.0], [5.0]])
    viable_box(np.array([1.0]), np.array([0.0]), limits, 1e-3, low, high)
    assert low[0] <= high[0] <= 0.0


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
    path = sm.Circle.around(robot.pose(start), 0.05, 4.0, normal=(1.0, 0.0, 0.0))
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
    panda: sm.RobotModel, slow_circle: sm.Circle
) -> None:
    replanner = Replanner(panda, "position")
    for segment in closed_loop(replanner, slow_circle, HOME, 1.5)[0][::20]:
        assert np.all(segment.qd[-1] == 0.0)
        assert np.all(segment.qdd[-1] == 0.0)
        assert np.all(np.abs(segment.qdd) <= replanner.limits[3])
        assert segment.t[-1] - segment.t[0] > replanner.period


def test_the_same_inputs_give_the_same_segments(
    panda: sm.RobotModel, slow_circle: sm.Circle
) -> None:
    runs = [closed_loop(Replanner(panda), slow_circle, HOME, 0.3)[1] for _ in range(2)]
    assert np.array_equal(*runs)


def test_a_closed_loop_costs_little_more_than_planning_all_at_once(panda: sm.RobotModel) -> None:
    # The paper's cost (eq. 12), on a path where the self-motion saves more than 5 %.
    path = sm.Circle.around(panda.pose(HOME), 0.15, 20.0, normal=(1.0, 0.0, 0.0))
    costs = sm.JointVelocity(), sm.InverseManipulability(mu=0.02)
    full = sm.plan(sm.Problem(panda, path, "position", HOME, costs=costs, collision=None)).report
    assert full.cost < 0.95 * full.initial_cost
    replanner = Replanner(panda, "position", costs)
    segments, _ = closed_loop(replanner, path, HOME, 20.0)
    count = round(replanner.period / replanner.cycle)
    q = np.concatenate([segment.q[:count] for segment in segments])
    qd = np.concatenate([segment.qd[:count] for segment in segments])
    sampling = sm.motion.Sampling.trapezoidal(replanner.cycle * np.arange(len(q)))
    samples = sm.Samples.along(panda, sm.Task.POSITION, sampling, q, qd)
    cost = sum(float(samples.weights @ item.value(samples)) for item in costs)
    assert cost < 1.03 * full.cost
    assert cost < full.initial_cost


@pytest.mark.parametrize("seed", range(12))
def test_random_scenarios_keep_all_laws(panda: sm.RobotModel, seed: int) -> None:
    task = ("pose", "position", "pointing")[seed % 3]
    outcome = scenarios.run(seed, task, panda, Replanner(panda, task))
    assert outcome.faults == []


def test_the_judge_of_scenarios_rejects_a_jump_and_a_broken_limit(
    panda: sm.RobotModel, slow_circle: sm.Circle
) -> None:
    replanner = Replanner(panda)
    arm = SimulatedArm(HOME, replanner.cycle)
    arm.write(replanner.step(0.0, HOME, np.zeros(7), slow_circle))
    arm.run(0.02)
    assert scenarios.limits_broken(replanner, arm) == []
    good = list(arm.commanded)
    q, qd, qdd = good[5]
    arm.commanded[5] = (q + 1e-6, qd, qdd)
    assert "a jump" in scenarios.limits_broken(replanner, arm)[0]
    arm.commanded[5] = (q, qd, 1.01 * replanner.limits[3])
    assert "acceleration beyond its limit" in scenarios.limits_broken(replanner, arm)
    arm.commanded[5] = (np.full(7, np.nan), qd, qdd)
    assert scenarios.limits_broken(replanner, arm) == ["not finite"]


# What fails.


def test_a_path_that_fails_is_kept_for_a_while_and_then_the_arm_stops(
    panda: sm.RobotModel, slow_circle: sm.Circle
) -> None:
    replanner = Replanner(panda, patience=0.05)
    segments, _ = closed_loop(replanner, slow_circle, HOME, 0.5)
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
    panda: sm.RobotModel, slow_circle: sm.Circle, monkeypatch: pytest.MonkeyPatch
) -> None:
    replanner = Replanner(panda, "position")
    monkeypatch.setattr(replanner._horizon, "improve", scenarios.no_plan(replanner))
    segments, places = closed_loop(replanner, slow_circle, HOME, 0.5)
    assert {item.flag for item in segments} == {Flag.TRACKING}
    miss = np.linalg.norm(panda.pose(places[-1]).translation - slow_circle.pose(0.5).translation)
    assert miss < TRACKED


def test_a_cost_that_is_not_finite_is_told_and_the_tool_is_tracked(
    panda: sm.RobotModel, slow_circle: sm.Circle
) -> None:
    cost = sm.FunctionCost(lambda qd, q, t: np.full(len(t), np.nan))
    segments, _ = closed_loop(Replanner(panda, "position", [cost]), slow_circle, HOME, 0.1)
    assert {item.flag for item in segments} == {Flag.TRACKING}
    assert all("not finite" in reason for item in segments for reason in item.reasons)


def test_a_late_step_goes_on_from_what_was_commanded_meanwhile(
    panda: sm.RobotModel, slow_circle: sm.Circle
) -> None:
    replanner = Replanner(panda)
    last = closed_loop(replanner, slow_circle, HOME, 1.0)[0][-1]
    # When the arm is coming to rest already.
    k = len(last.t) - 4
    segment = replanner.step(last.t[k], last.q[k], np.zeros(7), slow_circle)
    assert np.abs(segment.q[0] - last.q[k]).max() <= SAME
    assert np.array_equal(segment.qdd[0], last.qdd[k])
    assert np.any(segment.qd[0] != 0.0)


def test_an_arm_that_is_elsewhere_than_its_command_stops(
    panda: sm.RobotModel, slow_circle: sm.Circle
) -> None:
    replanner = Replanner(panda)
    closed_loop(replanner, slow_circle, HOME, 0.2)
    off = HOME + 0.8 * np.eye(7)[0]
    segment = replanner.step(0.2, off, np.zeros(7), slow_circle)
    assert segment.flag is Flag.STOPPING
    assert "panda_joint1" in segment.reasons[0]


def no_limits(robot: sm.RobotModel) -> Replanner:
    return Replanner(sm.load_robot("ur5"), "position")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (no_limits, "no limit of speed or acceleration"),
        (lambda arm: Replanner(arm, constraints=[sm.ClosedPath()]), "ClosedPath is not kept"),
        (lambda arm: Replanner(arm, period=0.0), "period"),
        (lambda arm: Replanner(arm, steps=3), "steps"),
        (
            lambda arm: Replanner(arm, null_motion=sm.PolynomialNullMotion(space="joint")),
            "expected 'null'",
        ),
    ],
)
def test_what_cannot_be_kept_is_refused(panda: sm.RobotModel, make: object, words: str) -> None:
    with pytest.raises(sm.ProblemError, match=words):
        make(panda)  # type: ignore[operator]


def test_a_first_state_that_cannot_be_stopped_in_time_is_refused(
    panda: sm.RobotModel, slow_circle: sm.Circle
) -> None:
    near = HOME.copy()
    near[3] = panda.upper[3] - 0.01
    fast = np.zeros(7)
    fast[3] = 2.0
    with pytest.raises(sm.StartError, match="panda_joint4"):
        Replanner(panda).step(0.0, near, fast, slow_circle)


def test_time_does_not_go_back(panda: sm.RobotModel, slow_circle: sm.Circle) -> None:
    replanner = Replanner(panda)
    replanner.step(1.0, HOME, np.zeros(7), slow_circle)
    with pytest.raises(sm.ProblemError, match=r"t is 0\.5"):
        replanner.step(0.5, HOME, np.zeros(7), slow_circle)


# Obstacles that move.


def beside_the_elbow(panda: sm.RobotModel) -> Array:
    data = panda.model.createData()
    pin.forwardKinematics(panda.model, data, HOME)
    return np.array(data.oMi[4].translation + np.array([0.0, 0.3, 0.0]))


def test_a_ball_that_comes_near_is_avoided_by_the_self_motion(panda: sm.RobotModel) -> None:
    first = beside_the_elbow(panda)
    clearance = sm.Clearance([sm.Sphere("ball", first, 0.06)], distance=0.005)
    replanner = Replanner(panda, constraints=[clearance])
    hold = sm.Dwell(panda.pose(HOME), 100.0)
    t, q = 0.0, HOME
    nearest = np.inf
    for _ in range(300):
        # Through where the elbow is now, at 5 cm/s.
        place = pin.SE3(np.eye(3), first - [0.0, 0.05 * t, 0.0])
        segment = replanner.step(t, q, np.zeros(7), hold, {"ball": place})
        t += replanner.period
        q = segment.q[segment.index(t)]
        ball = sm.CollisionModel(panda, [sm.Sphere("ball", place, 0.06)])
        if round(t / replanner.period) % 20 == 0:
            nearest = min(nearest, ball.distance(q).value)
    assert np.abs(q - HOME).max() > 0.1
    assert nearest > 0.0
    miss = sm.Task.POSE.miss(hold.pose(0.0), panda.pose(q))
    assert max(miss) < TRACKED


def test_where_no_self_motion_helps_the_arm_stops_before_the_obstacle(
    panda: sm.RobotModel,
) -> None:
    pose = panda.pose(HOME)
    ahead = pin.SE3(np.eye(3), pose.translation + np.array([0.0, 0.3, 0.0]))
    clearance = sm.Clearance([sm.Sphere("ball", ahead, 0.05)], distance=0.01)
    replanner = Replanner(panda, constraints=[clearance])
    goal = pin.SE3(pose.rotation, pose.translation + np.array([0.0, 0.3, 0.0]))
    path = sm.Line(pose, goal, 2.0, time_law="minimum_jerk")
    segments, places = closed_loop(replanner, path, HOME, 2.5)
    exact = sm.CollisionModel(panda, clearance.obstacles)
    assert min(exact.distance(q).value for q in places[::10]) > 0.0
    assert segments[-1].flag is Flag.STOPPING
    assert "ball" in segments[-1].reasons[-1]
    # It goes on when the way is free.
    t, q = 2.5, places[-1]
    for _ in range(250):
        free = {"ball": pin.SE3(np.eye(3), np.array([0.0, 0.0, 9.0]))}
        segment = replanner.step(t, q, np.zeros(7), path, free)
        t += replanner.period
        q = segment.q[segment.index(t)]
    assert sm.Task.POSE.miss(goal, panda.pose(q))[0] < 1e-4


def test_an_obstacle_that_is_not_known_is_refused(
    panda: sm.RobotModel, slow_circle: sm.Circle
) -> None:
    clearance = sm.Clearance([sm.Sphere("ball", np.array([0.0, 0.0, 9.0]), 0.05)])
    replanner = Replanner(panda, constraints=[clearance])
    with pytest.raises(sm.ProblemError, match="'bal'"):
        replanner.step(0.0, HOME, np.zeros(7), slow_circle, {"bal": pin.SE3.Identity()})


# Around the loop.


def test_after_warming_up_nothing_is_compiled_and_no_memory_grows(
    panda: sm.RobotModel, slow_circle: sm.Circle
) -> None:
    class Compiled(event.Listener):  # type: ignore[misc]
        count = 0

        def on_start(self, event: object) -> None:
            self.count += 1

        def on_end(self, event: object) -> None:
            pass

    replanner = Replanner(panda, "position")
    realtime.warm_up(replanner)
    listener = Compiled()
    with event.install_listener("numba:compile", listener):
        segments, _ = closed_loop(replanner, slow_circle, HOME, 0.3)
        del segments
        tracemalloc.start()
        try:
            t, q, sizes = 0.3, HOME, []
            for k in range(300):
                segment = replanner.step(t, q, np.zeros(7), slow_circle)
                t += replanner.period
                q = segment.q[segment.index(t)]
                if k % 100 == 99:
                    gc.collect()
                    sizes.append(tracemalloc.get_traced_memory()[0])
        finally:
            tracemalloc.stop()
    assert listener.count == 0
    # Less is left behind than the smallest of a step's arrays would be; Python's free lists fill.
    assert sizes[-1] - sizes[0] < 200 * sys.getsizeof(np.zeros(7))


def test_the_loop_reads_until_there_is_no_state(
    panda: sm.RobotModel, slow_circle: sm.Circle
) -> None:
    replanner = Replanner(panda)
    arm, written = SimulatedArm(HOME, replanner.cycle), []

    def read() -> State | None:
        return State(arm.t, *arm.measure(), slow_circle) if len(written) < 5 else None

    def write(segment: Segment) -> None:
        written.append(segment)
        arm.write(segment)
        arm.run(replanner.period)

    assert realtime.follow(replanner, read, write) == 5
    assert [item.t[0] for item in written] == pytest.approx([0.0, 0.01, 0.02, 0.03, 0.04])
    with pytest.raises(sm.ProblemError, match="expected State or None"):
        realtime.follow(replanner, lambda: 1, write)  # type: ignore[arg-type, return-value]


def test_a_conveyed_path_is_a_path(panda: sm.RobotModel, slow_circle: sm.Circle) -> None:
    check_path(realtime.Conveyed(slow_circle, (0.1, 0.0, 0.02), (0.0, 0.3, 0.0)))


def test_a_simulated_arm_wants_a_segment() -> None:
    with pytest.raises(sm.ProblemError, match="no segment"):
        SimulatedArm(HOME, 1e-3).run(0.1)


def test_the_command_writes_replay_plan_and_histogram(tmp_path: Path) -> None:
    shown = CliRunner().invoke(app, ["track", "--seconds", "1.2", "--out", str(tmp_path)])
    assert shown.exit_code == 0, shown.output
    assert "120, every 10 ms" in shown.output
    for name in ("track.html", "track.npz", "latency.png"):
        assert (tmp_path / name).stat().st_size > 1000
    assert "keeps up with a circle on a conveyor" in (tmp_path / "track.html").read_text()
    plan = sm.load_plan(tmp_path / "track.npz")
    assert plan.trajectory.duration == pytest.approx(1.19)

"""The fastest motion: never slower than x = 0 at its fastest, all limits kept, none left unused."""

import dataclasses
import time
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.planning.planner.cost_limits import CostLimits
from support.arms import PANDA_HOME, robot_named

# What the fastest motion uses of a limit somewhere at all times but where the jerk takes over, by
# the number of samples.
BUSY = 0.6
# A cost that is kept, and to which share two integrals of it agree.
KEPT, SAME = 1.005, 1e-4
# Windows begin and end this near to where they did [m], between samples of the pace.
NEAR = 1e-4


@pytest.fixture(scope="module")
def found() -> sm.Fastest:
    panda = robot_named("panda")
    start = panda.pose(PANDA_HOME)
    end = pin.SE3(start.rotation, start.translation + np.array([-0.1, 0.25, 0.15]))
    return sm.fastest(sm.Problem(panda, sm.paths.Line(start, end, 2.0), start=PANDA_HOME))


def test_it_is_faster_than_the_pseudo_inverse_and_keeps_all_limits(found: sm.Fastest) -> None:
    assert found.plan.certificate.verified, found.plan.certificate.verdict
    assert {"speeds", "accelerations", "jerks"} <= set(found.plan.certificate.covers)
    assert found.duration <= found.pseudo_inverse
    assert found.duration < 0.99 * found.pseudo_inverse
    assert list(found.times) == sorted(found.times, reverse=True)
    assert found.times[-1] == found.duration
    assert np.abs(found.plan.trajectory.qd[[0, -1]]).max() <= 1e-9


def test_limits_are_used(found: sm.Fastest) -> None:
    robot, motion = found.plan.robot, found.plan.trajectory
    t = np.linspace(0.0, found.duration, 2001)
    used = np.maximum(
        np.abs(motion(t, 1)) / robot.velocity_limit, np.abs(motion(t, 2)) / robot.acceleration_limit
    ).max(axis=1)
    assert used.max() <= 1.0
    assert np.mean(used > 0.9) > BUSY


def test_the_tool_follows_the_same_line(found: sm.Fastest) -> None:
    robot, motion = found.plan.robot, found.plan.trajectory
    places = np.array(
        [robot.pose(q).translation for q in motion(np.linspace(0, found.duration, 99))]
    )
    line = places[-1] - places[0]
    off = np.cross(places - places[0], line / np.linalg.norm(line))
    assert np.abs(off).max() <= 1e-6


def test_arms_and_paths_without_a_fastest_pace(panda: sm.RobotModel) -> None:
    start = panda.pose(PANDA_HOME)
    baxter = robot_named("baxter")
    pose = baxter.dexterous_configuration()
    path = sm.paths.Circle.around(baxter.pose(pose), 0.05, 2.0)
    with pytest.raises(
        sm.errors.ProblemError, match=r"no limit of acceleration is known .* give accel"
    ):
        sm.fastest(sm.Problem(baxter, path, start=pose))
    away = pin.SE3(start.rotation, start.translation + np.array([1.5, 0.0, 0.0]))
    # The reason is where it ends, and nothing of how fast it would be.
    told = r"no motion keeps all limits at any pace: the motion ends at [^;]*$"
    with pytest.raises(sm.errors.PlanError, match=told):
        sm.fastest(sm.Problem(panda, sm.paths.Line(start, away, 4.0), start=PANDA_HOME))
    with pytest.raises(sm.errors.ProblemError, match="problem is 1, expected a Problem"):
        sm.fastest(1)


def slow_line() -> sm.Problem:
    panda = robot_named("panda")
    start = panda.pose(PANDA_HOME)
    end = pin.SE3(start.rotation, start.translation + np.array([-0.1, 0.2, 0.1]))
    return sm.Problem(panda, sm.paths.Line(start, end, 2.0), start=PANDA_HOME)


def test_it_is_no_slower_than_the_motion_that_is_best_by_the_costs(found: sm.Fastest) -> None:
    problem = dataclasses.replace(
        found.plan.problem,
        path=slow_line().path,
        constraints=(sm.constraints.JointPositionLimits(),),
    )
    assert found.duration <= found.retimed < np.inf
    assert found.status is sm.optimise.Status.CONVERGED
    assert found.plan.limits_used.busy > 0.9
    slow = sm.plan(problem)
    assert slow.limits_used.busy < 0.1


def test_costs_are_kept_at_the_time_law_of_the_path() -> None:
    """No cheaper than asked, no slower than retiming; what nothing costs is named."""
    problem = slow_line()
    best, cost = sm.plan(problem), sm.costs.JointVelocity()
    limits = CostLimits.of(problem, {cost.kind: KEPT})

    def twice(stage: str, done: int, total: int) -> None:
        if stage == "fastest" and done == 2:
            raise KeyboardInterrupt

    found = sm.fastest(problem, keep={cost.kind: KEPT}, progress=twice)
    assert limits.values(best) == pytest.approx(best.report.cost, rel=SAME)
    assert limits.values(found.plan) <= KEPT * best.report.cost * (1.0 + SAME)
    assert found.duration <= found.retimed
    # At another pace the same joint path costs the same.
    assert limits.values(sm.retime(best)) == pytest.approx(best.report.cost, rel=SAME)
    with pytest.raises(sm.errors.ProblemError, match="no cost 'PathLength', but JointVelocity"):
        sm.fastest(problem, keep={"PathLength": 1.1})
    with pytest.raises(sm.errors.ProblemError, match="keep: JointVelocity"):
        sm.fastest(problem, keep={"JointVelocity": 0.9})


def test_an_interruption_and_a_deadline_keep_the_best_so_far(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupting(stage: str, done: int, total: int) -> None:
        if stage == "fastest":
            raise KeyboardInterrupt

    stopped = sm.fastest(slow_line(), progress=interrupting)
    assert stopped.status is sm.optimise.Status.INTERRUPTED
    assert stopped.plan.certificate.verified
    assert stopped.times == ()
    assert stopped.duration == min(stopped.retimed, stopped.pseudo_inverse)

    clock, real = [0.0], time.perf_counter
    monkeypatch.setattr(time, "perf_counter", lambda: real() + clock[0])

    def late(stage: str, done: int, total: int) -> None:
        clock[0] += 100.0 * (stage == "fastest")

    out = sm.fastest(slow_line(), deadline=90.0, progress=late)
    assert out.status is sm.optimise.Status.DEADLINE
    assert out.plan.certificate.verified
    with pytest.raises(
        sm.errors.PlanError, match="no motion keeps all limits at any pace in 1e-06 s"
    ):
        sm.fastest(slow_line(), deadline=1e-6)


def test_a_file_may_ask_for_the_fastest_motion(tmp_path: Path) -> None:
    file = tmp_path / "line.toml"
    sm.files.write_problem(slow_line(), file)
    text = file.read_text(encoding="utf-8")
    file.write_text(f'goal = "fastest"\n{text}', encoding="utf-8")
    job = sm.files.read_job(file)
    assert job.goal == "fastest"

    def interrupting(stage: str, done: int, total: int) -> None:
        if stage == "fastest":
            raise KeyboardInterrupt

    assert job.plan(progress=interrupting).path.duration < 1.0
    kept = dataclasses.replace(job, keep={"JointVelocity": 1.1})
    sm.files.write_problem(kept, file)
    assert sm.files.read_job(file).keep == kept.keep
    file.write_text(f'goal = "fastest"\nmax_evaluations = 3\n{text}', encoding="utf-8")
    with pytest.raises(
        sm.errors.ProblemError, match="max_evaluations: has no effect on the fastest"
    ):
        sm.files.read_job(file).plan()
    file.write_text(f'goal = "quick"\n{text}', encoding="utf-8")
    with pytest.raises(sm.errors.FileFormatError, match="goal"):
        sm.files.read_job(file)


def test_windows_of_relaxations_stay_where_they_are_on_the_path() -> None:
    robot, start, window = robot_named("planar_3r"), np.array([0.2, 1.2, 0.9]), (1.0, 2.0)
    pose = robot.pose(start)
    there = pin.SE3(pose.rotation, pose.translation + np.array([-0.06, 0.06, 0.0]))
    line = sm.paths.Line(pose, there, 3.0)
    asked = sm.Problem(
        robot,
        line,
        "planar_pose",
        start,
        relaxations=[sm.Relaxation("rz", 0.3, during=window)],
        clearance=None,
    )

    def enough(stage: str, done: int, _: int) -> None:
        if (stage, done) == ("fastest", 2):
            raise KeyboardInterrupt

    # The second round is the first one at another pace.
    found = sm.fastest(asked, acceleration=4.0, velocity=1.0, progress=enough)
    assert len(found.times) == 2
    assert found.plan.certificate.verified
    assert found.duration <= found.retimed
    (moved,) = found.plan.problem.relaxations
    for new, old in zip(moved.during, window, strict=True):
        np.testing.assert_allclose(
            found.plan.path.pose(new).translation, line.pose(old).translation, atol=NEAR
        )


@pytest.mark.site
def test_a_pace_that_no_smooth_one_is_near_ends_the_rounds() -> None:
    """The quintic through it would turn back: what was found by then is the motion."""
    panda = robot_named("panda")
    start = panda.dexterous_configuration()
    circle = sm.paths.Circle.around(panda.pose(start), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    found = sm.fastest(sm.Problem(panda, circle, "position", start))
    assert found.plan.certificate.verified
    assert found.duration <= found.pseudo_inverse

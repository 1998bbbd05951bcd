"""Paths that the arm cannot follow to the end: the largest part, where it ends, and why."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Counts
from selfmotion.model.follow import Follows
from selfmotion.model.motion import Grid
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.planner.effort import Effort
from selfmotion.planning.planner.guess import Guess
from selfmotion.planning.planner.largest_part import Part, shorter_part
from selfmotion.planning.planner.solution import Solution
from selfmotion.planning.rollout import Rollout, converged_minimum_norm
from selfmotion.shell.replay import write_replay
from support.arms import PANDA_HOME, robot_named

# The end of a part that only the workspace limits, relative to the closed form.
EDGE = 1e-3


# A part ends so much before a motion that is known to keep its limits, at most: where bisections
# end.
SHORT_OF = 0.8
# Where limits are kept with a margin, and the end is bisected, besides.
LIMITED = 5e-3


def outward(planar: sm.RobotModel, factor: float, duration: float = 10.0) -> sm.paths.Line:
    """Return a line in the plane straight away from the base, from a distance of 4.66 m."""
    pose = planar.pose([0.0, 0.5, 0.5])
    end = pose.copy()
    end.translation = pose.translation * factor
    return sm.paths.Line(pose, end, duration, time_law="constant")


def time_at(line: sm.paths.Line, distance: float) -> float:
    """Return when a line straight away from the base is at a distance from it, in closed form."""
    first, last = (np.linalg.norm(line.pose(t).translation) for t in (0.0, line.duration))
    return float((distance - first) / (last - first) * line.duration)


@pytest.fixture(scope="module")
def overlong() -> sm.Plan:
    planar = sm.load_robot("planar_3r")
    return sm.plan(sm.Problem(planar, outward(planar, 1.5), "planar", [0.0, 0.5, 0.5]))


def check_part(plan: sm.Plan, edge: float) -> None:
    end = plan.trajectory.t[-1]
    assert end < edge
    certificate = plan.certificate
    assert not certificate.verified
    (failure,) = certificate.failures
    assert f"the motion ends at t = {end:.6g} s of {plan.path.duration:.6g} s" in failure
    assert failure in certificate.verdict
    assert failure in plan.report.message
    assert certificate.position_error.value <= 1e-6
    assert certificate.rotation_error.value <= 1e-6
    assert certificate.limit_margin.value >= 0.0
    assert certificate.velocity_ratio.value <= 1.0
    with pytest.raises(sm.errors.PlanError, match="the motion ends at"):
        plan.require()


def test_a_line_that_leaves_the_workspace(overlong: sm.Plan) -> None:
    """The arm is stretched at 5 m: the motion ends there, within the law, and never beyond."""
    edge = time_at(outward(overlong.robot, 1.5), 5.0)
    check_part(overlong, edge)
    assert overlong.trajectory.t[-1] > (1.0 - EDGE) * edge
    for words in ("the pose is out of reach", "stretched", "misses it by up to 1.99e+03 mm"):
        assert words in overlong.certificate.verdict
    np.testing.assert_array_equal(overlong.trajectory.q[0], [0.0, 0.5, 0.5])
    assert overlong.report.cost < overlong.report.initial_cost


def test_a_free_start_gets_as_far_and_cheaper(overlong: sm.Plan) -> None:
    free = sm.plan(sm.Problem(overlong.robot, overlong.path, "planar"))
    edge = time_at(outward(overlong.robot, 1.5), 5.0)
    check_part(free, edge)
    assert free.trajectory.t[-1] > (1.0 - EDGE) * edge
    assert free.report.cost <= overlong.report.cost * (1.0 + 1e-3)


def test_speed_limits_end_it_earlier_and_are_named(planar: sm.RobotModel) -> None:
    """Towards the edge joint speeds grow without bound."""
    line = outward(planar, 1.5, 1.0)
    plan = sm.plan(sm.Problem(planar, line, "planar", [0.0, 0.5, 0.5]))
    check_part(plan, time_at(line, 5.0))
    assert plan.certificate.velocity_ratio.value > 0.9
    for words in (
        "the next longer motion fails: joint velocity limits",
        "the pose is out of reach",
    ):
        assert words in plan.certificate.verdict


def test_joint_limits_bound_the_workspace(planar: sm.RobotModel) -> None:
    """With an elbow bent by 0.5 at least, links of 2, 2 and 1 m reach 4 cos(0.25) + 1 m."""
    line = outward(planar, 1.06)
    limits = sm.constraints.JointPositionLimits([-6.0, 0.5, -6.0], [6.0, 3.0, 6.0])
    problem = sm.Problem(
        planar,
        line,
        "planar",
        [0.0, 0.5, 0.5],
        constraints=[limits, sm.constraints.JointVelocityLimits()],
    )
    start = planar.inverse_kinematics(line.pose(0.0), "planar", seed=[0.0, 0.8, 0.1])
    plan = sm.plan(dataclasses.replace(problem, start=start))
    edge = time_at(line, 4.0 * np.cos(0.25) + 1.0)
    check_part(plan, edge)
    assert plan.trajectory.t[-1] > (1.0 - LIMITED) * edge
    assert "at its limit: joint 'joint2'" in plan.certificate.verdict


@pytest.mark.parametrize(("task", "free"), [("position", False), ("pose", True)])
def test_a_panda_beyond_its_reach(task: str, free: bool) -> None:
    panda = robot_named("panda")
    start = panda.dexterous_configuration(task)
    end = panda.pose(start)
    end.translation = 1.8 * end.translation
    line = sm.paths.Line(panda.pose(start), end, 4.0)
    plan = sm.plan(sm.Problem(panda, line, task, None if free else start))
    last = plan.trajectory.t[-1]
    assert last > 0.8
    check_part(plan, 4.0)
    with pytest.raises(sm.errors.InverseKinematicsError):
        panda.inverse_kinematics(line.pose(1.2 * last), task)


def test_limits_that_are_not_asked_for_are_kept_and_cut_nothing_off(planar: sm.RobotModel) -> None:
    """No motion beyond the URDF's is verified; where there is no other, it is of the whole path."""
    start = np.array([planar.lower[0] + 0.01, planar.lower[1] + 0.5, planar.lower[2] + 0.5])
    circle = sm.paths.Circle.around(planar.pose(start), 1.0, 4.0)
    kept = sm.plan(sm.Problem(planar, circle, "planar", start, constraints=[]))
    assert kept.certificate.verified, kept.certificate.verdict
    narrow = dataclasses.replace(planar, lower=start - 0.02, upper=start + 0.02)
    plan = sm.plan(sm.Problem(narrow, circle, "planar", start, constraints=[]))
    assert plan.certificate.limit_margin.value < 0.0
    assert "joint position limits" in plan.report.message
    assert plan.trajectory.t[-1] == 4.0


def test_parts_survive_the_disk_and_stay_parts(overlong: sm.Plan, tmp_path: Path) -> None:
    file = tmp_path / "plan.npz"
    overlong.save(file)
    again = sm.load_plan(file)
    assert again.certificate == overlong.certificate
    assert again.check() == overlong.certificate
    assert again.path.duration == 10.0
    assert not sm.retime(again, 50.0).certificate.verified
    assert write_replay(again, tmp_path / "replay.html").is_file()


def test_another_null_motion_where_x_0_breaks_down(planar: sm.RobotModel) -> None:
    """A start that x = 0 takes into the folded pose at 3 m, where the tool cannot go further out.

    Found backwards: from beside that pose, inward. Other null motions pass it by.
    """
    beside = np.array([0.0, 1e-3, np.pi])
    here = planar.pose(beside)
    inner, outer = here.copy(), here.copy()
    inner.translation, outer.translation = here.translation * 0.8, here.translation * 1.3
    inward = sm.paths.Line(here, inner, 1.0)
    back = Rollout(Follows.of(planar, inward, sm.Task.PLANAR), Grid.aligned(inward.knots, 8000))
    assert back.run(beside, np.zeros((32001, 3))) is None
    start = planar.inverse_kinematics(inner, "planar", seed=back.samples().q[-1])
    line = sm.paths.Line(inner, outer, 4.0)
    problem = sm.Problem(planar, line, "planar", start)
    with pytest.raises(sm.errors.BreakdownError):
        converged_minimum_norm(Formulation.of(problem), start)
    plan = sm.plan(problem)
    assert plan.certificate.verified
    assert plan.trajectory.t[-1] == line.duration


def test_without_a_part_the_errors_stay(planar: sm.RobotModel) -> None:
    start = [0.0, 0.02, 0.02]
    pose = planar.pose(start)
    end = pose.copy()
    end.translation = pose.translation * 1.5
    with pytest.raises(
        sm.errors.BreakdownError,
        match=r"out of reach.*; and of the path before that no part was found",
    ):
        sm.plan(
            sm.Problem(planar, sm.paths.Line(pose, end, 1.0, time_law="constant"), "planar", start)
        )
    far = end.copy()
    far.translation = pose.translation * 2.0
    with pytest.raises(sm.errors.InverseKinematicsError, match="move the pose into the workspace"):
        sm.plan(sm.Problem(planar, sm.paths.Line(end, far, 1.0), "planar"))


def test_an_interruption_keeps_the_part_so_far(planar: sm.RobotModel) -> None:
    def interrupt(step: sm.optimise.Iteration) -> None:
        if step.evaluations >= 3:
            raise KeyboardInterrupt

    problem = sm.Problem(planar, outward(planar, 1.5), "planar", [0.0, 0.5, 0.5])
    plan = sm.plan(problem, callback=interrupt)
    assert plan.report.status is sm.optimise.Status.INTERRUPTED
    assert "the motion ends at" in plan.certificate.verdict


def test_conditions_on_the_end_do_not_bind_a_part(planar: sm.RobotModel) -> None:
    constraints = [sm.constraints.JointPositionLimits(), sm.constraints.EndVelocity(0.1)]
    line = outward(planar, 1.5)
    problem = sm.Problem(planar, line, "planar", [0.0, 0.5, 0.5], constraints=constraints)
    plan = sm.plan(problem)
    assert plan.trajectory.t[-1] > (1.0 - EDGE) * time_at(line, 5.0)
    assert "off the one asked for" in plan.certificate.verdict


def test_an_excursion_between_the_poses_looked_at_is_found(planar: sm.RobotModel) -> None:
    """A circle that is out of reach for a sixtieth of its time, by 2 mm."""
    pose = np.eye(4)
    pose[0, 3] = 4.002
    centre, axis = np.array([4.502, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    circle = sm.paths.Circle(pose, centre, axis, 4.0, turns=1.013)
    start = planar.inverse_kinematics(circle.pose(0.0), "planar")
    plan = sm.plan(sm.Problem(planar, circle, "planar", start))
    times = np.linspace(0.0, 4.0, 400_001)
    beyond = np.linalg.norm(circle.samples(times).translation, axis=1) > 5.0
    edge = float(times[np.argmax(beyond)])
    check_part(plan, edge)
    assert plan.trajectory.t[-1] > (1.0 - EDGE) * edge
    assert "the pose is out of reach" in plan.certificate.verdict


@pytest.mark.parametrize("given", [True, False], ids=["given start", "free start"])
def test_poses_that_limits_put_out_of_reach_end_the_search(
    planar: sm.RobotModel, given: bool
) -> None:
    """An arm that may not fold: where its tool is nearest to the base is known in closed form."""
    most, start = 1.2, np.array([-0.75, 0.9, 0.6])
    first = planar.pose(start)
    last = first.copy()
    last.translation = 0.25 * first.translation
    line = sm.paths.Line(first, last, 3.0)
    limits = sm.constraints.JointPositionLimits(np.full(3, -most), np.full(3, most))
    stages: list[str] = []
    news: list[str] = []

    def progress(told: str, number: int, of: int) -> None:
        (stages if of else news).append(told)
        # What is known is told before anything is planned.
        assert given or news

    plan = sm.plan(
        sm.Problem(planar, line, "planar", start if given else None, constraints=[limits]),
        progress=progress,
    )
    assert [told.startswith("no motion passes t = 3 s: none was found") for told in news] == (
        [] if given else [True]
    )
    lengths = [np.linalg.norm(place.translation) for place in planar.model.jointPlacements][2:]
    lengths.append(np.linalg.norm(planar.model.frames[planar.chain.tip].placement.translation))
    folded = sum(length * np.exp(1j * most * k) for k, length in enumerate(lengths))
    times = np.linspace(0.0, 3.0, 300_001)
    beyond = np.linalg.norm(line.samples(times).translation, axis=1) < abs(folded)
    edge = float(times[np.argmax(beyond)])
    check_part(plan, edge)
    assert plan.trajectory.t[-1] > (1.0 - LIMITED) * edge
    told = re.search(r"from t = ([\d.]+) s on the pose is out of reach", plan.certificate.verdict)
    assert told is not None
    assert float(told[1]) == pytest.approx(edge, rel=EDGE)
    assert "at its limit: joint 'joint2', 'joint3'" in plan.certificate.verdict
    assert not any(stage.startswith("search") for stage in stages)


@pytest.mark.site
def test_how_far_it_goes_does_not_depend_on_where_the_cell_is(panda: sm.RobotModel) -> None:
    """The same problem with the base turned by next to nothing: limits of all rates bind."""
    home = panda.pose(PANDA_HOME)
    end = home.copy()
    end.translation += [0.7, 0.1, 0.2]
    line = sm.paths.Line(home, end, 1.6)
    limits = [
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
        sm.constraints.JointAccelerationLimits(),
        sm.constraints.JointJerkLimits(),
    ]
    ends = []
    for angle in (0.0, 1e-6):
        base = pin.SE3(pin.exp3(np.array([0.0, 0.0, angle])), np.zeros(3))
        robot = sm.load_robot("panda", base=base) if angle else panda
        path = sm.paths.Placed(line, base)
        problem = sm.Problem(robot, path, "pose", PANDA_HOME, constraints=limits, clearance=None)
        plan = sm.plan(problem)
        # Nothing else is wrong with it.
        (failure,) = plan.certificate.failures
        assert "the motion ends at" in failure
        ends.append(plan.trajectory.t[-1])
    assert max(ends) - min(ends) < 2.0 * LIMITED * max(ends), ends


def test_a_part_of_some_hundredths_of_a_second_is_found(panda: sm.RobotModel) -> None:
    """A line of which accelerations are kept for a moment only, with limits of jerk as well."""
    home, end = panda.pose(PANDA_HOME), panda.pose(PANDA_HOME)
    end.translation += [0.7, 0.1, 0.2]
    line = sm.paths.Line(home, end, 0.9)
    limits = [sm.constraints.JointAccelerationLimits(), sm.constraints.JointJerkLimits()]
    problem = sm.Problem(panda, line, "pose", PANDA_HOME, constraints=limits, clearance=None)
    plan = sm.plan(problem)
    (failure,) = plan.certificate.failures
    assert "the motion ends at" in failure
    # The motion of the least speeds, step by step, until it accelerates too fast.
    q, step, speeds = PANDA_HOME.copy(), 1e-4, [np.zeros(7)]
    while True:
        t = len(speeds) * step
        speeds.append(np.linalg.pinv(panda.task_jacobian(q, "pose")) @ line.twist(t))
        if (np.abs(speeds[-1] - speeds[-2]) > step * panda.acceleration_limit).any():
            break
        q += step * speeds[-1]
    assert 0.02 < t < plan.trajectory.t[-1] / SHORT_OF


def test_a_long_wait_after_it_takes_nothing_from_a_part(planar: sm.RobotModel) -> None:
    line = outward(planar, 1.5, 2.0)
    far = sm.paths.Line(line.start, line.end, 2.0)
    alone, waiting = (
        sm.plan(sm.Problem(planar, path, "planar", [0.0, 0.5, 0.5]))
        for path in (far, far + sm.paths.Dwell(line.end, 600.0))
    )
    assert waiting.trajectory.t[-1] == pytest.approx(alone.trajectory.t[-1], rel=LIMITED)


def test_an_end_always_has_a_reason(planar: sm.RobotModel) -> None:
    """Also where a longer motion was found, which no finer grid would keep."""
    problem = Formulation.of(sm.Problem(planar, outward(planar, 1.01), "planar", [0.0, 0.5, 0.5]))
    effort = Effort(None, None, 20, Counts())
    guess = Guess.of(problem, effort, np.array([0.0, 0.5, 0.5]), free=False)
    shorter = shorter_part(problem, Part(problem, Solution.of(guess)), effort)
    assert shorter is not None
    assert re.search(r"the motion ends at t = 9.8 s of 10 s: \w", shorter.ending)

"""Rest to rest: where the tool rests at an end, so does the arm."""

import dataclasses

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.certificate import AtRest
from selfmotion.problem.problem import rest_orders, times_along
from support.arms import PANDA_HOME, robot_named, short_line, start_of

# At rest by construction: what is left is the rounding of the path's own twist.
REST = 1e-9


def circle(robot: sm.RobotModel, start: np.ndarray, law: str = "minimum_jerk") -> sm.paths.Circle:
    return sm.paths.Circle.around(
        robot.pose(start), 0.06, 4.0, normal=(1.0, 0.0, 0.0), time_law=law
    )


@pytest.mark.parametrize("name", ["panda", "xarm7", "tiago", "planar_3r"])
@pytest.mark.parametrize("free", [False, True])
def test_an_arm_rests_where_its_tool_does(name: str, free: bool) -> None:
    robot = robot_named(name)
    task = "planar" if name == "planar_3r" else "pose"
    start = start_of(robot, task)
    path = short_line(robot, start)
    costs = [sm.costs.JointVelocity(), sm.costs.InverseManipulability(0.1)]
    plan = sm.plan(sm.Problem(robot, path, task, None if free else start, costs=costs))
    assert plan.certificate.verified, plan.certificate.verdict
    assert "rest at both ends" in plan.certificate.covers
    ends = plan.trajectory.t[[0, -1]]
    assert np.abs(plan.trajectory(ends, 1)).max() <= REST
    # The tool does not accelerate either, so that the arm's acceleration begins at 0.
    fastest = np.abs(plan.trajectory.extremes(2)[1]).max()
    assert np.abs(plan.trajectory(ends, 2)).max() <= 1e-2 * fastest


def test_rest_costs_little(panda: sm.RobotModel) -> None:
    wide = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    problem = sm.Problem(panda, wide, start=PANDA_HOME)
    resting, moving = (sm.plan(dataclasses.replace(problem, rest=rest)) for rest in (True, False))
    assert np.abs(moving.trajectory.qd[0]).max() > 1e-3
    assert moving.report.cost < resting.report.cost < 1.01 * moving.report.cost


def test_a_motion_that_does_not_rest_is_refused(panda: sm.RobotModel) -> None:
    problem = sm.Problem(panda, circle(panda, PANDA_HOME), start=PANDA_HOME, rest=False)
    plan = sm.plan(problem)
    assert plan.certificate.verified
    found = sm.certify(
        panda, plan.path, "pose", plan.trajectory, requirements=[AtRest(start=True, end=True)]
    )
    assert "moves at the start, where it should rest" in found.verdict
    assert not found.verified


def test_a_path_that_moves_at_its_ends_asks_for_no_rest(panda: sm.RobotModel) -> None:
    path = circle(panda, PANDA_HOME, "constant")
    assert rest_orders(path, sm.Task.POSE) == (0, 0)
    assert rest_orders(circle(panda, PANDA_HOME), sm.Task.POSE) == (2, 2)
    plan = sm.plan(sm.Problem(panda, path, start=PANDA_HOME))
    assert not any("rest" in what for what in plan.certificate.covers)
    ramped = sm.paths.section_at_rest(path)
    assert rest_orders(ramped, sm.Task.POSE) == (2, 2)
    assert "rest at both ends" in sm.plan(sm.Problem(panda, ramped)).certificate.covers


def test_a_path_that_accelerates_from_rest(planar: sm.RobotModel) -> None:
    """The paper's: ẋ is a sine of the time."""
    assert rest_orders(sm.sample_problem().path, sm.Task.PLANAR) == (1, 1)
    assert sm.sample_problem().rest_orders == (0, 0)


def test_relaxed_rows_rest_as_well(panda: sm.RobotModel) -> None:
    relaxed = [sm.Relaxation("z", 5e-3), sm.Relaxation("rz")]
    path = circle(panda, PANDA_HOME)
    plan = sm.plan(sm.Problem(panda, path, start=PANDA_HOME, relaxations=relaxed))
    assert plan.certificate.verified, plan.certificate.verdict
    assert np.abs(plan.trajectory.qd[[0, -1]]).max() <= REST
    end = panda.pose(plan.trajectory.q[-1])
    assert abs(end.translation[2] - path.pose(4.0).translation[2]) > 1e-4, "the end is free"


def test_closed_paths_at_rest_need_no_condition_on_speed(panda: sm.RobotModel) -> None:
    limits = (
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
        sm.constraints.ClosedPath(),
    )
    plan = sm.plan(sm.Problem(panda, circle(panda, PANDA_HOME), constraints=limits))
    assert plan.certificate.verified
    assert plan.certificate.closure <= 1e-8


def test_a_global_search_rests_as_well(panda: sm.RobotModel) -> None:
    path = circle(panda, PANDA_HOME)
    plan = sm.plan(sm.Problem(panda, path), search=sm.Search(mode="global"))
    assert plan.certificate.verified, plan.certificate.verdict
    assert np.abs(plan.trajectory.qd[[0, -1]]).max() <= REST


def test_a_moving_arm_hands_over_its_velocity(panda: sm.RobotModel, tmp_path) -> None:
    jacobian = panda.task_jacobian(PANDA_HOME, "pose")
    own = np.linalg.svd(jacobian)[2][-1]
    problem = sm.Problem(
        panda,
        circle(panda, PANDA_HOME),
        start=PANDA_HOME,
        constraints=[sm.constraints.JointVelocityLimits(), sm.constraints.StartVelocity(0.2 * own)],
    )
    plan = sm.plan(problem)
    assert plan.certificate.verified, plan.certificate.verdict
    assert "start velocity" in plan.certificate.covers
    np.testing.assert_allclose(plan.trajectory.qd[0], 0.2 * own, rtol=0, atol=REST)
    assert np.abs(plan.trajectory.qd[-1]).max() <= REST
    plan.save(tmp_path / "a.npz")
    assert sm.load_plan(tmp_path / "a.npz").certificate.verified
    other = next(item for item in problem.requirements if item.name == "start velocity")
    wrong = sm.certify(
        panda,
        plan.path,
        "pose",
        plan.trajectory,
        requirements=[dataclasses.replace(other, target=0.21 * own)],
    )
    assert "starts with a velocity" in wrong.verdict


@pytest.mark.parametrize(
    ("start", "qd", "message"),
    [
        (PANDA_HOME, 0.1, "in row '.*', but the path begins at 0"),
        (None, 0.0, "needs a given start"),
        (PANDA_HOME, [0.0, 1.0], "start velocity"),
    ],
)
def test_start_velocities_that_contradict_the_path(panda, start, qd, message: str) -> None:
    with pytest.raises(sm.errors.ProblemError, match=message):
        sm.Problem(
            panda,
            circle(panda, PANDA_HOME),
            start=start,
            constraints=[sm.constraints.StartVelocity(qd)],
        )


def test_a_motion_in_two_parts_is_handed_over_without_a_jump(panda: sm.RobotModel) -> None:
    whole = sm.plan(sm.Problem(panda, circle(panda, PANDA_HOME), start=PANDA_HOME))
    now = 0.3 * whole.path.duration
    q, qd, qdd = (whole.trajectory(now, order) for order in (0, 1, 2))
    # What is left of the path, by twists.
    rest = sm.paths.TwistPath(
        panda.pose(q), lambda t: whole.path.twist(now + t), whole.path.duration - now
    )
    constraints = [
        sm.constraints.JointVelocityLimits(),
        sm.constraints.StartVelocity(qd),
        sm.constraints.StartAcceleration(qdd),
    ]
    plan = sm.plan(sm.Problem(panda, rest, start=q, constraints=constraints))
    assert plan.certificate.verified, plan.certificate.verdict
    # The first part is on the path between its samples up to this only.
    np.testing.assert_allclose(plan.trajectory(0.0, 1), qd, rtol=0, atol=1e-6)
    np.testing.assert_allclose(plan.trajectory(0.0, 2), qdd, rtol=0, atol=1e-4)
    free = sm.plan(sm.Problem(panda, rest, start=q, constraints=constraints[:2]))
    assert np.abs(free.trajectory(0.0, 2) - qdd).max() > 2e-4
    judged = sm.certify(
        panda, rest, "pose", free.trajectory, None, [constraints[2].requirement(panda)]
    )
    assert "starts with an acceleration" in judged.verdict


def test_an_arm_at_rest_ends_with_the_acceleration_that_is_asked_for(panda: sm.RobotModel) -> None:
    own = np.linalg.svd(panda.task_jacobian(PANDA_HOME, "pose"))[2][-1]
    path = circle(panda, PANDA_HOME)
    start = sm.constraints.StartAcceleration(0.05 * own)
    plan = sm.plan(sm.Problem(panda, path, start=PANDA_HOME, constraints=[start]))
    assert plan.certificate.verified, plan.certificate.verdict
    assert np.abs(plan.trajectory.qd[0]).max() <= REST
    np.testing.assert_allclose(plan.trajectory(0.0, 2), 0.05 * own, rtol=0, atol=1e-4)
    last = sm.plan(
        sm.Problem(panda, path, start=PANDA_HOME, constraints=[sm.constraints.EndAcceleration()])
    )
    assert last.certificate.verified, last.certificate.verdict
    with pytest.raises(sm.errors.ProblemError, match="needs a given start"):
        sm.Problem(panda, path, constraints=[start])


def test_a_short_window_of_a_long_part_stays_open(panda: sm.RobotModel) -> None:
    start = panda.pose(PANDA_HOME)
    path = sm.paths.Dwell(start, 300.0) + circle(panda, PANDA_HOME)
    when = times_along(sm.paths.section_at_rest(path, ramp=0.5), (0.0, path.duration))
    first, last = when(np.array([301.0, 303.0]))
    assert last - first == pytest.approx(2.0)
    # One that ends where the part begins is none there.
    rest = sm.paths.section_at_rest(path, 299.99, 304.0, ramped=(False, True))
    part = times_along(rest, (299.99, 304.0))
    assert part(np.array([0.0, 300.0])).tolist() == [0.0, 0.0]
    assert part(np.array([301.0, 303.0])) == pytest.approx([1.01, 3.01])

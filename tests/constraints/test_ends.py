"""Conditions on both ends: reached, closed, or refused."""

import dataclasses
import re
from collections.abc import Callable

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.certificate import ClosedMotion, EndState
from selfmotion.model.task import SE3
from selfmotion.planning.rollout import FreeStart
from support.arms import PANDA_HOME, short_line, start_of
from support.followed import standing

Circle = Callable[..., sm.Problem]


LIMITS = (sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits())


def certify_again(plan: sm.Plan, requirements: list[sm.certificate.Requirement]) -> sm.Certificate:
    """Return a plan's certificate with other requirements."""
    return sm.certify(plan.robot, plan.path, plan.task, plan.trajectory, requirements=requirements)


def test_a_hundred_loops_of_a_closed_circle_do_not_drift(panda_circle: Circle) -> None:
    open_loop = sm.plan(panda_circle())
    plan = sm.plan(panda_circle(constraints=(*LIMITS, sm.constraints.ClosedPath())))
    assert plan.certificate.verified
    assert plan.certificate.closure <= 1e-9
    assert plan.certificate.closure * 100 <= 1e-6
    assert open_loop.certificate.closure > 0.01
    ends = plan.trajectory.qd[[0, -1]]
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-6)
    # What the pseudo-inverse alone does in one loop.
    drift = open_loop.initial_trajectory.q[-1] - open_loop.initial_trajectory.q[0]
    assert np.linalg.norm(drift) > 0.01
    assert plan.report.cost < 1.1 * open_loop.report.cost


def test_closed_paths_from_a_free_start(panda_circle: Circle) -> None:
    problem = panda_circle(constraints=(*LIMITS, sm.constraints.ClosedPath()))
    fixed = sm.plan(problem)
    free = sm.plan(dataclasses.replace(problem, start=None))
    assert free.certificate.verified
    assert free.certificate.closure <= 1e-8
    assert free.report.cost < fixed.report.cost


def test_a_closed_joint_path_needs_a_closed_tool_path(panda: sm.RobotModel) -> None:
    line = short_line(panda, PANDA_HOME)
    with pytest.raises(sm.errors.ProblemError, match="needs a closed tool path"):
        sm.Problem(panda, line, start=PANDA_HOME, constraints=[sm.constraints.ClosedPath()])


def test_end_configuration_is_reached(panda_circle: Circle) -> None:
    """The start itself, and a configuration further along the self-motion."""
    problem = panda_circle()
    robot, task = problem.robot, sm.Task.POSE
    manifold = FreeStart(standing(robot, task), PANDA_HOME)
    target = manifold.configuration(np.array([0.2]), problem.follows.targets(np.zeros(1))[0])
    assert target is not None
    constraints = (*LIMITS, sm.constraints.EndConfiguration(target))
    plan = sm.plan(panda_circle(constraints=constraints))
    assert plan.certificate.verified
    np.testing.assert_allclose(plan.trajectory.q[-1], target, atol=1e-7)


def test_an_end_velocity_is_reached_and_checked(panda_circle: Circle) -> None:
    """Rest where the path rests; the velocity of a motion known to be possible where it moves."""
    rest = sm.plan(panda_circle("pointing", constraints=(*LIMITS, sm.constraints.EndVelocity())))
    assert rest.certificate.verified, rest.certificate.verdict
    np.testing.assert_allclose(rest.trajectory.qd[-1], 0.0, atol=1e-6)
    problem = panda_circle("pointing")
    first = problem.path.pose(0.0)
    path = sm.paths.Circle.around(first, 0.15, 4.0, normal=(1.0, 0.0, 0.0), time_law="constant")
    problem = dataclasses.replace(problem, path=path)
    with pytest.raises(sm.errors.ProblemError, match="cannot end at rest"):
        dataclasses.replace(problem, constraints=[sm.constraints.EndVelocity()])
    free = sm.plan(problem)
    end, target = free.trajectory.q[-1], free.trajectory.qd[-1]
    ends = (sm.constraints.EndConfiguration(end), sm.constraints.EndVelocity(target))
    kept = sm.plan(dataclasses.replace(problem, constraints=(*LIMITS, *ends)))
    assert kept.certificate.verified, kept.certificate.verdict
    np.testing.assert_allclose(kept.trajectory.qd[-1], target, atol=1e-6)
    for wrong in (EndState(1, target + 0.1), EndState(0, end + 0.1)):
        check = certify_again(kept, [wrong])
        assert "'panda_joint" in check.verdict
        assert not check.verified


def test_a_jump_in_velocity_is_refused_where_the_path_repeats(panda_circle: Circle) -> None:
    plan = sm.plan(
        panda_circle(constraints=(*LIMITS, sm.constraints.ClosedPath(velocity=False)), rest=False)
    )
    assert plan.certificate.verified
    check = certify_again(plan, [ClosedMotion(velocity=True)])
    assert "off that of the start" in check.verdict


def test_end_conditions_that_contradict_each_other_are_named(panda_circle: Circle) -> None:
    follows = panda_circle().follows
    end = FreeStart(follows, PANDA_HOME).configuration(
        np.array([0.3]), follows.targets(np.zeros(1))[0]
    )
    assert end is not None
    plan = sm.plan(
        panda_circle(
            constraints=[sm.constraints.ClosedPath(), sm.constraints.EndConfiguration(end)]
        )
    )
    assert not plan.certificate.verified
    assert "not all constraints could be met" in plan.report.message


def test_what_is_asked_of_rates_sets_them_at_its_end_alone() -> None:
    asked = sm.constraints
    rates = {
        asked.StartVelocity: ((True, False), (False, False)),
        asked.EndVelocity: ((False, True), (False, False)),
        asked.StartAcceleration: ((False, False), (True, False)),
        asked.EndAcceleration: ((False, False), (False, True)),
    }
    for kind, (velocity, acceleration) in rates.items():
        assert kind.ends.velocity == velocity
        assert kind.ends.acceleration == acceleration


@pytest.mark.parametrize("off", [1e-7, 1e-4])
def test_a_start_velocity_that_the_path_does_not_have_is_refused(
    panda: sm.RobotModel, off: float
) -> None:
    path = short_line(panda, PANDA_HOME)
    joint_rates = np.linalg.pinv(panda.jacobian(PANDA_HOME)) @ np.array([off, 0, 0, 0, 0, 0])
    asked = [sm.constraints.StartVelocity(joint_rates)]

    def posed() -> sm.Problem:
        return sm.Problem(panda, path, start=PANDA_HOME, constraints=asked)

    if off > 1e-6:
        with pytest.raises(sm.errors.ProblemError, match="the start velocity moves"):
            posed()
    else:
        posed()


def test_a_path_that_begins_at_rest_is_said_to_begin_at_0(panda: sm.RobotModel) -> None:
    """Also where the way from there is along a negative axis, and its speed -0."""
    first = panda.pose(PANDA_HOME)
    turned = np.linalg.pinv(panda.jacobian(PANDA_HOME)) @ np.eye(6)[0]
    for way in (-0.1, 0.1):
        last = SE3(first.rotation, first.translation + np.array([way, 0.0, 0.0]))
        path = sm.paths.Line(first, last, 2.0)
        assert path.twist(0.0)[0] == 0.0
        with pytest.raises(sm.errors.ProblemError, match="the path begins at 0;"):
            sm.Problem(
                panda, path, start=PANDA_HOME, constraints=[sm.constraints.StartVelocity(turned)]
            )


def test_rates_at_ends_are_those_of_rest_where_nothing_else_is_said(panda: sm.RobotModel) -> None:
    asked = sm.constraints
    for kind in (
        *(asked.StartVelocity, asked.EndVelocity, asked.StartAcceleration, asked.EndAcceleration),
    ):
        np.testing.assert_array_equal(kind().target(panda), np.zeros(panda.dof))


@pytest.mark.parametrize(("row", "more"), [("x", 0.3), ("y", 0.4)])
def test_a_start_velocity_is_refused_for_the_row_that_is_farthest_off(
    planar: sm.RobotModel, row: str, more: float
) -> None:
    """Whatever the sizes of the rows: the path moves along x."""
    start = start_of(planar, "planar")
    first = planar.pose(start)
    last = SE3(first.rotation, first.translation + np.array([0.2, 0.0, 0.0]))
    path = sm.paths.Line(first, last, 2.0, time_law="constant")
    tool = np.array([0.1, 0.0]) + more * np.array([row == "x", row == "y"])
    joint_rates = np.linalg.pinv(planar.task_jacobian(start, "planar")) @ tool
    told = f"moves 'tool' at {tool['xy'.index(row)]:g} m/s or rad/s in row 'v{row}', but the "
    told += f"path begins at {0.1 if row == 'x' else 0.0:g};"
    with pytest.raises(sm.errors.ProblemError, match=re.escape(told)):
        sm.Problem(
            planar, path, "planar", start, constraints=[sm.constraints.StartVelocity(joint_rates)]
        )

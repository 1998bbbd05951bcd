"""Limits of joints are kept between samples, or named where they cannot be."""

from collections.abc import Callable

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.certificate import JointLimits
from support.arms import robot_named, short_line

Circle = Callable[..., sm.Problem]


def certify_again(plan: sm.Plan, requirements: list[sm.certificate.Requirement]) -> sm.Certificate:
    """Return a plan's certificate with other requirements."""
    return sm.certify(plan.robot, plan.path, plan.task, plan.trajectory, requirements=requirements)


def test_velocity_limits_are_kept_between_samples(panda_circle: Circle) -> None:
    robot = panda_circle().robot
    limit = 0.55 * robot.velocity_limit
    without = sm.plan(panda_circle())
    assert (np.abs(without.trajectory.qd) / limit).max() > 1.0
    constraints = (sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits(limit))
    plan = sm.plan(panda_circle(constraints=constraints))
    assert plan.certificate.verified
    t = np.linspace(0, plan.trajectory.duration, 5001)
    assert (np.abs(plan.trajectory(t, 1)) / limit).max() <= 1.0
    assert plan.certificate.velocity_ratio.value > 0.9


def test_position_limits_are_kept_between_samples(panda_circle: Circle) -> None:
    free = sm.plan(panda_circle())
    upper = np.array(free.robot.upper)
    upper[1] = free.trajectory.q[:, 1].max() - 0.05
    constraints = (
        sm.constraints.JointPositionLimits(upper=upper),
        sm.constraints.JointVelocityLimits(),
    )
    plan = sm.plan(panda_circle(constraints=constraints))
    assert plan.certificate.verified
    t = np.linspace(0, plan.trajectory.duration, 5001)
    assert plan.trajectory(t)[:, 1].max() <= upper[1]


def test_unreachable_limits_are_named(panda_circle: Circle) -> None:
    robot = panda_circle().robot
    constraints = [sm.constraints.JointVelocityLimits(0.1 * robot.velocity_limit)]
    plan = sm.plan(panda_circle(constraints=constraints))
    assert not plan.certificate.verified
    assert "velocity limits: speed of joint 'panda_joint" in plan.report.message
    assert "times its limit" in plan.certificate.verdict
    with pytest.raises(sm.errors.PlanError):
        plan.require()


def test_a_limit_on_one_side_is_kept(panda_circle: Circle) -> None:
    free = sm.plan(panda_circle())
    joint = int(np.argmax(np.ptp(free.trajectory.q, axis=0)))
    lower, upper = np.full(7, -np.inf), np.full(7, np.inf)
    upper[joint] = free.trajectory.q[:, joint].max() - 0.02
    kept = sm.plan(
        panda_circle("position", constraints=[sm.constraints.JointPositionLimits(lower, upper)])
    )
    assert kept.certificate.verified, kept.certificate.verdict
    assert kept.trajectory.q[:, joint].max() < upper[joint]


def test_accelerations_are_judged_at_their_extremes(panda_circle: Circle) -> None:
    """Where a cubic begins or ends, also at t = 0 and T."""
    plan = sm.plan(panda_circle())
    times = np.linspace(0.0, 4.0, 100_001)
    extreme = np.abs(plan.trajectory(times, order=2)).max()
    found = np.abs(plan.trajectory.extremes(2)[1]).max()
    assert extreme <= found * (1.0 + 1e-9)
    assert found <= extreme * 1.01
    check = certify_again(
        plan, [JointLimits(2, np.full(7, -0.999 * found), np.full(7, 0.999 * found))]
    )
    assert "accelerates at 1.001 times its limit" in check.verdict


def test_limits_that_do_not_bind_cost_no_evaluation(panda_circle: Circle) -> None:
    """Exactly the quasi-Newton method then, point by point."""
    without, within = sm.plan(panda_circle(constraints=())), sm.plan(panda_circle())
    assert without.report.evaluations == within.report.evaluations
    for first, second in zip(without.report.history, within.report.history, strict=True):
        np.testing.assert_array_equal(first.x, second.x)


def test_limits_that_nobody_knows_are_told_of() -> None:
    """A constraint that has nothing to ask of an arm is not passed over in silence."""
    robot = robot_named("ur10")
    start = robot.dexterous_configuration("pointing")
    asked = sm.constraints.JointAccelerationLimits()
    problem = sm.Problem(robot, short_line(robot, start), "pointing", start, constraints=[asked])
    told = [text for text in problem.remarks if "none are known" in text]
    assert told == [
        "joint acceleration limits: none are known of ur10, so none are kept; "
        "give --acceleration, limit = …"
    ]
    for quiet in ({"constraints": [sm.constraints.JointAccelerationLimits(5.0)]}, {}):
        usual = sm.Problem(robot, problem.path, "pointing", start, **quiet)
        assert not any("none are known" in text for text in usual.remarks)

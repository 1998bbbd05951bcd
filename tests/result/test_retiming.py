"""Retimed plans keep their geometry and the limits."""

import dataclasses

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.robot import Dynamics
from support.arms import PANDA_HOME, robot_named

ACCELERATION = 6.0


@pytest.fixture(scope="module")
def fast() -> sm.Plan:
    """A circle in half a second: far too fast for a Panda."""
    panda = robot_named("panda")
    path = sm.Circle.around(panda.pose(PANDA_HOME), 0.15, 0.5, normal=(1.0, 0.0, 0.0))
    only = (sm.JointPositionLimits(),)
    return sm.plan(sm.Problem(panda, path, start=PANDA_HOME, constraints=only))


# toppra 0.6 still asks NumPy for a name that has another one now.
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_retimed_plans_keep_limits_and_geometry(fast: sm.Plan, tmp_path) -> None:
    assert not fast.certificate.verified
    slow = sm.retime(fast, ACCELERATION)
    assert slow.certificate.verified, slow.certificate.verdict
    assert slow.certificate.acceleration_ratio is not None
    assert slow.certificate.acceleration_ratio.value <= 1.0
    assert slow.trajectory.duration > 2.0 * fast.trajectory.duration
    np.testing.assert_allclose(slow.trajectory.qd[[0, -1]], 0.0, atol=1e-6)
    assert isinstance(slow.path, sm.Retimed)
    sigma = slow.path.pace(slow.trajectory.t)
    np.testing.assert_allclose(slow.trajectory.q, fast.trajectory(sigma), atol=1e-9)
    slow.save(tmp_path / "slow.npz")
    assert sm.load_plan(tmp_path / "slow.npz").check() == slow.certificate


def test_the_factor_is_the_one_that_suffices(fast: sm.Plan) -> None:
    factor = sm.slowdown(fast)
    assert factor == pytest.approx(fast.certificate.velocity_ratio.value)
    panda = fast.robot
    for share, verified in ((1.01, True), (0.9, False)):
        duration = 0.5 * factor * share
        path = sm.Circle.around(panda.pose(PANDA_HOME), 0.15, duration, normal=(1.0, 0.0, 0.0))
        only = (sm.JointPositionLimits(),)
        plan = sm.plan(sm.Problem(panda, path, start=PANDA_HOME, constraints=only))
        assert plan.certificate.verified is verified
    assert sm.slowdown(fast, ACCELERATION) > factor


def test_bad_limits_are_refused(fast: sm.Plan) -> None:
    with pytest.raises(sm.ProblemError, match="expected numbers > 0"):
        sm.retime(fast, 0.0)


def test_a_retimed_plan_keeps_what_the_plan_was_asked_to_keep(panda: sm.RobotModel) -> None:
    """Clearance and own velocity limits: what was refused before is not verified afterwards."""
    pose = panda.pose(PANDA_HOME)
    path = sm.Circle.around(pose, 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    wall = sm.Box("wall", pose.translation + np.array([0.0, 0.0, 0.16]), [0.05, 0.05, 0.05])
    slow = np.full(7, 0.9)
    problem = sm.Problem(
        panda,
        path,
        start=PANDA_HOME,
        constraints=[sm.JointVelocityLimits(slow), sm.Clearance(wall, 0.03)],
    )
    plan = sm.plan(problem, max_evaluations=5)
    retimed = sm.retime(plan, 10.0)
    assert "wall are" in retimed.certificate.verdict
    assert retimed.certificate == retimed.check()
    assert np.abs(retimed.trajectory.qd).max() <= 0.9
    for bad in (np.nan, 0.0, [1.0, 2.0]):
        with pytest.raises(sm.ProblemError):
            sm.slowdown(plan, bad)
        with pytest.raises(sm.ProblemError):
            sm.retime(plan, bad)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_retiming_keeps_torques_and_what_the_tool_may(panda: sm.RobotModel) -> None:
    path = sm.Circle.around(panda.pose(PANDA_HOME), 0.12, 4.0, normal=(1.0, 0.0, 0.0))
    slow = sm.plan(sm.Problem(panda, path, start=PANDA_HOME)).require()
    dynamics, t = Dynamics(panda), np.linspace(0.0, 4.0, 2001)
    motion = slow.trajectory
    needed = np.abs(dynamics.torques(motion(t), motion(t, 1), motion(t, 2))).max(axis=0)
    for limit in (sm.JointTorqueLimits(1.1 * needed + 0.5), sm.ToolLimits(speed=0.6)):
        problem = dataclasses.replace(slow.problem, constraints=(*slow.problem.constraints, limit))
        asked = dataclasses.replace(slow, problem=problem)
        assert asked.check().verified
        free, kept = sm.retime(slow, 15.0), sm.retime(asked, 15.0)
        assert kept.certificate.verified, kept.certificate.verdict
        assert free.path.duration < kept.path.duration < slow.path.duration

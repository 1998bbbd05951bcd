"""Joint torques: kept, judged and refused."""

import re

import numpy as np
import pytest

import selfmotion as sm
from selfmotion import testing
from selfmotion.certificate import FinishedMotion
from selfmotion.robot import Dynamics
from support.circles import upright_circle


def test_the_constraint_keeps_the_laws(panda: sm.RobotModel) -> None:
    testing.check_constraint(
        sm.JointTorqueLimits(limit=20.0), upright_circle(panda, task="position")
    )


def test_torques_are_kept_and_judged_at_all_times(panda: sm.RobotModel, tmp_path) -> None:
    free = sm.plan(upright_circle(panda, task="position"))
    dynamics, t = Dynamics(panda, 3.0), np.linspace(0.0, 4.0, 20_001)
    motion = free.trajectory
    needed = np.abs(dynamics.torques(motion(t), motion(t, 1), motion(t, 2)))
    asked = sm.JointTorqueLimits(panda.effort_limit, payload=3.0)
    found = asked.requirement(panda).judge(_finished(free))
    exact = float((needed / panda.effort_limit).max())
    assert exact <= found.amount <= exact * (1.0 + 1e-4)
    # Less than the free motion takes of the joint that is loaded most.
    joint = int(np.argmax(needed.max(axis=0)))
    limit = np.array(panda.effort_limit)
    limit[joint] = 0.985 * needed[:, joint].max()
    asked = sm.JointTorqueLimits(limit, payload=3.0)
    constraints = [sm.JointPositionLimits(), sm.JointVelocityLimits(), asked]
    plan = sm.plan(upright_circle(panda, task="position", constraints=constraints))
    assert plan.certificate.verified, plan.certificate.verdict
    assert "torques" in plan.certificate.covers
    motion = plan.trajectory
    kept = np.abs(dynamics.torques(motion(t), motion(t, 1), motion(t, 2)))
    assert (kept / limit).max() <= 1.0
    assert plan.report.cost > free.report.cost
    plan.save(tmp_path / "plan.npz")
    assert sm.load_plan(tmp_path / "plan.npz").certificate.verified


def test_whole_turns_between_samples_hide_nothing(panda: sm.RobotModel) -> None:
    # At a quarter, the half and three quarters of the way the arm stands upright each time.
    upright = np.array([0.0, 0.0, 0.0, -0.1, 0.0, 0.1, 0.0])
    turned = upright + 8.0 * np.pi * np.eye(7)[1]
    speed = (turned - upright) / 100.0
    at_ends = np.array([upright, turned]), np.array([speed, speed])
    still = np.zeros((2, 7))
    motion = sm.Trajectory(np.array([0.0, 100.0]), *at_ends, panda.joint_names, still)
    dynamics, t = Dynamics(panda), np.linspace(0.0, 100.0, 4001)
    needed = np.abs(dynamics.torques(motion(t), motion(t, 1), motion(t, 2))).max(axis=0)
    assert needed[1] > 30.0
    limit = np.full(7, 2.0 * needed.max())
    assert sm.JointTorqueLimits(limit).requirement(panda).judge(FinishedMotion(panda, motion)).kept
    limit[1] = 0.5 * needed[1]
    found = sm.JointTorqueLimits(limit).requirement(panda).judge(FinishedMotion(panda, motion))
    assert (found.kept, found.subject) == (False, panda.joint_names[1])
    assert found.amount == pytest.approx(2.0, rel=1e-3)
    # Too long a way to be looked at is not kept either.
    endless = sm.Trajectory(
        motion.t, np.array([upright, upright + 1e6]), np.full((2, 7), 1e4), panda.joint_names, still
    )
    found = sm.JointTorqueLimits(limit).requirement(panda).judge(FinishedMotion(panda, endless))
    assert not found.kept


def test_a_payload_that_is_too_heavy_is_refused(panda: sm.RobotModel) -> None:
    heavy = sm.JointTorqueLimits(payload=30.0)
    plan = sm.plan(upright_circle(panda, constraints=[heavy]), max_evaluations=30)
    assert not plan.certificate.verified
    assert re.search(
        r"torque of joint 'panda_joint\d' is \S+ Nm at t = \S+ s, \S+ times its limit of (12|87)",
        plan.certificate.verdict,
    )


def _finished(plan: sm.Plan) -> FinishedMotion:
    return FinishedMotion(plan.robot, plan.trajectory)

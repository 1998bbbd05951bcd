"""Motions made to deceive who looks at fixed points: none is verified that is not within limits."""

from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.robot import Dynamics
from support.arms import robot_named

HOME = np.array([0.3, -1.2, 1.5, -1.0, 1.2, 0.4])


def hidden(robot: sm.RobotModel, q: Array, joint: int, size: float, h: float) -> sm.Trajectory:
    """One interval of a quintic with zeros at both ends, the quarters and the middle."""
    places, qd, qdd = np.tile(q, (2, 1)), np.zeros((2, len(q))), np.zeros((2, len(q)))
    qd[:, joint] = 0.09375 * size / h
    qdd[:, joint] = [-1.5625 * size / h**2, 1.5625 * size / h**2]
    return sm.Trajectory([0.0, h], places, qd, robot.joint_names, qdd)


def test_a_quintic_that_vanishes_at_five_points_leaves_the_path() -> None:
    ur5 = robot_named("ur5")
    motion = hidden(ur5, HOME, 1, 0.02, 0.1)
    t = np.linspace(0.0, 0.1, 5)
    assert np.abs(motion(t) - HOME).max() <= 1e-15
    found = sm.certify(ur5, sm.paths.Dwell(ur5.pose(HOME), 0.1), "pose", motion)
    assert not found.verified
    dense = motion(np.linspace(0.0, 0.1, 2001))
    at = ur5.pose(HOME).translation
    worst = max(np.linalg.norm(ur5.pose(q).translation - at) for q in dense)
    # What is broken is told as measured; what a wider tolerance allows is bounded.
    assert found.position_error.value <= 1.2 * worst
    allowed = sm.Tolerance(1.02 * worst, 1.0)
    wide = sm.certify(ur5, sm.paths.Dwell(ur5.pose(HOME), 0.1), "pose", motion, allowed)
    assert wide.verified
    assert worst <= wide.position_error.value <= 1.02 * worst


@pytest.mark.parametrize("share", [0.999, 1.001])
def test_a_torque_between_five_points_counts(share: float) -> None:
    ur5, q = robot_named("ur5"), np.array([0.3, -0.9, 0.6, -1.0, 1.2, 0.4])
    motion = hidden(ur5, q, 1, 8.0, 60.0)
    t = np.linspace(0.0, 60.0, 4001)
    needed = np.abs(Dynamics(ur5, 5.0).torques(motion(t), motion(t, 1), motion(t, 2))).max(axis=0)
    limit = np.full(6, 1e3)
    limit[1] = share * needed[1]
    asked = sm.constraints.JointTorqueLimits(limit, payload=5.0).requirement(ur5)
    assert asked.judge(sm.certificate.FinishedMotion(ur5, motion)).satisfied is (share > 1.0)


def test_an_elbow_that_flips_between_samples_is_found(tmp_path: Path) -> None:
    """An arm without offsets passes through stretched and back: the swivel goes to π and back."""
    axes, lengths = "ZYZYZYZ", (0.1, 0.2, 0.2, 0.2, 0.2, 0.2, 0.1)
    limit = '<limit lower="-3.1" upper="3.1" velocity="3" effort="100"/>'
    parts = [f'<link name="l{k}"/>' for k in range(8)]
    for k, (axis, length) in enumerate(zip(axes, lengths, strict=True)):
        xyz = "0 0 1" if axis == "Z" else "0 1 0"
        parts.append(
            f'<joint name="j{k + 1}" type="revolute"><parent link="l{k}"/>'
            f'<child link="l{k + 1}"/><origin xyz="0 0 {length}"/><axis xyz="{xyz}"/>{limit}'
            "</joint>"
        )
    (tmp_path / "srs.urdf").write_text(f'<robot name="srs">{"".join(parts)}</robot>')
    robot, swivel = sm.load_robot(tmp_path / "srs.urdf"), sm.robot.SwivelAngle()
    q = np.tile([0.3, 0.9, 0.4, 0.0, 0.2, 0.5, 0.1], (2, 1))
    qd, qdd = np.zeros((2, 7)), np.zeros((2, 7))
    for bend, flips in ((-5e-5, True), (0.2, False)):
        for row, t in enumerate((0.0, 1.0)):
            q[row, 3] = 0.12 * (t - 0.37) ** 2 + bend
            qd[row, 3], qdd[row, 3] = 0.24 * (t - 0.37), 0.24
        motion = sm.Trajectory([0.0, 1.0], q, qd, robot.joint_names, qdd)
        center = float(swivel(robot, motion(np.zeros(1)))[0][0])
        found = sm.constraints.Band(swivel, center, 0.2).requirement(robot)
        judged = found.judge(sm.certificate.FinishedMotion(robot, motion))
        t = np.linspace(0.0, 1.0, 20_001)
        away = np.abs(swivel.away(swivel(robot, motion(t))[0], center)).max()
        assert bool(away > 0.2) is flips
        assert judged.satisfied is not flips


@pytest.mark.parametrize("seed", range(40))
def test_no_polynomial_hides_between_any_points(seed: int) -> None:
    """Random roots: samples, quintics and how far they go are drawn, and the truth is dense."""
    ur5, rng = robot_named("ur5"), np.random.default_rng(seed)
    count = int(rng.integers(2, 6))
    t = np.append(0.0, np.cumsum(10.0 ** rng.uniform(-2.0, 0.5, count)))
    shape = (count + 1, 6)
    size = 10.0 ** rng.uniform(-7.0, -2.0)
    q = HOME + size * rng.normal(size=shape) * (rng.random(shape) < 0.5)
    qd = size * rng.normal(size=shape) / np.diff(t).min()
    qdd = size * rng.normal(size=shape) / np.diff(t).min() ** 2
    motion = sm.Trajectory(t, q, qd, ur5.joint_names, qdd)
    dense = np.linspace(0.0, t[-1], 4001)
    at = ur5.pose(HOME).translation
    worst = max(float(np.linalg.norm(ur5.pose(x).translation - at)) for x in motion(dense))
    path = sm.paths.Dwell(ur5.pose(HOME), float(t[-1]))
    for share, verified in ((1.05, True), (0.99, False)):
        found = sm.certify(ur5, path, "position", motion, sm.Tolerance(share * worst, 1.0))
        assert found.on_path is verified, (found.position_error, worst)

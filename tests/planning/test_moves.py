"""Moves between parts go round what is in the way."""

import numpy as np
import pinocchio as pin

import selfmotion as sm
import selfmotion.shell.testing
from selfmotion.planning.planner.parts import _Mover, between_parts
from support.arms import robot_named
from support.oracle import Judge
from support.own_kinematics import Arm
from support.scenes import Followed, arm


def test_moves_go_round_what_is_in_the_way(tmp_path) -> None:
    robot = arm(tmp_path, np.random.default_rng(3), 7, "box")
    rng = np.random.default_rng(5)
    first, last = rng.uniform(-1.2, 1.2, (2, 7))
    kinematics = Arm(robot)
    _, middle = kinematics.place(kinematics.tool, 0.5 * (first + last)[None])
    ball = sm.obstacles.Sphere("ball", middle[0], 0.08)
    clearance = sm.constraints.Clearance([ball], 2e-3)
    path = sm.paths.Line(
        robot.pose(first), robot.pose(first) * pin.SE3(np.eye(3), np.full(3, 0.01)), 2.0
    )
    limits = [
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
        sm.constraints.JointAccelerationLimits(20.0),
    ]
    problem = sm.Problem(robot, path, "pose", constraints=limits, clearance=clearance)
    mover = _Mover(between_parts(problem), None, np.random.default_rng(0), lambda *_: None)

    def refuted(motion: sm.Trajectory) -> tuple[str, ...]:
        followed = Followed(kinematics, motion, motion.duration)
        bodies = [([ball], clearance.model(robot).pairs, 2e-3)]
        acceleration = {2: (np.full(7, -20.0), np.full(7, 20.0))}
        judge = Judge(robot, followed, limits=acceleration, bodies=bodies, per_interval=300)
        return judge.judge(motion).refutes

    move = mover.move(first, last)
    assert move.verified
    assert move.trajectory is not None
    np.testing.assert_array_equal(move.trajectory.q[[0, -1]], [first, last])
    assert not refuted(move.trajectory)
    at_rest = np.zeros((2, 7))
    duration = move.trajectory.duration
    straight = sm.Trajectory([0.0, duration], [first, last], at_rest, robot.joint_names, at_rest)
    assert any(fault.startswith("apart") for fault in refuted(straight))
    # Into the ball there is no way, and that is said.
    missing = mover.move(first, 0.5 * (first + last))
    assert not missing.verified
    assert missing.trajectory is None
    assert "the last configuration is not allowed" in missing.trouble
    assert "ball" in missing.trouble


def screw(angle: float, *more: sm.constraints.Constraint) -> sm.Problem:
    """Return the problem of a Panda that turns its tool on the spot, joint 7 by 6.8 rad at most.

    The others turn by 0.2 rad at most, so that one part turns the tool by 6.8 + 6 · 0.2 rad at
    most.
    """
    panda = robot_named("panda")
    home = np.array(sm.NAMED_ARMS["panda"].home)
    lower, upper = home - 0.1, home + 0.1
    lower[6], upper[6] = -3.4, 3.4
    pose = panda.pose(np.array([*home[:6], -3.4]))
    turns = np.linspace(0.0, angle, int(2.0 * angle))
    poses = [pose * pin.SE3(pin.exp3(np.array([0.0, 0.0, a])), np.zeros(3)) for a in turns]
    constraints = [
        sm.constraints.JointPositionLimits(lower, upper, replace=True),
        sm.constraints.JointVelocityLimits(),
        sm.constraints.JointAccelerationLimits(),
        *more,
    ]
    path = sm.paths.Waypoints.from_poses(1.5 * turns, poses)
    return sm.Problem(panda, path, "pose", constraints=constraints)


def test_the_tool_leaves_the_work_before_a_move_and_comes_back_after_it(tmp_path) -> None:
    parts = sm.plan_in_parts(screw(10.0), retreat=0.02).require()
    parts.save(tmp_path / "screw.parts")
    again = sm.files.load_parts(tmp_path / "screw.parts").require()
    np.testing.assert_array_equal(again.trajectory.q, parts.trajectory.q)
    assert (again.cuts, again.endings) == (parts.cuts, parts.endings)
    # Its path begins at speed, and so does the motion.
    sm.files.write_motion(parts, tmp_path / "screw.csv", force=True)
    written = sm.files.read_motion(tmp_path / "screw.csv")
    np.testing.assert_allclose(written.q[-1], parts.trajectory.q[-1], atol=1e-12)
    assert len(parts.plans) == 2
    (move,) = parts.moves
    assert move.trajectory is not None
    tool = [
        parts.problem.robot.pose(q)
        for q in move.trajectory(np.linspace(0, move.trajectory.duration, 400))
    ]
    cut = parts.problem.path.pose(parts.cuts[0])
    away = np.array([cut.actInv(pose.translation) for pose in tool])
    farthest = int(np.argmin(away[:, 2]))
    assert away[:, 2].min() < -0.015
    # Along the axis until it is 20 mm away.
    leaving = away[: int(np.argmax(away[:, 2] < -0.0195))]
    assert np.abs(leaving[:, :2]).max() < 1e-5
    assert 0 < farthest < len(away) - 1
    assert np.abs(away[[0, -1]]).max() < 1e-5

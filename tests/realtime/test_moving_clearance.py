"""Obstacles that move are avoided, or the arm stops."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import trimesh

import selfmotion as sm
from selfmotion.realtime import Replanner, Segment
from support.arms import PANDA_HOME, robot_named
from support.loops import Array, closed_loop

# What the tool is off its path without noise or lag: the middle rule's error over cycles of 1 ms.
TRACKED = 1e-5


# Obstacles that move.


def beside_the_elbow(panda: sm.RobotModel) -> Array:
    data = panda.model.createData()
    pin.forwardKinematics(panda.model, data, PANDA_HOME)
    return np.array(data.oMi[4].translation + np.array([0.0, 0.3, 0.0]))


def test_a_ball_that_comes_near_is_avoided_by_the_self_motion(panda: sm.RobotModel) -> None:
    first = beside_the_elbow(panda)
    clearance = sm.constraints.Clearance([sm.obstacles.Sphere("ball", first, 0.06)], distance=0.005)
    replanner = Replanner(panda, constraints=[clearance])
    hold = sm.paths.Dwell(panda.pose(PANDA_HOME), 100.0)
    t, q = 0.0, PANDA_HOME
    nearest = np.inf
    for _ in range(300):
        # Through where the elbow is now, at 5 cm/s.
        place = pin.SE3(np.eye(3), first - [0.0, 0.05 * t, 0.0])
        segment = replanner.step(t, q, np.zeros(7), hold, {"ball": place})
        t += replanner.period
        q = segment.q[segment.index(t)]
        ball = sm.obstacles.CollisionModel(panda, [sm.obstacles.Sphere("ball", place, 0.06)])
        if round(t / replanner.period) % 20 == 0:
            nearest = min(nearest, ball.distance(q).value)
    assert np.abs(q - PANDA_HOME).max() > 0.1
    assert nearest > 0.0
    miss = sm.Task.POSE.miss(hold.pose(0.0), panda.pose(q))
    assert max(miss) < TRACKED


def test_where_no_self_motion_helps_the_tool_waits_on_its_path_before_the_obstacle(
    panda: sm.RobotModel,
) -> None:
    pose = panda.pose(PANDA_HOME)
    ahead = pin.SE3(np.eye(3), pose.translation + np.array([0.0, 0.3, 0.0]))
    clearance = sm.constraints.Clearance([sm.obstacles.Sphere("ball", ahead, 0.05)], distance=0.01)
    replanner = Replanner(panda, constraints=[clearance])
    goal = pin.SE3(pose.rotation, pose.translation + np.array([0.0, 0.3, 0.0]))
    path = sm.paths.Line(pose, goal, 2.0, time_law="minimum_jerk")
    segments, places = closed_loop(replanner, path, PANDA_HOME, 2.5)
    exact = sm.obstacles.CollisionModel(panda, clearance.obstacles)
    assert min(exact.distance(q).value for q in places[::10]) > 0.0
    waits_on_its_path(segments[-1])
    # It goes on when the way is free.
    t, q = 2.5, places[-1]
    for _ in range(250):
        free = {"ball": pin.SE3(np.eye(3), np.array([0.0, 0.0, 9.0]))}
        segment = replanner.step(t, q, np.zeros(7), path, free)
        t += replanner.period
        q = segment.q[segment.index(t)]
    assert sm.Task.POSE.miss(goal, panda.pose(q))[0] < 1e-4


def waits_on_its_path(segment: Segment) -> None:
    assert "the tool waits on its path" in segment.reasons
    assert segment.delay > 0.5
    assert segment.tool_error[0] < TRACKED


def test_the_arm_stops_before_what_it_carries_meets_something(panda: sm.RobotModel) -> None:
    """A torch across the hand reaches the ball 0.2 m before the hand does."""
    pose = panda.pose(PANDA_HOME)
    across = pose.rotation.T @ np.array([0.0, 1.0, 0.0])
    frame = pin.SE3(np.eye(3), 0.1 * across + np.array([0.0, 0.0, 0.02]))
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), across).toRotationMatrix()
    torch = sm.obstacles.Cylinder(
        "torch", pin.SE3(turn, frame.translation), 0.01, 0.2, frame="panda_hand_tcp"
    )
    ahead = pose.translation + np.array([0.0, 0.4, 0.0])
    bodies = [torch, sm.obstacles.Sphere("ball", ahead, 0.05)]
    replanner = Replanner(panda, constraints=[sm.constraints.Clearance(bodies, distance=0.01)])
    goal = pin.SE3(pose.rotation, pose.translation + np.array([0.0, 0.3, 0.0]))
    path = sm.paths.Line(pose, goal, 2.0, time_law="minimum_jerk")
    segments, places = closed_loop(replanner, path, PANDA_HOME, 2.5)
    exact = sm.obstacles.CollisionModel(panda, bodies)
    assert min(exact.distance(q).value for q in places[::10]) > 0.0
    waits_on_its_path(segments[-1])
    # The hand alone goes on.
    alone = Replanner(panda, constraints=[sm.constraints.Clearance(bodies[1:], distance=0.01)])
    _, farther = closed_loop(alone, path, PANDA_HOME, 2.5)
    came, comes = (panda.pose(each[-1]).translation[1] for each in (places, farther))
    assert comes > came + 0.05


def test_an_obstacle_that_is_not_known_is_refused(
    panda: sm.RobotModel, slow_circle: sm.paths.Circle
) -> None:
    clearance = sm.constraints.Clearance(
        [sm.obstacles.Sphere("ball", np.array([0.0, 0.0, 9.0]), 0.05)]
    )
    replanner = Replanner(panda, constraints=[clearance])
    with pytest.raises(sm.errors.ProblemError, match="'bal'"):
        replanner.step(0.0, PANDA_HOME, np.zeros(7), slow_circle, {"bal": pin.SE3.Identity()})


LIMITS = (
    sm.constraints.JointPositionLimits(),
    sm.constraints.JointVelocityLimits(),
    sm.constraints.JointAccelerationLimits(),
)


@pytest.mark.site
def test_all_clearances_are_kept() -> None:
    """With the ball in the second one the arm is stopped as with the ball in the only one."""
    panda, q = robot_named("panda"), np.array(sm.NAMED_ARMS["panda"].home)
    first = panda.pose(q)
    last = pin.SE3(first.rotation, first.translation + np.array([0.0, 0.25, 0.0]))
    path = sm.paths.Line(first, last, 3.0)
    place = first.translation + np.array([0.0, 0.225, 0.0])
    ball, far = (
        sm.obstacles.Sphere("ball", place, 0.05),
        sm.obstacles.Sphere("far", [3.0] * 3, 0.05),
    )
    bodies = [sm.constraints.Clearance([far], 0.02), sm.constraints.Clearance([ball], 0.02)]
    replanner = sm.Replanner(panda, "position", constraints=[*LIMITS, *bodies], horizon=2.0)
    model = sm.obstacles.CollisionModel(panda, [ball])
    with_ball = [k for k, pair in enumerate(model.pairs) if "ball" in pair]
    t, state, least = 0.0, (q, 0.0 * q), np.inf
    for _ in range(250):
        segment = replanner.step(t, *state, path)
        t += replanner.period
        now = segment.index(t)
        state = segment.q[now], segment.qd[now]
        least = min(least, float(model.distances(state[0][None])[0, with_ball].min()))
    assert least > 0.0
    # Either may be moved by its name.
    replanner.step(t, *state, path, {"ball": pin.SE3.Identity(), "far": pin.SE3.Identity()})


def cell_with_a_hook(panda: sm.RobotModel, file: Path) -> sm.constraints.Clearance:
    """Four posts far off, and a hook ahead of the tool, in one mesh: its hull holds the arm."""
    ahead = panda.pose(PANDA_HOME).translation + np.array([0.0, 0.15, 0.0])
    parts = [trimesh.creation.icosphere(radius=0.02, subdivisions=1).apply_translation(ahead)]
    for x, y in ((1.5, -1.5), (-1.5, 1.5), (-1.5, -1.5), (1.5, 1.5)):
        post = trimesh.creation.box((0.02, 0.02, 4.0))
        parts.append(post.apply_translation([x, y, 0.5]))
    trimesh.util.concatenate(parts).export(file)
    return sm.constraints.Clearance([sm.obstacles.Mesh("cell", [0.0] * 3, file)], 0.01)


def test_in_a_cell_as_one_mesh_the_arm_stops_before_a_hook(tmp_path: Path) -> None:
    panda = robot_named("panda")
    cell = cell_with_a_hook(panda, tmp_path / "cell.stl")
    replanner = sm.Replanner(panda, "position", constraints=[*LIMITS, cell])
    first = panda.pose(PANDA_HOME)
    last = pin.SE3(first.rotation, first.translation + np.array([0.0, 0.3, 0.0]))
    t, q, qd, least = 0.0, PANDA_HOME, np.zeros(7), np.inf
    exact = sm.obstacles.CollisionModel(panda, cell.obstacles)
    with_cell = [k for k, pair in enumerate(exact.pairs) if "cell" in pair]
    for _ in range(120):
        segment = replanner.step(t, q, qd, sm.paths.Line(first, last, 2.0))
        t += replanner.period
        q, qd = (each[segment.index(t)] for each in (segment.q, segment.qd))
        least = min(least, float(exact.distances(q[None])[0, with_cell].min()))
    assert 0.0 < least < 0.05


def test_an_open_cell_as_one_mesh_is_refused(tmp_path: Path) -> None:
    """It cannot be taken apart, and its hull holds the arm, so that a hook in it would be none."""
    panda = robot_named("panda")
    cell = cell_with_a_hook(panda, tmp_path / "cell.stl")
    mesh = trimesh.load(tmp_path / "cell.stl")
    mesh.update_faces(np.arange(len(mesh.faces)) > 0)
    mesh.export(tmp_path / "cell.stl")
    with pytest.raises(
        sm.errors.ProblemError, match=r"convex hulls, and that of 'cell' always contains"
    ):
        sm.Replanner(panda, "position", constraints=[*LIMITS, cell])

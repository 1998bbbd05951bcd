"""Obstacles that move are avoided, or the arm stops."""

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.realtime import Flag, Replanner
from support.arms import PANDA_HOME
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
    clearance = sm.Clearance([sm.Sphere("ball", first, 0.06)], distance=0.005)
    replanner = Replanner(panda, constraints=[clearance])
    hold = sm.Dwell(panda.pose(PANDA_HOME), 100.0)
    t, q = 0.0, PANDA_HOME
    nearest = np.inf
    for _ in range(300):
        # Through where the elbow is now, at 5 cm/s.
        place = pin.SE3(np.eye(3), first - [0.0, 0.05 * t, 0.0])
        segment = replanner.step(t, q, np.zeros(7), hold, {"ball": place})
        t += replanner.period
        q = segment.q[segment.index(t)]
        ball = sm.CollisionModel(panda, [sm.Sphere("ball", place, 0.06)])
        if round(t / replanner.period) % 20 == 0:
            nearest = min(nearest, ball.distance(q).value)
    assert np.abs(q - PANDA_HOME).max() > 0.1
    assert nearest > 0.0
    miss = sm.Task.POSE.miss(hold.pose(0.0), panda.pose(q))
    assert max(miss) < TRACKED


def test_where_no_self_motion_helps_the_arm_stops_before_the_obstacle(
    panda: sm.RobotModel,
) -> None:
    pose = panda.pose(PANDA_HOME)
    ahead = pin.SE3(np.eye(3), pose.translation + np.array([0.0, 0.3, 0.0]))
    clearance = sm.Clearance([sm.Sphere("ball", ahead, 0.05)], distance=0.01)
    replanner = Replanner(panda, constraints=[clearance])
    goal = pin.SE3(pose.rotation, pose.translation + np.array([0.0, 0.3, 0.0]))
    path = sm.Line(pose, goal, 2.0, time_law="minimum_jerk")
    segments, places = closed_loop(replanner, path, PANDA_HOME, 2.5)
    exact = sm.CollisionModel(panda, clearance.obstacles)
    assert min(exact.distance(q).value for q in places[::10]) > 0.0
    assert segments[-1].flag is Flag.STOPPING
    assert "ball" in segments[-1].reasons[-1]
    # It goes on when the way is free.
    t, q = 2.5, places[-1]
    for _ in range(250):
        free = {"ball": pin.SE3(np.eye(3), np.array([0.0, 0.0, 9.0]))}
        segment = replanner.step(t, q, np.zeros(7), path, free)
        t += replanner.period
        q = segment.q[segment.index(t)]
    assert sm.Task.POSE.miss(goal, panda.pose(q))[0] < 1e-4


def test_an_obstacle_that_is_not_known_is_refused(
    panda: sm.RobotModel, slow_circle: sm.Circle
) -> None:
    clearance = sm.Clearance([sm.Sphere("ball", np.array([0.0, 0.0, 9.0]), 0.05)])
    replanner = Replanner(panda, constraints=[clearance])
    with pytest.raises(sm.ProblemError, match="'bal'"):
        replanner.step(0.0, PANDA_HOME, np.zeros(7), slow_circle, {"bal": pin.SE3.Identity()})

"""Where a motion cannot be optimised from x = 0: what it is begun from instead."""

from dataclasses import replace

import numpy as np

import selfmotion as sm
from support.places import DATA


def test_a_ball_behind_the_elbow_is_passed_on_the_other_side(panda: sm.RobotModel) -> None:
    """From x = 0, from the free optimum and from the middle of the limits no step leads there."""
    start = np.array([-0.252, -0.844, 0.061, -2.569, -0.231, 1.467, 0.556])
    circle = sm.paths.Circle.around(panda.pose(start), 0.112, 4.0, normal=[-0.023, 0.138, -0.99])
    ball = sm.obstacles.Sphere("ball", [-0.363, 0.168, 0.281], 0.08)
    free = sm.Problem(panda, circle, start=start)
    asked = replace(free, constraints=[*free.constraints, sm.constraints.Clearance((ball,))])
    assert sm.plan(asked).certificate.verified
    # Where nothing stands there, the arm does not give way.
    assert sm.obstacles.CollisionModel(panda, (ball,)).worst(sm.plan(free).trajectory.q).value < 0.0


def test_a_motion_that_breaks_nothing_is_begun_with() -> None:
    """Where the one at x = 0 passes a limit, which costs less: all that counts keeps all limits."""
    robot = sm.load_robot("panda", tool="panda_hand")
    path = sm.paths.Waypoints.from_csv(DATA / "panda__1cube" / "path.csv")
    start = robot.inverse_kinematics(path.pose(0.0), seed=[0, -0.5, 0, -2, 0, 1.6, 0.8])
    plan = sm.plan(sm.Problem(robot, path, start=start))
    assert plan.certificate.verified
    still = plan.initial_trajectory.q
    assert ((still < robot.lower) | (still > robot.upper)).any()
    first = plan.report.history[0]
    assert plan.report.initial_cost < first.cost
    # From x = 0 it takes several times as many.
    assert len(plan.report.history) <= 15

"""A pull moves the elbow."""

import numpy as np

import selfmotion as sm
from selfmotion.basics import Array
from support.arms import PANDA_HOME


def circle(robot: sm.RobotModel, **options) -> sm.Problem:
    path = sm.Circle.around(robot.pose(PANDA_HOME), 0.1, 3.0)
    return sm.Problem(robot, path, start=PANDA_HOME, **options)


def along(plan: sm.Plan, coordinate: sm.Coordinate) -> Array:
    t = np.linspace(0.0, plan.path.duration, 4001)
    return coordinate(plan.robot, plan.trajectory(t))[0]


def test_a_pull_moves_the_elbow(panda: sm.RobotModel, tmp_path) -> None:
    swivel = sm.SwivelAngle()
    free = sm.plan(circle(panda))
    target = float(along(free, swivel)[-1]) + 0.5
    pull = sm.Towards(panda, swivel, target, 20.0)
    plan = sm.plan(circle(panda, costs=[sm.JointVelocity(), pull]))
    assert plan.certificate.verified, plan.certificate.verdict
    assert along(plan, swivel)[-1] > along(free, swivel)[-1] + 0.1
    plan.save(tmp_path / "plan.npz")
    assert sm.load_plan(tmp_path / "plan.npz").problem.costs[1].target == target
    sm.write_problem(plan.problem, tmp_path / "cell.toml")
    assert sm.read_problem(tmp_path / "cell.toml").costs[1].target == target

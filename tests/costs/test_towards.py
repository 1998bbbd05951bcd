"""A pull moves the elbow."""

import selfmotion as sm
from support.circles import coordinate_along, small_circle


def test_a_pull_moves_the_elbow(panda: sm.RobotModel, tmp_path) -> None:
    swivel = sm.robot.SwivelAngle()
    free = sm.plan(small_circle(panda))
    target = float(coordinate_along(free, swivel)[-1]) + 0.5
    pull = sm.costs.Towards(panda, swivel, target, 20.0)
    motion = sm.PolynomialNullMotion()
    plan = sm.plan(small_circle(panda, costs=[sm.costs.JointVelocity(), pull], null_motion=motion))
    assert plan.certificate.verified, plan.certificate.verdict
    assert coordinate_along(plan, swivel)[-1] > coordinate_along(free, swivel)[-1] + 0.1
    plan.save(tmp_path / "plan.npz")
    assert sm.load_plan(tmp_path / "plan.npz").problem.costs[1].target == target
    sm.files.write_problem(plan.problem, tmp_path / "cell.toml")
    assert sm.read_problem(tmp_path / "cell.toml").costs[1].target == target

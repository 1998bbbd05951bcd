"""The shortest chain of the search as the motion, verified."""

import numpy as np

import selfmotion as sm
from support.arms import robot_named
from support.paths import line_of


def test_the_shortest_motion_is_a_chain_that_keeps_all_between_its_nodes() -> None:
    robot = robot_named("panda")
    problem = sm.Problem(
        robot,
        line_of(robot, "position"),
        task="position",
        costs=[sm.costs.PathLength(smoothing=1e-3)],
        constraints=[sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()],
        rest=False,
    )
    search = sm.Search(mode="global", rng=0)
    plan = sm.plan(problem, search=search).require()
    assert isinstance(plan.report.null_motion, sm.motion.NodeNullMotion)
    steps = np.abs(np.diff(plan.trajectory(np.linspace(0.0, problem.path.duration, 2001)), axis=0))
    # What is smoothed and what is not differ by no more than δ for each joint.
    assert plan.report.cost <= steps.sum() <= plan.report.cost + robot.dof * 1e-3 * 2.0

"""Clearance: exact rows, kept on the real meshes, and no dearer than need be."""

from collections.abc import Callable

import numpy as np
import pytest

import selfmotion as sm
from support.arms import PANDA_HOME, short_line

Circle = Callable[..., sm.Problem]


LIMITS = (sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits())


def test_obstacles_are_avoided_on_the_real_meshes(panda: sm.RobotModel) -> None:
    """A box in the elbow's way: without the constraint the plan collides, with it it does not."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.1, 4.0, normal=(1.0, 0.0, 0.0))
    plain = sm.plan(sm.Problem(panda, path, start=PANDA_HOME))
    box = sm.obstacles.Box("box", np.array([0.0, -0.18, 0.62]), [0.1, 0.1, 0.1])
    model = sm.obstacles.CollisionModel(panda, (box,))
    assert model.worst(plain.trajectory.q).value < -0.005
    clearance = sm.constraints.Clearance((box,), 0.005)
    problem = sm.Problem(
        panda,
        path,
        start=PANDA_HOME,
        constraints=(*LIMITS, clearance),
    )
    plan = sm.plan(problem)
    assert plan.certificate.verified, plan.certificate.verdict
    assert plan.certificate.clearance is not None
    assert plan.certificate.clearance.value >= clearance.distance
    assert model.worst(plan.trajectory(np.linspace(0, 4, 301))).value >= clearance.distance


def test_clearance_of_an_arm_without_geometry_is_refused(planar: sm.RobotModel) -> None:
    start = planar.inverse_kinematics(planar.pose([0.3, 0.8, 0.5]), "planar")
    path = short_line(planar, start)
    with pytest.raises(
        sm.errors.ProblemError, match="planar_3r: a clearance is asked for, but its URDF"
    ):
        sm.Problem(planar, path, "planar", start, constraints=[sm.constraints.Clearance()])


def test_a_table_under_the_base_is_no_obstacle_to_it(panda_circle: Circle) -> None:
    table = sm.obstacles.Box("table", [0.0, 0.0, -0.05], [0.6, 0.6, 0.1])
    problem = panda_circle(constraints=[sm.constraints.Clearance([table], 1e-3)])
    assert sm.plan(problem).certificate.verified


def test_passing_closer_than_capsules_allow_costs_nothing(panda_circle: Circle) -> None:
    """A box a centimetre from the hulls on the best motion, well inside the capsules."""
    free = sm.plan(panda_circle())
    model = sm.obstacles.CollisionModel(free.robot)
    box = None
    for side in np.linspace(0.12, 0.4, 29):
        box = sm.obstacles.Box("near", [0.45, side, 0.75], [0.1, 0.1, 0.1])
        model = sm.obstacles.CollisionModel(free.robot, [box])
        if model.worst(free.trajectory.q).value > 0.01:
            break
    plan = sm.plan(panda_circle(constraints=[sm.constraints.Clearance([box], 5e-3)]))
    assert plan.certificate.verified
    assert plan.report.cost == pytest.approx(free.report.cost, rel=1e-3)

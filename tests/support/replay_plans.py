"""Plans to replay, made once per test run."""

from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin

import selfmotion as sm
from selfmotion.model.collision import Box, Capsule, Cylinder, Mesh, Sphere
from selfmotion.problem.constraints import Clearance


@cache
def planar_plan(mu: float = 1.0) -> sm.Plan:
    """The paper's sample problem, there and back in two seconds."""
    return sm.plan(sm.sample_problem(mu=mu, duration=2.0))


@cache
def arm_plan(name: str) -> sm.Plan:
    """A vertical circle of 6 cm in four seconds: small enough for the smallest arm."""
    robot = sm.load_robot(name)
    task = sm.Task.POSE if robot.dof > 6 else sm.Task.POSITION
    start = robot.dexterous_configuration(task)
    path = sm.paths.Circle.around(robot.pose(start), 0.06, 4.0, normal=(1.0, 0.0, 0.0))
    return sm.plan(sm.Problem(robot, path, task, start))


@cache
def two_seams() -> sm.Program:
    """A job of a Panda: two short seams beside a post, and the moves between."""
    down = np.diag([1.0, -1.0, -1.0])
    ends = [np.array([0.4, y, 0.3]) for y in (-0.1, 0.1)]
    ahead = np.array([0.1, 0.0, 0.0])
    seams = [
        sm.Seam(
            f"seam {k}",
            sm.paths.Line(pin.SE3(down, end), pin.SE3(down, end + ahead), 1.0),
            "pointing",
        )
        for k, end in enumerate(ends)
    ]
    clearance = sm.constraints.Clearance([sm.obstacles.Sphere("post", [0.8, 0.0, 0.2], 0.05)], 5e-3)
    home = np.array(sm.NAMED_ARMS["panda"].home)
    job = sm.plan_job(sm.load_robot("panda"), seams, start=home, branches=1, clearance=clearance)
    return job.require()


def shelf_plan() -> sm.Plan:
    """Panda's circle with one obstacle of each shape around it, none of them on it."""
    plan = arm_plan("panda")
    middle = plan.path.samples(np.linspace(0, plan.path.duration, 9)).translation.mean(axis=0)

    def at(*offset: float) -> np.ndarray:
        return middle + np.array(offset)

    file = plan.robot.geometry(pin.GeometryType.VISUAL).geometryObjects[0].meshPath
    obstacles = (
        Box("shelf", at(0.0, 0.0, -0.4), (0.3, 0.4, 0.02)),
        Sphere("ball", at(0.0, 0.5, 0.0), 0.05),
        Cylinder("post", at(0.3, -0.4, 0.0), 0.03, 0.4),
        Capsule("a/b", at(0.4, 0.1, 0.0), 0.02, 0.2),
        Mesh("part", at(0.8, 0.0, 0.0), file, 0.5),
    )
    return replace(plan, problem=replace(plan.problem, clearance=Clearance(obstacles)))

"""Problems that an arm may be asked to solve, at random."""

import numpy as np

import selfmotion as sm
from selfmotion.problem.constraints import NO_OVERLAP


def random_problem(robot: sm.RobotModel, rng: np.random.Generator) -> sm.Problem:
    """Return a problem that an arm may be asked to solve; not each can be solved."""
    while True:
        q = rng.uniform(
            0.6 * robot.lower + 0.4 * robot.upper, 0.4 * robot.lower + 0.6 * robot.upper
        )
        if np.linalg.svd(robot.task_jacobian(q, "pose"))[1][-1] > 0.08:
            break
    pose, seconds = robot.pose(q), rng.uniform(0.6, 4.0)
    kind = rng.integers(3)
    constraints: list[sm.constraints.Constraint] = [
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
        sm.constraints.JointAccelerationLimits(),
        sm.constraints.JointJerkLimits(),
    ]
    if kind == 0:
        end = pose.copy()
        end.translation = pose.translation + rng.normal(0.0, 0.12, 3)
        path: sm.paths.Path = sm.paths.Line(pose, end, seconds)
    elif kind == 1:
        path = sm.paths.Circle.around(
            pose, rng.uniform(0.03, 0.15), seconds, normal=rng.normal(size=3)
        )
        if rng.random() < 0.5:
            constraints.append(sm.constraints.ClosedPath())
    else:
        steps = rng.normal(0.0, 0.05, (5, 3))
        points = pose.translation + np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
        poses = []
        for point in points:
            there = pose.copy()
            there.translation = point
            poses.append(there)
        waypoints = sm.paths.Waypoints.from_poses(np.linspace(0.0, seconds, 6), poses)
        path = sm.paths.section_at_rest(waypoints, ramp=0.5)
    apart = NO_OVERLAP
    if rng.random() < 0.3:
        away = rng.normal(size=3)
        box = pose.translation + 0.35 * away / np.linalg.norm(away)
        apart = sm.constraints.Clearance(sm.obstacles.Box("box", box, [0.1, 0.1, 0.1]), 0.01)
    start = q if rng.random() < 0.5 else None
    return sm.Problem(robot, path, "pose", start, constraints=constraints, clearance=apart)

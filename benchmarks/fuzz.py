"""Plans many random reachable paths and lets an independent checker judge.

`make bench NAME=fuzz-paths`.

Each pose of a path can be reached by some configuration within the joint limits; whether one
continuous motion follows it within all limits is what planning has to find out. The
checker uses yourdfpy's kinematics instead of Pinocchio's and coal's distances on the meshes.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from typing import Annotated

import numpy as np
import pinocchio as pin
import typer
import yourdfpy
from rich.console import Console
from rich.progress import track

import selfmotion as sm
from selfmotion.basics import Array

# The checker's own tolerances: the plan's, and what yourdfpy and Pinocchio differ by.
POSITION, ROTATION, CLOSE = 1.1e-6, 1.5e-6, 1e-9


def reachable_path(robot: sm.RobotModel, rng: np.random.Generator) -> tuple[str, sm.paths.Path]:
    """Return a random path each pose of which (at 12 times) some configuration reaches."""
    while True:
        kind, path = random_path(robot, rng)
        try:
            for t in np.linspace(0.0, path.duration, 12):
                robot.inverse_kinematics(path.pose(float(t)), rng=0, attempts=30)
        except sm.errors.InverseKinematicsError:
            continue
        return kind, path


def random_path(robot: sm.RobotModel, rng: np.random.Generator) -> tuple[str, sm.paths.Path]:
    """Return a line, circle or spline that begins at the pose of a random configuration."""
    lower, upper = robot.finite_limits()
    q = lower + (upper - lower) * rng.uniform(0.15, 0.85, robot.dof)
    pose = robot.pose(q)
    kind = ("line", "circle", "spline")[rng.integers(3)]
    duration = float(rng.uniform(3.0, 6.0))
    if kind == "circle":
        normal = rng.normal(size=3)
        return kind, sm.paths.Circle.around(pose, rng.uniform(0.03, 0.12), duration, normal=normal)
    # Small joint moves keep the poses reachable; their poses need not lie on one joint motion.
    steps = rng.uniform(-0.25, 0.25, (1 if kind == "line" else 4, robot.dof))
    configurations = np.clip(q + np.cumsum(steps, axis=0), lower, upper)
    poses = [pose, *(robot.pose(x) for x in configurations)]
    if kind == "line":
        return kind, sm.paths.Line(pose, poses[1], duration)
    return kind, sm.paths.Waypoints.from_poses(np.linspace(0.0, 1.5 * duration, 5), poses)


class Checker:
    """Judges a motion without this package's kinematics."""

    def __init__(self, robot: sm.RobotModel) -> None:
        self._oracle = yourdfpy.URDF.load(
            robot.urdf.source, load_meshes=False, build_scene_graph=True
        )
        self._collision = sm.obstacles.CollisionModel(robot)
        self._robot = robot

    def refuses(self, plan: sm.Plan) -> str:
        """Return what is wrong with a plan at 400 times, or nothing."""
        motion, robot = plan.trajectory, self._robot
        if motion.duration < (1.0 - CLOSE) * plan.path.duration:
            return f"the motion ends at t = {motion.duration:.3f} s"
        t = np.linspace(0.0, motion.duration, 400)
        q = motion(t)
        for time_, x in zip(t, q, strict=True):
            actual = self._pose(x)
            wanted = plan.path.pose(float(time_)).homogeneous
            if np.linalg.norm(actual[:3, 3] - wanted[:3, 3]) > POSITION:
                return f"position at t = {time_:.3f} s"
            if np.linalg.norm(pin.log3(wanted[:3, :3] @ actual[:3, :3].T)) > ROTATION:
                return f"rotation at t = {time_:.3f} s"
        if np.any(q < robot.lower - CLOSE) or np.any(q > robot.upper + CLOSE):
            return "joint limits"
        if np.any(np.abs(motion(t, order=1)) > robot.velocity_limit * (1 + CLOSE)):
            return "velocity limits"
        if self._collision.worst(q).value <= 0.0:
            return "a collision"
        return ""

    def _pose(self, q: Array) -> Array:
        values = dict(zip(self._robot.joint_names, q, strict=True)) | dict(self._robot.locked)
        self._oracle.update_cfg([values[name] for name in self._oracle.actuated_joint_names])
        return np.asarray(self._oracle.get_transform(self._robot.tool, self._oracle.base_link))


def main(
    count: Annotated[int, typer.Option(help="How many paths.")] = 200,
    seed: Annotated[int, typer.Option(help="Of the first path.")] = 0,
) -> None:
    """Plan, check, and tell how often it worked and why not."""
    robot = sm.load_robot("panda")
    checker, console = Checker(robot), Console()
    outcomes, reasons = Counter[str](), []
    seconds = []
    constraints = (
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
    )
    apart = sm.constraints.Clearance((), 1e-3)
    for number in track(range(seed, seed + count), "paths", console=console, transient=True):
        kind, path = reachable_path(robot, np.random.default_rng(number))
        began = time.perf_counter()
        try:
            problem = sm.Problem(robot, path, constraints=constraints, clearance=apart)
            plan = sm.plan(problem)
        except sm.SelfmotionError as error:
            outcomes["no plan"] += 1
            reasons.append(f"{number} ({kind}): {error}")
            continue
        finally:
            seconds.append(time.perf_counter() - began)
        refused = checker.refuses(plan)
        if plan.certificate.verified and refused:
            outcomes["verified but refused"] += 1
            reasons.append(f"{number} ({kind}): REFUSED: {refused}")
        elif plan.certificate.verified:
            outcomes["verified"] += 1
        else:
            outcomes["not verified"] += 1
            reasons.append(f"{number} ({kind}): {plan.certificate.verdict}")
    for reason in reasons:
        console.print(reason, markup=False, soft_wrap=True)
    share = outcomes["verified"] / count
    console.print(
        f"{count} paths: {dict(outcomes)}; verified {100 * share:.1f} %; "
        f"{np.median(seconds):.2f} s each (median), {max(seconds):.1f} s at most"
    )
    sys.exit(0 if share >= 0.95 and not outcomes["verified but refused"] else 1)


if __name__ == "__main__":
    typer.run(main)

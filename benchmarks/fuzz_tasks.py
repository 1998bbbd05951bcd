"""Position and pointing tasks among boxes, judged by an independent checker.

`make bench NAME=fuzz-tasks`.

The tool's path is that of a random smooth joint motion of a Panda, which is then forgotten, and
which boxes come near: so there is a motion, and the boxes matter. The judge is that of the suite:
kinematics by yourdfpy and NumPy, bodies by coal, pair by pair.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from typing import Annotated

import numpy as np
import pinocchio as pin
import typer
from made import boxes_around
from rich.console import Console
from rich.progress import track
from scipy.interpolate import make_interp_spline
from suite_judge import SuiteJudge

import selfmotion as sm
from selfmotion.basics import Array

# The judge's tolerances: the plan's, and what two ways to compute them differ by [m, rad].
POSITION, ROTATION, CLOSE = 1.1e-6, 1.5e-6, 1e-9
# Moves of each joint between the knots of the known motion [rad], and how many knots.
MOVE, KNOTS = 0.35, 5
# Distances that the known motion keeps, and that is planned for [m].
APART, CLEARANCE = 2e-3, 1e-3
TIMES = 400


def known_motion(robot: sm.RobotModel, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return times (W,) and configurations (W, n) within the limits, clear of each other."""
    lower, upper = robot.finite_limits()
    model = sm.obstacles.CollisionModel(robot)
    while True:
        first = lower + (upper - lower) * rng.uniform(0.15, 0.85, robot.dof)
        knots = first + np.cumsum(rng.uniform(-MOVE, MOVE, (KNOTS, robot.dof)), axis=0)
        t = np.linspace(0.0, rng.uniform(3.0, 6.0), 61)
        spline = make_interp_spline(np.linspace(0.0, t[-1], KNOTS), knots)
        q = spline(t)
        inside = np.all((q > lower) & (q < upper))
        slow = np.all(np.abs(spline.derivative()(t)) < 0.9 * robot.velocity_limit)
        if inside and slow and model.worst(q).value > APART:
            return t, q


def problem_of(
    robot: sm.RobotModel, task: str, rng: np.random.Generator, count: int
) -> tuple[sm.Problem, SuiteJudge]:
    """Return a problem among boxes, and its judge."""
    t, q = known_motion(robot, rng)
    boxes = boxes_around(robot, (), q, rng, count)
    path = sm.paths.Waypoints.from_poses(t, [robot.pose(x) for x in q])
    obstacles = [sm.obstacles.Box(f"box{k}", *box) for k, box in enumerate(boxes)]
    constraints = [
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
    ]
    apart = sm.constraints.Clearance(obstacles, CLEARANCE)
    criteria = {
        "position_m": POSITION,
        "rotation_deg": np.degrees(ROTATION) if task == "pointing" else np.inf,
        "joint_step_deg": np.inf,
        "collision_free": True,
    }
    places = [(size, pin.SE3(np.eye(3), centre)) for centre, size in boxes]
    left_out = {frozenset(pair) for pair in robot.touching}
    judge = SuiteJudge(robot, places, left_out, criteria, "z" if task == "pointing" else None)
    return sm.Problem(robot, path, task, constraints=constraints, clearance=apart), judge


def refusal(plan: sm.Plan, judge: SuiteJudge) -> str:
    """Return what the judge says against a plan, at many times; "" for nothing."""
    motion, path = plan.trajectory, plan.path
    if motion.duration < (1.0 - CLOSE) * path.duration:
        return f"the motion ends at t = {motion.duration:.3f} s"
    t = np.linspace(0.0, motion.duration, TIMES)
    if np.any(np.abs(motion(t, 1)) > plan.robot.velocity_limit * (1.0 + CLOSE)):
        return "velocity limits"
    return judge.judge([path.pose(float(time)) for time in t], motion(t)).reason


def main(
    count: Annotated[int, typer.Option(help="How many paths.")] = 200,
    seed: Annotated[int, typer.Option(help="Of the first path.")] = 0,
    boxes: Annotated[int, typer.Option(help="Around each.")] = 4,
) -> None:
    """Plan, judge, and tell how often it worked and why not."""
    robot, console = sm.load_robot("panda"), Console()
    outcomes, seconds = Counter[str](), []
    for number in track(range(seed, seed + count), "paths", console=console, transient=True):
        task = ("position", "pointing")[number % 2]
        problem, judge = problem_of(robot, task, np.random.default_rng(number), boxes)
        began = time.process_time()
        try:
            plan = sm.plan(problem)
        except sm.SelfmotionError as error:
            outcomes["no plan"] += 1
            console.print(f"{number} ({task}): {error}", markup=False, soft_wrap=True)
            continue
        finally:
            seconds.append(time.process_time() - began)
        refused = refusal(plan, judge)
        verified = plan.certificate.verified
        outcome = "verified" if verified else "not verified"
        if verified and refused:
            outcome = "verified but refused"
        outcomes[outcome] += 1
        if outcome != "verified":
            why = refused or plan.certificate.verdict
            console.print(f"{number} ({task}): {outcome}: {why}", markup=False, soft_wrap=True)
    share = outcomes["verified"] / count
    console.print(
        f"{count} paths: {dict(outcomes)}; verified {100 * share:.1f} %; processor time "
        f"{np.median(seconds):.2f} s each (median), {max(seconds):.1f} s at most"
    )
    sys.exit(0 if share >= 0.95 and not outcomes["verified but refused"] else 1)


if __name__ == "__main__":
    typer.run(main)

"""How long a step of the replanner takes, 10,000 times, and what its short sight costs.

Times are those of the clock on the wall, and of the processor (what this thread alone was given,
which tells them from those of a machine that is busy with something else). Bare Pinocchio calls are
those for the Jacobians and poses of all stages and cycles of one step, made between the steps of
the same run.
"""

import argparse
import gc
import time

import numpy as np
import pinocchio as pin

import selfmotion as sm
from selfmotion.realtime import Replanner, warm_up

MISSES = (1.0, 2.0, 5.0, 10.0)
HOME = np.array(sm.NAMED_ARMS["panda"].home)


def obstacle(robot):
    """Return a clearance from a ball beside the arm."""
    away = sm.obstacles.Sphere(
        "ball", robot.pose(HOME).translation + np.array([0.0, 0.35, 0.0]), 0.1
    )
    return sm.constraints.Clearance([away], distance=0.02)


def others():
    """Return a clearance of the arm from itself, a band and limits of torques."""
    kinds = sm.constraints
    return kinds.Clearance(distance=0.0), kinds.Band.of_elbow("up", 0.3), kinds.JointTorqueLimits()


class Bare:
    """The Pinocchio calls of one step, and nothing else."""

    def __init__(self, robot, replanner):
        self._robot, self._data = robot, robot.model.createData()
        stages = len(replanner._horizon.grid.stage_times) + len(replanner._ahead) + 1
        self._q = HOME + 0.1 * np.random.default_rng(0).standard_normal((stages, robot.dof))

    def seconds(self):
        model, data, tool = self._robot.model, self._data, self._robot.chain.tip
        began = time.perf_counter()
        for q in self._q:
            pin.computeJointJacobians(model, data, q)
            pin.updateFramePlacement(model, data, tool)
        return time.perf_counter() - began


def timed(robot, task, steps, *, collect, constraints=(), null_motion=None, horizon=2.0, ahead=20):
    """Return wall and processor time of each step [s], and of the bare calls now and then."""
    replanner = Replanner(
        robot, task, (sm.costs.JointVelocity(),), constraints, horizon, null_motion, steps=ahead
    )
    warm_up(replanner)
    bare, rng = Bare(robot, replanner), np.random.default_rng(0)
    duration = steps * replanner.period
    path = sm.paths.Circle.around(
        robot.pose(HOME),
        0.1,
        duration,
        normal=(1, 0, 0),
        turns=duration / 8.0,
    )
    wall, own, calls = np.empty(steps), np.empty(steps), []
    t, q, qd = 0.0, HOME.copy(), np.zeros(robot.dof)
    moved = {}
    (gc.enable if collect else gc.disable)()
    for k in range(steps):
        if constraints:
            way = np.array([0.0, 0.35 + 0.1 * np.sin(t), 0.0])
            moved = {"ball": pin.SE3(np.eye(3), robot.pose(HOME).translation + way)}
        noisy = q + 5e-5 * rng.standard_normal(robot.dof)
        began, before = time.perf_counter(), time.thread_time()
        segment = replanner.step(t, noisy, qd, path, moved)
        own[k], wall[k] = time.thread_time() - before, time.perf_counter() - began
        t += replanner.period
        here = segment.index(t)
        q, qd = segment.q[here], segment.qd[here]
        if k % 10 == 0:
            calls.append(bare.seconds())
    gc.enable()
    return wall, own, np.array(calls)


def shown(values):
    """Return p50, p99, p99.9 and the worst, in ms."""
    return " / ".join(f"{1e3 * value:.2f}" for value in np.quantile(values, [0.5, 0.99, 0.999, 1]))


def latencies(robot, steps):
    """Print a table of latencies; return the times on the wall by name."""
    found = {}
    cases = {
        "pose": dict(task="pose"),
        "pose, no collection": dict(task="pose", collect=False),
        "position": dict(task="position"),
        "position, no collection": dict(task="position", collect=False),
        "position, spline of 6, 8 s": dict(
            task="position", null_motion=sm.motion.BSplineNullMotion(6), horizon=8.0, ahead=24
        ),
        "pose, ball that moves": dict(task="pose", constraints=[obstacle(robot)]),
        "position, ball that moves": dict(task="position", constraints=[obstacle(robot)]),
        "position, two clearances, elbow, torques": dict(
            task="position", constraints=[obstacle(robot), *others()]
        ),
    }
    print("| steps of | p50 / p99 / p99.9 / worst [ms] | processor time | × bare calls (p50, p99) |"
          " over 1, 2, 5, 10 ms |")  # fmt: skip
    print("| --- | --- | --- | --- | --- |")
    for name, options in cases.items():
        wall, own, calls = timed(robot, steps=steps, **{"collect": True, **options})
        found[name] = wall
        bare = np.median(calls)
        p50, p99 = np.quantile(wall, [0.5, 0.99]) / bare
        missed = ", ".join(f"{100 * np.mean(wall > 1e-3 * most):.2f} %" for most in MISSES)
        print(f"| {name} | {shown(wall)} | {shown(own)} | {p50:.1f}, {p99:.1f} (of "
              f"{1e3 * bare:.2f} ms) | {missed} |", flush=True)  # fmt: skip
    return found


def closed_loop(robot, task, costs, replanner, path, start):
    """Return the cost of the loop along a path from a start at rest, and how far it is off [m]."""
    replanner.reset()
    t, q, qd, places, rates, off = 0.0, start, np.zeros(robot.dof), [], [], 0.0
    for _ in range(round(path.duration / replanner.period)):
        segment = replanner.step(t, q, qd, path)
        off = max(off, segment.tool_error[0])
        t += replanner.period
        here = segment.index(t)
        places.append(segment.q[:here])
        rates.append(segment.qd[:here])
        q, qd = segment.q[here], segment.qd[here]
    places, rates = np.concatenate(places), np.concatenate(rates)
    times = replanner.cycle * np.arange(len(places))
    samples = sm.costs.Samples.along(
        sm.Follows.of(robot, path, task), sm.model.motion.Sampling.trapezoidal(times), places, rates
    )
    return sum(float(samples.weights @ cost.value(samples)) for cost in costs), off


def losses(robot, most):
    """Print what planning a few seconds ahead costs against planning all 20 s at once, of cases."""
    print("\n| 20 s, cost | pseudo-inverse | full plan | gain | 2 s ahead (tool off) |"
          " 8 s ahead (tool off) |")  # fmt: skip
    print("| --- | --- | --- | --- | --- | --- |")
    speed, near = sm.costs.JointVelocity(), sm.costs.InverseManipulability(mu=0.02)
    dexterous = robot.dexterous_configuration()
    cases = [
        ("pose, q̇²", "pose", (speed,), HOME, 0.2, (1, 0, 0)),
        ("position, q̇², level circle", "position", (speed,), HOME, 0.2, (0, 0, 1)),
        ("position, q̇², another start", "position", (speed,), dexterous, 0.2, (0, 0, 1)),
        ("pose, q̇² + 1/det", "pose", (speed, near), HOME, 0.15, (1, 0, 0)),
        ("position, q̇² + 1/det (the paper's)", "position", (speed, near), HOME, 0.15, (1, 0, 0)),
    ]
    for name, task, costs, start, radius, normal in cases[:most]:
        path = sm.paths.Circle.around(robot.pose(start), radius, 20.0, normal=normal)
        full = sm.plan(sm.Problem(robot, path, task, start, costs=costs, clearance=None)).report
        row = []
        for horizon, motion in ((2.0, None), (8.0, sm.motion.BSplineNullMotion(6))):
            replanner = Replanner(robot, task, costs, (), horizon, motion, steps=24)
            cost, off = closed_loop(robot, task, costs, replanner, path, start)
            row.append(f"{100 * (cost / full.cost - 1):+.2f} % ({1e3 * off:.2f} mm)")
        gain = 1 - full.cost / full.initial_cost
        print(f"| {name} | {full.initial_cost:.5g} | {full.cost:.5g} | {100 * gain:.1f} % | "
              f"{' | '.join(row)} |", flush=True)  # fmt: skip


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--steps", type=int, default=10_000)
    arguments.add_argument("--cases", type=int, help="of what short sight costs; all by default")
    given = arguments.parse_args()
    robot = sm.load_robot("panda")
    latencies(robot, given.steps)
    losses(robot, given.cases)


if __name__ == "__main__":
    main()

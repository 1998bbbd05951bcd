"""How near the fastest paces are to the optimum, of 60 joint paths; and what of limits they use.

20 straight lines that a Panda was planned along, 20 paths with rounded corners (UR5, UR10, Panda:
rows of panels and random legs), 20 random joint splines. Of each: the time at the fastest pace,
that of linear programmes on a fine grid over the joint path, solved by HiGHS (`least_times`, which
shares no code with ours), and the share of the time during which some limit is used by 90 %. Each
motion is looked at 1,000 times a second. With --jerk, jerks are limited as well.
"""

import argparse
import sys
import time
from collections.abc import Iterator

import numpy as np
from least_times import least_time, least_time_with_jerk
from random_problems import random_problem
from scipy.interpolate import CubicSpline

import selfmotion as sm
from selfmotion.basics import one_blas_thread
from selfmotion.model.motion import Trajectory
from selfmotion.planning.result import Ends, PaceLimits, along, fastest_pace

# Intervals of the grids without limits of the jerk and with them.
GRID, GRID_OF_JERKS = 3000, 1000
# How much longer than the optimum a pace may be, likewise.
LONGER, LONGER_BY_JERKS = 1.02, 1.05


def planned_lines(count: int) -> Iterator[tuple[str, Trajectory]]:
    """Yield motions of a Panda along straight lines."""
    robot, rng = sm.load_robot("panda"), np.random.default_rng(3)
    while count:
        problem = random_problem(robot, rng)
        if not isinstance(problem.path, sm.paths.Line):
            continue
        only = (sm.constraints.JointPositionLimits(),)
        try:
            found = sm.plan(
                sm.Problem(robot, problem.path, "pose", problem.start, constraints=only)
            )
        except sm.SelfmotionError:
            continue
        if found.certificate.on_path and not found.report.ending:
            count -= 1
            yield "line", found.trajectory


def cornered(count: int) -> Iterator[tuple[str, Trajectory]]:
    """Yield motions through rounded corners: of rows, and of legs at random."""
    rng = np.random.default_rng(4)
    while count:
        robot = sm.load_robot(("ur5", "ur10", "panda")[count % 3])
        start = robot.dexterous_configuration()
        pose = robot.pose(start)
        if count % 2:
            rows, wide, apart = (
                int(rng.integers(2, 7)),
                rng.uniform(0.1, 0.25),
                rng.uniform(0.02, 0.05),
            )
            legs = [(0, wide * ((k + 1) // 2 % 2), apart * (k // 2)) for k in range(2 * rows)]
            points = pose.translation + np.array(legs)
        else:
            steps = rng.normal(0.0, 0.06, (int(rng.integers(3, 8)), 3))
            points = pose.translation + np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
        only = (sm.constraints.JointPositionLimits(),)
        try:
            path = sm.paths.Feed(sm.paths.Polyline(points, tolerance=rng.uniform(1e-3, 5e-3)), 0.1)
            found = sm.plan(sm.Problem(robot, path, "position", start, constraints=only))
        except sm.SelfmotionError:
            continue
        if found.certificate.on_path and not found.report.ending:
            count -= 1
            yield "corners", found.trajectory


def splines(count: int) -> Iterator[tuple[str, Trajectory]]:
    """Yield motions of seven joints through random configurations."""
    rng = np.random.default_rng(5)
    names = tuple(f"joint {k}" for k in range(7))
    for _ in range(count):
        knots = np.arange(int(rng.integers(4, 10)), dtype=float)
        spline = CubicSpline(knots, rng.normal(0.0, 0.5, (len(knots), 7)))
        t = np.linspace(0.0, knots[-1], 40 * len(knots))
        yield "spline", Trajectory(t, spline(t), spline(t, 1), names, spline(t, 2))


def checked(motion: Trajectory, limits: PaceLimits) -> tuple[bool, float]:
    """Return whether limits are kept at 1 kHz, and how long one is used by 90 %."""
    t = np.append(np.arange(0.0, motion.duration, 1e-3), motion.duration)
    used = np.concatenate(limits.shares_at(motion, t), axis=1).max(axis=1)
    return bool(used.max() <= 1.0), float(np.mean(used >= 0.9))


def optimum(motion: Trajectory, limits: PaceLimits) -> float:
    """Return the least time of a joint path within limits, on a fine grid."""
    v, a, jerk = limits.of_orders
    if np.isfinite(jerk).all():
        return least_time_with_jerk(motion, v, a, jerk, GRID_OF_JERKS)
    return least_time(motion, v, a, GRID)


def main() -> int:
    """Print a row for each path and the medians; 1 where one is far from its optimum."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20, help="paths of each kind")
    parser.add_argument("--jerk", type=float, default=np.inf, help="of each joint [rad/s³]")
    options = parser.parse_args()
    count, rows = options.count, []
    print("kind      samples  ours [s]  optimum [s]  ratio  used >= 90 %  CPU [s]  kept")
    for kind, motion in (*planned_lines(count), *cornered(count), *splines(count)):
        n = motion.q.shape[1]
        limits = PaceLimits(np.full(n, 1.5), np.full(n, 8.0), np.full(n, options.jerk))
        began = time.process_time()
        with one_blas_thread():
            pace = fastest_pace(motion, limits, Ends(), 4e-3)
        seconds = time.process_time() - began
        fast = along(pace, motion)
        kept, busy = checked(fast, limits)
        try:
            best = optimum(motion, limits)
        except RuntimeError as error:
            print(f"{kind:<9} {len(fast.t):7} {fast.duration:9.3f} not judged: {error}", flush=True)
            continue
        rows.append((fast.duration / best, busy, kept, seconds))
        print(
            f"{kind:<9} {len(fast.t):7} {fast.duration:9.3f} {best:12.3f} "
            f"{fast.duration / best:6.4f} {busy:13.3f} {seconds:8.2f}  {kept}",
            flush=True,
        )
    ratio, busy, kept, seconds = (np.array(column) for column in zip(*rows, strict=True))
    print(
        f"{len(rows)} paths: at most {ratio.max():.4f} of the optimum, {np.median(ratio):.4f} in "
        f"the median; some limit is used by 90 % during {np.median(busy):.1%} of the time in the "
        f"median, {busy.min():.1%} at least; {int(kept.sum())} kept at 1 kHz; "
        f"{np.median(seconds):.2f} s of processor time in the median"
    )
    longer = LONGER_BY_JERKS if np.isfinite(options.jerk) else LONGER
    return int(ratio.max() > longer or not kept.all())


if __name__ == "__main__":
    sys.exit(main())

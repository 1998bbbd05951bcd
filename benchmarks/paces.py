"""How near the fastest paces are to the optimum, of 60 joint paths; and what of limits they use.

20 straight lines that a Panda was planned along, 20 paths with rounded corners (UR5, UR10, Panda:
rows of panels and random legs), 20 random joint splines. Of each: the time at the fastest pace,
that of a linear programme on a fine grid over the length of the joint path, solved by HiGHS, which
shares no code with ours, and the share of the time during which some limit is used by 90 %. Each
motion is looked at 1,000 times a second.
"""

import argparse
import sys
import time
from collections.abc import Iterator

import numpy as np
from random_problems import random_problem
from scipy.interpolate import CubicSpline
from scipy.optimize import linprog
from scipy.sparse import coo_array, csr_array, vstack

import selfmotion as sm
from selfmotion.basics import Array, one_blas_thread
from selfmotion.motion import Trajectory
from selfmotion.result.pace_rows import PaceLimits
from selfmotion.result.pacing import Ends, along, fastest_pace

GRID = 3000


def planned_lines(count: int) -> Iterator[tuple[str, Trajectory]]:
    """Yield motions of a Panda along straight lines."""
    robot, rng = sm.load_robot("panda"), np.random.default_rng(3)
    while count:
        problem = random_problem(robot, rng)
        if not isinstance(problem.path, sm.Line):
            continue
        only = (sm.JointPositionLimits(),)
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
        only = (sm.JointPositionLimits(),)
        try:
            path = sm.Feed(sm.Polyline(points, tolerance=rng.uniform(1e-3, 5e-3)), 0.1)
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


def gridded(motion: Trajectory, count: int) -> tuple[Array, Array, Array, Array]:
    """Return a grid over the length of a joint path, and q' to q''' on it."""
    q = motion(np.linspace(motion.t[0], motion.t[-1], 50001))
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1)))
    keep = np.append(True, np.diff(length) > 1e-12)
    path = CubicSpline(length[keep], q[keep])
    s = np.linspace(0.0, length[-1], count + 1)
    return s, path(s, 1), path(s, 2), path(s, 3)


def acceleration_rows(first: Array, second: Array, h: float) -> csr_array:
    """Return q'' b + ½ q' b' at both ends of each interval, b linear in between."""
    count, n = first.shape
    k = np.arange(count - 1)
    blocks = []
    for at in (k, k + 1):
        rows = np.arange((count - 1) * n).reshape(-1, n)
        slope = first[at] / (2.0 * h)
        table = coo_array(
            (
                np.concatenate([(-slope).ravel(), slope.ravel(), second[at].ravel()]),
                (
                    np.tile(rows.ravel(), 3),
                    np.repeat(np.concatenate([k, k + 1, at]), n),
                ),
            ),
            shape=((count - 1) * n, count),
        )
        blocks.append(table.tocsr())
    return vstack(blocks, format="csr")


def least_time(motion: Trajectory, velocity: Array, acceleration: Array) -> float:
    """Return the least time by limits of velocity and acceleration on the grid."""
    s, first, second, _ = gridded(motion, GRID)
    rows = acceleration_rows(first, second, s[1])
    most = (velocity / np.maximum(np.abs(first), 1e-12)).min(axis=1) ** 2
    most[[0, -1]] = 0.0
    right = np.tile(acceleration, rows.shape[0] // len(acceleration))
    found = linprog(
        -np.ones(len(s)),
        A_ub=vstack([rows, -rows], format="csr"),
        b_ub=np.concatenate([right, right]),
        bounds=np.column_stack([np.zeros(len(s)), most]),
        method="highs",
    )
    return time_of(s, found.x)


def time_of(s: Array, b: Array) -> float:
    """Return the time of a way at squared rates that are linear in between."""
    rate = np.sqrt(np.maximum(b, 0.0))
    return float((2.0 * np.diff(s) / (rate[1:] + rate[:-1])).sum())


def checked(motion: Trajectory, limits: PaceLimits) -> tuple[bool, float]:
    """Return whether limits are kept at 1 kHz, and how long one is used by 90 %."""
    t = np.append(np.arange(0.0, motion.duration, 1e-3), motion.duration)
    used = np.concatenate(limits.shares_at(motion, t), axis=1).max(axis=1)
    return bool(used.max() <= 1.0), float(np.mean(used >= 0.9))


def main() -> int:
    """Print a row for each path and the medians; 1 where one is far from its optimum."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20, help="paths of each kind")
    count = parser.parse_args().count
    rows = []
    print("kind      samples  ours [s]  optimum [s]  ratio  used >= 90 %  CPU [s]  kept")
    for kind, motion in (*planned_lines(count), *cornered(count), *splines(count)):
        n = motion.q.shape[1]
        velocity, acceleration = np.full(n, 1.5), np.full(n, 8.0)
        limits = PaceLimits(velocity, acceleration, np.full(n, np.inf))
        began = time.process_time()
        with one_blas_thread():
            pace = fastest_pace(motion, limits, Ends(), 4e-3)
        seconds = time.process_time() - began
        fast = along(pace, motion)
        kept, busy = checked(fast, limits)
        best = least_time(motion, velocity, acceleration)
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
    return int(ratio.max() > 1.02 or not kept.all())


if __name__ == "__main__":
    sys.exit(main())

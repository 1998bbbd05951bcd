"""How much faster the fastest motion is than others at their fastest; and retiming.

Random lines, circles and splines of a Panda with the limits that its maker publishes. Of each: the
time of the motion x = 0 retimed, that of the default plan retimed, that of `fastest`, and what the
certificate says. Then
plans with a free start on circles, retimed: all have to be verified.
"""

import argparse
import sys
import time

import numpy as np
from random_problems import random_problem

import selfmotion as sm


def fastest_motions(count: int) -> list[float]:
    """Print a row for each path that can be driven; return times as shares of the default's."""
    robot, rng, shares = sm.load_robot("panda"), np.random.default_rng(7), []
    print("  path        x = 0 [s]  default [s]  fastest [s]   share  rounds  CPU [s]  verified")
    number = 0
    while len(shares) < count:
        number += 1
        problem = random_problem(robot, rng)
        if problem.start is None or any(item.obstacles for item in problem.clearances):
            continue
        began = time.process_time()
        try:
            found = sm.fastest(problem)
        except sm.SelfmotionError as error:
            print(f"  {number:>4} {type(problem.path).__name__:<8} refused: {error}")
            continue
        if not np.isfinite(found.retimed):
            print(f"  {number:>4} {type(problem.path).__name__:<8} no default plan to compare with")
            continue
        shares.append(found.duration / found.retimed)
        print(
            f"  {number:>4} {type(problem.path).__name__:<8} {found.pseudo_inverse:8.3f} "
            f"{found.retimed:12.3f} {found.duration:12.3f} {shares[-1]:7.3f} "
            f"{len(found.times):7} {time.process_time() - began:8.1f}  "
            f"{found.plan.certificate.verified}",
            flush=True,
        )
    return shares


def retimed_circles() -> tuple[int, int]:
    """Return how many of the retimed free-start circles are verified, and how many there are."""
    robot, verified, total = sm.load_robot("panda"), 0, 0
    start = robot.pose(np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]))
    for radius in (0.05, 0.1, 0.12):
        for normal in np.eye(3):
            for share in (0.3, 1.0):
                path = sm.paths.Circle.around(start, radius, 4.0, normal=normal)
                plan = sm.plan(sm.Problem(robot, path), search=sm.Search(rng=total))
                retimed = sm.retime(plan, share * robot.acceleration_limit)
                verified += retimed.certificate.verified
                total += 1
    return verified, total


def main() -> int:
    """Print both tables; 1 where a motion is slower than the pseudo-inverse's, or one fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20, help="paths")
    shares = np.array(fastest_motions(parser.parse_args().count))
    gain = 100.0 * (1.0 - np.median(shares))
    print(
        f"{len(shares)} paths: {gain:.1f} % faster than the default plan, retimed, in the median, "
        f"{100.0 * (1.0 - shares.min()):.1f} % at most; worst {shares.max():.3f} of it"
    )
    verified, total = retimed_circles()
    print(f"{verified} of {total} retimed plans with a free start verified")
    return int(shares.max() > 1.0 + 1e-9 or verified < total)


if __name__ == "__main__":
    sys.exit(main())

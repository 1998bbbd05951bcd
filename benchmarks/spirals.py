"""Long work, as in printing and polishing: loops of a spiral, from a few to an hour of them.

A Panda draws loops of six seconds in one plane, of a radius that grows from 20 to 120 mm, the
orientation of its tool free, the start free. Prints for each number of loops whether the motion is
verified, what a loop costs, and what planning takes.
"""

import argparse
import resource
import sys
import time

import numpy as np

import selfmotion as sm

LOOPS = (5, 20, 60, 150, 600)
# Of a loop [s], and radii [m].
PERIOD, RADII = 6.0, (0.02, 0.12)


def spiral(loops: int, waypoints: int) -> sm.Problem:
    """Return so many loops of so many waypoints each."""
    panda = sm.load_robot("panda")
    middle = panda.pose(panda.dexterous_configuration("position")).translation
    share = np.linspace(0.0, 1.0, waypoints * loops + 1)
    angle, radius = 2.0 * np.pi * loops * share, np.interp(share, (0.0, 1.0), RADII)
    flat = np.zeros_like(share)
    around = np.stack([radius * np.cos(angle), radius * np.sin(angle), flat], axis=1)
    return sm.Problem(
        panda, sm.paths.Waypoints(PERIOD * loops * share, middle + around), "position"
    )


def main() -> int:
    """Print a row for each; return 1 where one is not verified."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("loops", help="how many, by default several", type=int, nargs="*")
    parser.add_argument("--waypoints", help="of a loop", type=int, default=40)
    chosen = parser.parse_args()
    sm.plan(spiral(2, chosen.waypoints))
    failed = 0
    print("loops  waypoints     cost of a loop      time  peak memory")
    for loops in chosen.loops or LOOPS:
        problem = spiral(loops, chosen.waypoints)
        began = time.process_time()
        plan = sm.plan(problem)
        seconds = time.process_time() - began
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
        failed += not plan.certificate.verified
        print(
            f"{loops:5d}  {loops * chosen.waypoints:9d}  {plan.report.cost / loops:17.5f}  "
            f"{seconds:6.1f} s  {memory:8.0f} MB  {plan.certificate.verdict}",
            flush=True,
        )
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())

"""Whether an arm's controller would run what the planner calls verified.

Random tool motions of a Panda and an xArm7 (lines, circles, splines; free and given starts; some
closed, some among boxes), planned with the defaults; each verified plan is driven at 1 kHz from
standstill to standstill, and speed, acceleration and jerk by finite differences are held against
the limits that the makers publish. Also: what resting at the ends costs.
"""

import argparse
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
from random_problems import random_problem

import selfmotion as sm

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from support.acceptance import LIMITS, commanded, shares


def main() -> int:
    """Run and print a table; 1 where a verified plan would be refused."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    refused = 0
    for name, limits in LIMITS.items():
        robot, rng = sm.load_robot(name), np.random.default_rng(options.seed)
        worst, dearer, reasons = np.zeros(3), [], Counter()
        for number in range(options.count):
            problem = random_problem(robot, rng)
            try:
                plan = sm.plan(problem)
            except sm.SelfmotionError as error:
                reasons[type(error).__name__] += 1
                print(f"{name} {number}: {error}")
                continue
            if not plan.certificate.verified:
                reasons["not verified"] += 1
                print(f"{name} {number}: {plan.certificate.verdict}")
                continue
            motion = plan.trajectory
            used = shares(commanded(motion.t, motion.q, motion.qd, motion.qdd), limits)
            worst = np.maximum(worst, used)
            if used.max() > 1.0:
                refused += 1
                print(f"{name} {number}: verified, but uses {used} of its limits")
            moving = sm.plan(replace(problem, rest=False))
            if moving.certificate.verified:
                dearer.append(plan.report.cost / moving.report.cost - 1.0)
        verified = options.count - sum(reasons.values())
        print(
            f"{name}: {verified} of {options.count} verified ({dict(reasons)}); largest shares of "
            f"the limits of speed {worst[0]:.3f}, acceleration {worst[1]:.3f}, jerk {worst[2]:.3f};"
            f" resting at the ends costs {100 * np.median(dearer):.3f} % (median), "
            f"{100 * np.quantile(dearer, 0.95):.2f} % (95 of 100)"
        )
    print(f"verified plans that a controller would refuse: {refused}")
    return 1 if refused else 0


if __name__ == "__main__":
    raise SystemExit(main())

"""Random scenarios for the loop: pushes, late steps, jumps of the target, faults; quantities.

With `--far` it looks 8 s ahead instead of 2 s.
"""

import argparse
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import selfmotion as sm
from selfmotion.realtime import Replanner
from support import (
    realtime_bodies as bodies,
    realtime_quantities as quantities,
    realtime_scenarios as scenarios,
)

# One scenario in this number has a ball that jumps about the tool's way, the one before it
# quantities: torques, a tilt, an elbow, the tool's limits, each alone and all together.
EVERY = 5
KINDS = [*((kind,) for kind in quantities.KINDS), tuple(quantities.KINDS)]
TASKS = ("pose", "position", "pointing")
FAR = {"horizon": 8.0, "null_motion": sm.motion.BSplineNullMotion(6), "steps": 24}


@cache
def loop(task, far):
    robot = sm.load_robot("panda")
    return robot, Replanner(robot, task, **(FAR if far else {}))


@cache
def among_bodies():
    return bodies.looped()


@cache
def with_quantities(kinds):
    return quantities.looped(*kinds)


def judged(seed, far):
    """Return what the scenario of a seed showed; two of five are among bodies, or of quantities."""
    if seed % EVERY == EVERY - 1:
        return scenarios.Outcome(seed, bodies.faults(seed, among_bodies()))
    if seed % EVERY == EVERY - 2:
        kinds = KINDS[seed // EVERY % len(KINDS)]
        return scenarios.Outcome(seed, quantities.faults(seed, kinds, with_quantities(kinds)))
    task = TASKS[seed % len(TASKS)]
    return scenarios.run(seed, task, *loop(task, far))


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--count", type=int, default=1000)
    arguments.add_argument("--first", type=int, default=0)
    arguments.add_argument("--workers", type=int, default=2)
    arguments.add_argument("--far", action="store_true")
    given = arguments.parse_args()
    seeds = range(given.first, given.first + given.count)
    flags, broken, slowest = Counter(), [], []
    with ProcessPoolExecutor(given.workers) as pool:
        for outcome in pool.map(partial(judged, far=given.far), seeds, chunksize=10):
            flags.update({flag.value: count for flag, count in outcome.flags.items()})
            slowest.append(outcome.slowest)
            if outcome.faults:
                broken.append(outcome.seed)
                print(f"seed {outcome.seed}: {'; '.join(outcome.faults)}", flush=True)
            if len(slowest) % 100 == 0:
                print(f"… {len(slowest)}", flush=True)
    print(f"{len(seeds)} scenarios, {sum(flags.values())} segments: "
          f"{', '.join(f'{count} {name}' for name, count in flags.items())}")  # fmt: skip
    print(f"back within {scenarios.BACK * 1e3:g} mm: the slowest took {max(slowest):.2f} s of the "
          f"{scenarios.TIME_TO_COME_BACK:g} s allowed")  # fmt: skip
    print(f"{len(broken)} broke a law")
    sys.exit(bool(broken))


if __name__ == "__main__":
    main()

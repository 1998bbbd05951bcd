"""Long rasters that no single motion follows: in how many parts, and how long planning takes.

Ten rows of 70 poses around an arm's base, the tool down: round and round in one sense, so that
joints wind up, or there and back. Prints for each the parts, whether all of it is verified, and the
time that it took.
"""

import argparse
import sys
import time

import numpy as np

import selfmotion as sm

ROWS, POSES = 10, 70
# Of the tool along the path [m/s] and [m/s²], and how far corners are rounded [m].
FEED, ACCELERATION, ROUNDED = 0.25, 2.0, 5e-3
# What one should take at most [s].
ASKED = 20.0


def around(nearest: float, farthest: float, winds: bool) -> np.ndarray:
    """Return places (ROWS · POSES, 3) around the base at these radii [m]."""
    places = []
    for row, radius in enumerate(np.linspace(nearest, farthest, ROWS)):
        if winds:
            angles = 2.0 * np.pi * (row + np.arange(POSES) / POSES) - np.pi
            radii = radius + (farthest - nearest) / (ROWS - 1) * np.arange(POSES) / POSES
        else:
            angles, radii = np.linspace(-3.1, 3.1, POSES)[:: (-1) ** row], np.full(POSES, radius)
        height = np.full(POSES, 0.3)
        places.append(np.stack([radii * np.cos(angles), radii * np.sin(angles), height], axis=1))
    return np.concatenate(places)


def rasters() -> dict[str, sm.Problem]:
    """Return the problems by name."""
    cases = {
        "Panda, winding": ("panda", "pose", around(0.4, 0.6, True)),
        "Panda, winding, any yaw": ("panda", "pointing", around(0.4, 0.6, True)),
        "Panda, there and back": ("panda", "pose", around(0.4, 0.6, False)),
        "UR10, winding, any yaw": ("ur10", "pointing", around(0.4, 0.7, True)),
    }
    down = np.tile([0.0, 1.0, 0.0, 0.0], (ROWS * POSES, 1))
    return {
        name: sm.Problem(
            sm.load_robot(arm),
            sm.paths.Feed(
                sm.paths.Polyline(places, down, tolerance=ROUNDED), FEED, acceleration=ACCELERATION
            ),
            task,
        )
        for name, (arm, task, places) in cases.items()
    }


def main() -> int:
    """Print a row for each; return 1 where one is not verified."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", help="of which the name has this in it", default="")
    chosen = parser.parse_args().only
    print("raster                    poses  path [s]  parts  CPU [s]  wall [s]  verified")
    # What is compiled on first use is no part of it.
    sm.plan_in_parts(next(iter(rasters().values()))) if not chosen else None
    wrong = 0
    for name, problem in rasters().items():
        if chosen not in name:
            continue
        began, clock = time.process_time(), time.perf_counter()
        parts = sm.plan_in_parts(problem)
        wrong += not parts.verified
        print(
            f"{name:<25} {ROWS * POSES:5} {problem.path.duration:9.1f} {len(parts.plans):6} "
            f"{time.process_time() - began:8.1f} {time.perf_counter() - clock:9.1f}  "
            f"{parts.verified}",
            flush=True,
        )
    print(f"asked: at most {ASKED:.0f} s each")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())

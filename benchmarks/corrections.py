"""How far a part may stand elsewhere when it is planned again: `make bench-corrections`.

Random plans among bodies, as in `margins.py`. Of each, how far the part may be moved and turned is
looked for at the corners; then it is planned again for random displacements within that, in any
direction, which no corner is. Prints how many of these are verified, how many of them by a motion
that is not near the plan's, and what takes how long.
"""

from __future__ import annotations

import sys
import time
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

import selfmotion as sm
from margins import ARMS, random_plan
from selfmotion.placement.corners import _far, _standing
from selfmotion.placement.places import COORDINATES, places_of

# No larger corrections are looked at [m], [rad].
FARTHEST, TURNED = 0.05, 0.15


def main(
    count: Annotated[int, typer.Option(help="How many plans.")] = 100,
    displacements: Annotated[int, typer.Option(help="Of each plan.")] = 20,
    seed: Annotated[int, typer.Option(help="Of the first plan.")] = 0,
) -> None:
    """Look for corrections, and plan again within them."""
    console = Console()
    arms = [(sm.load_robot(name), task) for name, task in ARMS]
    made, failed, far, planned, sizes, seconds = 0, 0, 0, 0, [], []
    number = seed
    while made < count:
        rng = np.random.default_rng([41, number])
        number += 1
        plan = random_plan(rng, arms)
        if plan is None or not plan.certificate.verified:
            continue
        began = time.process_time()
        found = sm.correction(plan, farthest=FARTHEST, most_turned=TURNED)
        seconds.append(time.process_time() - began)
        made += 1
        sizes.append((found.translation.size, found.rotation.size))
        places = places_of([plan.problem], "part", _standing(plan), None, COORDINATES)
        for k in range(displacements):
            way = np.zeros(6)
            direction = rng.normal(size=3)
            direction *= rng.uniform() ** (1.0 / 3.0) / np.linalg.norm(direction)
            side = found.translation if k % 2 == 0 else found.rotation
            way[slice(0, 3) if k % 2 == 0 else slice(3, 6)] = side.size * direction
            tried = places.corrected(way, (plan,))
            planned += 1
            if tried.reason:
                failed += 1
                told = f"plan {number - 1}: {np.round(way, 4)}: {tried.reason}"
                console.print(told, highlight=False, soft_wrap=True)
            else:
                far += bool(_far(plan, tried))
    moved, turned = np.median(np.array(sizes), axis=0)
    console.print(
        f"{made} plans, {planned} displacements planned again, {failed} not verified, {far} "
        f"verified by a motion that is not near; "
        f"{1e3 * moved:.3g} mm and {np.degrees(turned):.3g}° in the median; "
        f"{np.median(seconds):.1f} s for one (median), {max(seconds):.1f} s at most",
        highlight=False,
        soft_wrap=True,
    )
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    typer.run(main)

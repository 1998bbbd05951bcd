"""How far a part may stand elsewhere when it is planned again: `make bench NAME=corrections`.

Random plans among bodies, as in `margins.py`. Of each, how far the part may be moved and turned is
looked for at the corners; then it is planned again for random displacements within that, in any
direction, which no corner is. Prints how many of these are verified, how many of them only where
planning begins anew, or by a motion that is not near the plan's, and what takes how long. What is
claimed is held against the largest multiple of it for which the same displacements are verified.
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
from selfmotion.problem.problem import start_on_path
from selfmotion.work.placement import Tried
from selfmotion.work.placement.correction_range import _difference, _fixed_obstacles
from selfmotion.work.placement.places import COORDINATES, Places, places_of

# No larger corrections are looked at [m], [rad].
FARTHEST, TURNED = 0.05, 0.15
# A true correction that is larger than this multiple of what is claimed is not looked for.
MOST = 3.0
# Of every so many plans it is looked for.
SHARED = 4


def planned_anew(places: Places, way: np.ndarray, plan: sm.Plan) -> Tried:
    """Return what becomes of a place where all starts are tried."""
    (problem,) = places.at(way)
    if plan.problem.given_start is not None:
        problem = problem.changed(start=start_on_path(problem.follows, plan.problem.given_start))
    try:
        found = sm.plan(problem, deadline=20.0)
    except sm.SelfmotionError as error:
        return Tried(way, np.inf, str(error))
    told = "" if found.certificate.verified else found.certificate.verdict
    return Tried(way, found.report.cost, told, (found,))


def true_scale(places: Places, plan: sm.Plan, ways: np.ndarray) -> float:
    """Return by what displacements (K, 6) may be multiplied until one of them is not planned."""
    low, high = 1.0, MOST
    while high > 1.05 * low:
        scale = float(np.sqrt(low * high))
        tried = (places.corrected(scale * way, (plan,)) for way in ways)
        fails = any(each.reason or _difference(plan, each) for each in tried)
        low, high = (low, scale) if fails else (scale, high)
    return low


def main(
    count: Annotated[int, typer.Option(help="How many plans.")] = 100,
    displacements: Annotated[int, typer.Option(help="Of each plan.")] = 20,
    seed: Annotated[int, typer.Option(help="Of the first plan.")] = 0,
) -> None:
    """Look for corrections, and plan again within them."""
    console = Console()
    arms = [(sm.load_robot(name), task) for name, task in ARMS]
    made, failed, anew, far, planned, sizes, seconds, shares = 0, 0, 0, 0, 0, [], [], []
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
        places = places_of([plan.problem], "part", _fixed_obstacles(plan), None, COORDINATES)
        for k in range(displacements):
            way = np.zeros(6)
            direction = rng.normal(size=3)
            direction *= rng.uniform() ** (1.0 / 3.0) / np.linalg.norm(direction)
            side = found.translation if k % 2 == 0 else found.rotation
            way[slice(0, 3) if k % 2 == 0 else slice(3, 6)] = side.size * direction
            tried = places.corrected(way, (plan,))
            planned += 1
            if tried.reason:
                tried = planned_anew(places, way, plan)
                anew += not tried.reason
            if tried.reason:
                failed += 1
                told = f"plan {number - 1}: {np.round(way, 4)}: {tried.reason}"
                console.print(told, highlight=False, soft_wrap=True)
            else:
                far += bool(_difference(plan, tried))
        for rows, side in ((slice(0, 3), found.translation), (slice(3, 6), found.rotation)):
            # What was not looked at farther is not held against anything.
            if side.size > 0.0 and side.stops and number % SHARED == 0:
                ways = np.zeros((14, 6))
                around = rng.normal(size=(14, 3))
                around /= np.linalg.norm(around, axis=1)[:, None]
                ways[:, rows] = side.size * around
                shares.append(1.0 / true_scale(places, plan, ways))
    moved, turned = np.median(np.array(sizes), axis=0)
    console.print(
        f"{made} plans, {planned} displacements planned again, {failed} not verified, {anew} only "
        f"where planning begins anew, {far} by a motion that is not near; claimed is "
        f"{np.median(shares):.2f} of the true one in the median ({len(shares)} looked at); "
        f"{1e3 * moved:.3g} mm and {np.degrees(turned):.3g}° in the median; "
        f"{np.median(seconds):.1f} s for one (median), {max(seconds):.1f} s at most",
        highlight=False,
        soft_wrap=True,
    )
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    typer.run(main)

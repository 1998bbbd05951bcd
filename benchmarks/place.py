"""Where to put the part: `make bench NAME=place`.

`selfmotion.place` against places all over the box, each planned on its own, the best of which go
downhill. The seams, one or three, are random, above a block that belongs to the part, beside a wall
that does not. Times are those of the processor, costs those of verified motions. What an exhaustive
grid of 10,000 places would take follows from what one place takes. With `--maps`, what a map around
each place says is held against cold plans: whether every 'no plan' is one, and no cell is cheaper
than the place that was found.
"""

from __future__ import annotations

import time
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import Progress

import selfmotion as sm
from selfmotion.work.placement import Tried
from selfmotion.work.placement.places import Places, places_of
from selfmotion.work.placement.search import Box, Descent, beginnings

ARMS = (("panda", "pose"), ("xarm7", "pose"), ("ur5", "position"))
WITHIN = {"x": (-0.2, 0.2), "y": (-0.25, 0.25), "yaw": (-0.6, 0.6)}
# Places of an exhaustive grid.
EXHAUSTIVE = 10_000
# A map says 'no plan' wrongly where a cold plan has a motion within this time of it [s]; a cell is
# cheaper than the best place where it is by more than this share.
COLD, CHEAPER = 30.0, 0.005
# Tries of seams of which a motion is known.
TRIES = 20


def random_seams(rng: np.random.Generator, arm: int, count: int) -> list[sm.Problem]:
    """Return seams of one part of which motions are known where it stands."""
    name, task = ARMS[arm]
    robot = sm.load_robot(name)
    lower, upper = robot.finite_limits()
    while True:
        q = robot.dexterous_configuration(task) + rng.uniform(-0.3, 0.3, robot.dof)
        pose = robot.pose(np.clip(q, lower, upper))
        block = sm.obstacles.Box("block", pose.translation - [0.0, 0.0, 0.15], [0.15, 0.15, 0.05])
        wall = sm.obstacles.Box(
            "wall", [pose.translation[0] + 0.35, 0.0, pose.translation[2]], [0.02, 1.0, 0.4]
        )
        limits = [sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()]
        clear = sm.constraints.Clearance([block, wall], 5e-3)
        found: list[sm.Problem] = []
        for _ in range(TRIES):
            ends = [pose.copy(), pose.copy()]
            middle = rng.uniform(-0.06, 0.06, 3) * [1.0, 1.0, 0.3]
            way = rng.normal(size=3) * [1.0, 1.0, 0.2]
            way *= 0.5 * rng.uniform(0.1, 0.3) / np.linalg.norm(way)
            for end, sign in zip(ends, (-1.0, 1.0), strict=True):
                end.translation = pose.translation + middle + sign * way
            seam = sm.paths.Line(*ends, float(rng.uniform(3.0, 6.0)))
            problem = sm.Problem(robot, seam, task, constraints=limits, clearance=clear)
            try:
                if sm.plan(problem, deadline=2.0).certificate.verified:
                    found.append(problem)
            except sm.SelfmotionError:
                continue
            if len(found) == count:
                return found


def best_of_many(
    places: Places, box: Box, count: int, refined: int, told: Progress
) -> tuple[Tried, int, float]:
    """Return the best of many places, how many are verified, and how long one takes [s]."""
    tried = []
    began = time.process_time()
    for place in told.track(beginnings(box, 0, count), description="places"):
        tried.append(places.tried(place))
    each = (time.process_time() - began) / count
    sound = [one for one in tried if np.isfinite(one.cost)]
    first = sorted(sound, key=lambda one: one.cost)[:refined]
    arrived = [Descent(places, box, lambda _: None).run(one) for one in first]
    return min(arrived, key=lambda one: one.cost), len(sound), each


def judged_map(found: sm.Placement, places: Places, points: int) -> tuple[int, int, int, float]:
    """Return of a map its cells, those of no plan, how many of these have one, and its least cost.

    The cost as a share of that of the place that was found.
    """
    drawn, names = found.map(points=points), list(found.place)
    none, wrong = np.argwhere(np.isnan(drawn.costs)), 0
    for i, j in none:
        values = {**found.place, drawn.names[0]: drawn.across[j], drawn.names[1]: drawn.up[i]}
        problems = places.at(np.array([values[name] for name in names]))
        wrong += all(is_planned(problem) for problem in problems)
    least = float(np.nanmin(drawn.costs, initial=np.inf)) / found.cost
    return drawn.costs.size, len(none), wrong, least


def is_planned(problem: sm.Problem) -> bool:
    """Return whether a cold plan is verified."""
    try:
        return sm.plan(problem, deadline=COLD).certificate.verified
    except sm.SelfmotionError:
        return False


def main(
    count: Annotated[int, typer.Option(help="How many problems.")] = 30,
    seed: Annotated[int, typer.Option(help="Of the first problem.")] = 0,
    many: Annotated[int, typer.Option(help="How many places are planned.")] = EXHAUSTIVE,
    refined: Annotated[int, typer.Option(help="From how many of these it goes downhill.")] = 10,
    maps: Annotated[int, typer.Option(help="Only maps of so many cells a side, judged.")] = 0,
) -> None:
    """Place each, look everywhere, and compare."""
    console = Console(stderr=True)
    ratios, shares, unverified = [], [], 0
    judged: list[tuple[int, int, int, float]] = []
    names = tuple(WITHIN)
    box = Box(*np.array([WITHIN[name] for name in names]).T)
    with Progress(console=console, transient=True) as told:
        for number in range(seed, seed + count):
            rng = np.random.default_rng([53, number])
            seams = random_seams(rng, number % len(ARMS), 1 if number % 2 == 0 else 3)
            began = time.process_time()
            found = sm.place(seams, WITHIN, part=["block"])
            placed = time.process_time() - began
            unverified += not all(plan.check().verified for plan in found.plans)
            places = places_of(seams, "part", ["block"], None, names)
            if maps:
                judged.append(judged_map(found, places, maps))
                cells, none, wrong, least = judged[-1]
                print(
                    f"{number} {seams[0].robot.name}, {len(seams)} seams: of {cells} cells {none} "
                    f"without a plan, {wrong} of them wrongly; cheapest {least:.4f} of the best",
                    flush=True,
                )
                continue
            best, sound, each = best_of_many(places, box, many, refined, told)
            ratios.append(found.cost / best.cost)
            shares.append(placed / (EXHAUSTIVE * each))
            print(
                f"{number} {seams[0].robot.name}, {len(seams)} seams: placed at {found.cost:.5g}, "
                f"best of all {best.cost:.5g} ({sound} of {many} verified): ratio "
                f"{ratios[-1]:.4f}; {placed:.1f} s, {shares[-1]:.2%} of a grid of {EXHAUSTIVE}",
                flush=True,
            )
    if maps:
        cells, none, wrong, least = np.array(judged).T
        print(
            f"{count} maps: {int(wrong.sum())} of {int(none.sum())} cells without a plan have one, "
            f"{int((least < 1.0 - CHEAPER).sum())} maps have a cell that is more than "
            f"{CHEAPER:.1%} below the best place; cheapest {least.min():.4f} of it"
        )
        raise SystemExit(int(wrong.any() or (least < 1.0 - CHEAPER).any()))
    print(
        f"{count} problems: cost of the place found, against the best of {many} places and of what "
        f"{refined} of them lead to: median {np.median(ratios):.4f}, worst {np.max(ratios):.4f}; "
        f"time against a grid of {EXHAUSTIVE}: median {np.median(shares):.2%}, worst "
        f"{np.max(shares):.2%}; {unverified} not verified when checked again"
    )


if __name__ == "__main__":
    typer.run(main)

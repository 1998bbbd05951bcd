"""What was found once, is it found again? `make bench NAME=lost`.

Costs and verdicts of all problems of other benchmarks are kept in one file, `data/found.csv`: of
problems whose constraints bind, with tolerances, with known motions, at places around arms, of
cells, and of the suites. Each is planned again and held against that: one that was verified once
and is not any more is a failure, whatever else got better. `--write` keeps what is new; what was
verified once stays so, with the lowest cost that was verified.
"""

from __future__ import annotations

import csv
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import constrained
import known
import made
import places
import relaxed
import suite

import selfmotion as sm
from support.random_cells import LEFT, RIGHT, random_cell, random_follows

FOUND = Path(__file__).parent / "data" / "found.csv"
COLUMNS = ("problem", "verified", "cost")
# What costs more by this share than it did is told.
DEARER = 0.005


@dataclass(frozen=True)
class Result:
    """What came of a problem.

    Attributes
    ----------
    verified : bool
    cost : float
        NaN where there is none.
    said : str
        The verdict, or the error.
    """

    verified: bool
    cost: float
    said: str = ""


Solve = Callable[[], Result]


def planned(make: Callable[[], sm.Problem]) -> Result:
    """Return what a plan of a problem comes to."""
    try:
        plan = sm.plan(make())
    except sm.SelfmotionError as error:
        return Result(False, np.nan, str(error))
    return Result(plan.certificate.verified, plan.report.cost, plan.certificate.summary)


def of_constrained() -> Iterator[tuple[str, Solve]]:
    for seed in constrained._stored():
        for number in range(constrained.COUNT):
            make = partial(constrained.problem, int(seed), number)
            yield f"{seed}/{number}", lambda make=make: planned(lambda: make()[1])


def of_relaxed() -> Iterator[tuple[str, Solve]]:
    for number in range(relaxed.COUNT):
        yield f"{number}", lambda n=number: planned(lambda: relaxed.problem(n)[1])


def of_known() -> Iterator[tuple[str, Solve]]:
    for number in range(30):
        for kind in known.KINDS:
            make = partial(known.problem_of, kind, number)
            yield f"{kind}/{number}", lambda make=make: planned(lambda: make()[0])


def of_places() -> Iterator[tuple[str, Solve]]:
    for number in range(300):
        yield f"{number}", partial(planned, partial(places.place, number))


def of_cells() -> Iterator[tuple[str, Solve]]:
    def cell(number: int) -> Result:
        with tempfile.TemporaryDirectory() as folder:
            rng = np.random.default_rng(number)
            robot = sm.load_robot(random_cell(rng, Path(folder)), tool=(LEFT, RIGHT))
            items, _, start = random_follows(rng, robot)
            given = start if rng.random() < 0.5 else None
            return planned(lambda: sm.Problem(robot, items, start=given))

    for number in range(200):
        yield f"{number}", partial(cell, number)


def scored(folder: Path) -> Result:
    """Return what the suite's judge says of a folder; its cost is the length [rad]."""
    with tempfile.TemporaryDirectory() as out:
        found = suite.score(suite.load(folder), 0, Path(out))
    reason = found.judged.reason
    return Result(not reason, float(found.judged.length_rad), reason)


def of_suite() -> Iterator[tuple[str, Solve]]:
    for folder in sorted(suite.DATA.glob("*/")):
        if (folder / "problem.json").is_file():
            yield folder.name, partial(scored, folder)


def of_suite_made() -> Iterator[tuple[str, Solve]]:
    out = Path("out/made")
    made.main(out, 12, 0)
    for folder in sorted(out.glob("made_*/")):
        yield folder.name, partial(scored, folder)


SOURCES: dict[str, Callable[[], Iterator[tuple[str, Solve]]]] = {
    "constrained": of_constrained,
    "relaxed": of_relaxed,
    "known": of_known,
    "places": of_places,
    "cells": of_cells,
    "suite": of_suite,
    "suite-made": of_suite_made,
}


def read(file: Path) -> dict[str, Result]:
    """Return what is kept."""
    if not file.exists():
        return {}
    with file.open(newline="") as stream:
        return {
            row["problem"]: Result(row["verified"] == "1", float(row["cost"] or "nan"))
            for row in csv.DictReader(stream)
        }


def write(file: Path, results: dict[str, Result]) -> None:
    """Write results, in the order of their names."""
    rows = [
        (name, int(item.verified), "" if np.isnan(item.cost) else f"{item.cost:.9g}")
        for name, item in sorted(results.items())
    ]
    with file.open("w", newline="") as stream:
        csv.writer(stream, lineterminator="\n").writerows([COLUMNS, *rows])


def better(kept: Result | None, found: Result) -> Result:
    """Return which of two is to be kept: what is verified, and then what costs less."""
    if kept is None or (found.verified and not kept.verified):
        return found
    lower = found.verified and not found.cost >= kept.cost
    return found if lower else kept


def main(
    only: Annotated[list[str] | None, typer.Option(help="Of these benchmarks only.")] = None,
    every: Annotated[int, typer.Option(help="Every so manieth problem.")] = 1,
    first: Annotated[int, typer.Option(help="Of these from this one on.")] = 0,
    table: Annotated[Path, typer.Option(help="What is kept.")] = FOUND,
    keep: Annotated[bool, typer.Option("--write", help="Keep what is new or better.")] = False,
) -> None:
    """Plan the problems, and hold them against what is kept."""
    warnings.simplefilter("ignore")
    console, before, after = Console(soft_wrap=True, highlight=False, markup=False), read(table), {}
    lost = list[str]()
    for name in only or SOURCES:
        ratios, gained, count, began = list[float](), 0, 0, time.process_time()
        verified = 0
        for place, (number, solve) in enumerate(SOURCES[name]()):
            if place % every != first % every:
                continue
            found, key = solve(), f"{name}/{number}"
            kept = before.get(key)
            count, verified = count + 1, verified + found.verified
            after[key] = better(kept, found)
            if keep:
                write(table, {**before, **after})
            if kept is None:
                continue
            gained += found.verified and not kept.verified
            if kept.verified and not found.verified:
                lost.append(key)
                console.print(f"LOST {key}: {found.said}")
            if kept.verified and found.verified and kept.cost > 0.0:
                ratios.append(found.cost / kept.cost)
                if ratios[-1] > 1.0 + DEARER:
                    console.print(f"  {key} costs {ratios[-1]:.4f} of what it did")
        compared = f", cost {np.median(ratios):.6f} of what it was in the median" if ratios else ""
        console.print(
            f"{name:12s} {count} problems, {verified} verified, {gained} of them for the first "
            f"time{compared}; {time.process_time() - began:.0f} s"
        )
    console.print(f"{len(lost)} lost")
    sys.exit(1 if lost else 0)


if __name__ == "__main__":
    typer.run(main)

"""How near the default comes to the best null motion: `python benchmarks/remaining.py`.

40 problems made at random, half of which rest at their ends, nothing else asked of them. Each is
planned by default, on nodes, and by the published method with a spline of 64 intervals (32 where
there are more than two degrees of redundancy), begun at the default plan. What `Report.remaining`
says is told besides. Times are those of the processor.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator
from dataclasses import replace
from itertools import count
from typing import Annotated, Any

import constrained
import numpy as np
import typer
from rich.console import Console
from rich.table import Table

import selfmotion as sm

SEED, KINDS, COUNT = 7, ("free", "at rest"), 40


def finest(problem: sm.Problem) -> sm.motion.NullMotion:
    """Return the spline of 64 intervals; of 32 where the arm has so many self-motions."""
    many = problem.robot.redundancy(problem.task) > 2
    return sm.motion.BSplineNullMotion(32 if many else 64)


def problems(seed: int) -> Iterator[tuple[str, sm.Problem]]:
    """Yield the name and the problem of each, without end, all of given starts."""
    for number in count():
        name, problem = constrained.problem(seed, number)
        if problem.given_start is None:
            continue
        kind = KINDS[number % len(KINDS)]
        name = f"{name.split(',')[0]}, {kind}"
        options: dict[str, Any] = {"constraints": (), "rest": kind == "at rest"}
        yield (
            name,
            replace(problem, clearance=None, null_motion=sm.motion.FreeNullMotion(), **options),
        )


def planned(problem: sm.Problem, **options: Any) -> tuple[sm.Plan, float]:
    """Return a plan and the seconds of the processor that it took."""
    began = time.process_time()
    return sm.plan(problem, **options), time.process_time() - began


def main(
    seed: Annotated[int, typer.Option(help="Of the problems.")] = SEED,
    most: Annotated[int, typer.Option(help="How many.")] = COUNT,
) -> None:
    """Print each problem, and how far the default is above the splines."""
    warnings.simplefilter("ignore")
    console = Console(width=140)
    table = Table("problem", "default", "left: said", "spline", "default above", "time")
    sm.plan(sm.sample_problem())
    above, times = [], []
    for name, problem in problems(seed):
        if len(above) == most:
            break
        try:
            default, own = planned(problem)
            fine, other = planned(replace(problem, null_motion=finest(problem)), warm_start=default)
        except sm.SelfmotionError as error:
            console.print(f"{name}: {error}", markup=False)
            continue
        if not default.certificate.on_path or not fine.certificate.on_path:
            console.print(f"{name}: {default.certificate.verdict}", markup=False)
            continue
        report = default.report
        above.append(report.cost / fine.report.cost - 1.0)
        times.append(own / other)
        said = "none" if report.remaining is None else f"{report.remaining / report.cost:.4%}"
        costs = f"{report.cost:.6g}", said, f"{fine.report.cost:.6g}", f"{above[-1]:+.4%}"
        table.add_row(name, *costs, f"{own:.2f}, {other:.2f} s")
    console.print(table)
    console.print(
        f"default above the spline: median {np.median(above):+.3%}, most {max(above):+.3%}, least "
        f"{min(above):+.3%}; time over that of the spline: median {np.median(times):.2f}, "
        f"most {max(times):.2f}"
    )


if __name__ == "__main__":
    typer.run(main)

"""What the plans' estimate of what is left to save is worth: `python benchmarks/remaining.py`.

40 problems made at random: 10 without constraints, 10 that rest at their ends, and 20 whose
constraints bind. Each is planned with the paper's cubic and with the default null motion, and what
`Report.remaining` says of both is held against a spline of 64 intervals (32 where there are more
than two degrees of redundancy), planned from the default plan, so that both are near the same
optimum. Times are those of the processor.
"""

from __future__ import annotations

import time
import warnings
from dataclasses import replace
from itertools import count
from typing import Annotated

import constrained
import numpy as np
import typer
from rich.console import Console
from rich.table import Table

import selfmotion as sm

SEED, KINDS = 7, ("free", "at rest", "binding", "binding")
COUNT = 40
# What is asked: the estimate's error where the truth is below the second, and what it must not
# call below the third where the truth is above the fourth.
EXACT, SMALL, NOTHING, SOMETHING = 0.25, 0.05, 1e-3, 3e-3
# Truth below this is as good as nothing, and what two optimisations differ by.
NOISE = 1e-4


def finest(problem: sm.Problem) -> sm.NullMotion:
    """Return the spline of 64 intervals; of 32 where the arm has so many self-motions."""
    many = problem.robot.redundancy(problem.task) > 2
    return sm.BSplineNullMotion(32 if many else 64)


def problems(seed: int):
    """Yield the name and the problem of each, without end, all of given starts."""
    for number in count():
        name, problem = constrained.problem(seed, number)
        if problem.given_start is None:
            continue
        kind = KINDS[number % len(KINDS)]
        if kind != "binding":
            problem = replace(problem, constraints=(), rest=kind == "at rest")
            name = f"{name.split(',')[0]}, {kind}"
        yield name, replace(problem, collision=None)


def planned(problem: sm.Problem, **options) -> tuple[sm.Plan, float]:
    """Return a plan and the seconds of the processor that it took."""
    began = time.process_time()
    return sm.plan(problem, **options), time.process_time() - began


def main(
    seed: Annotated[int, typer.Option(help="Of the problems.")] = SEED,
    most: Annotated[int, typer.Option(help="How many that the default solves.")] = COUNT,
) -> None:
    """Print each problem, and what was asked of all."""
    warnings.simplefilter("ignore")
    console = Console(width=140)
    table = Table("problem", "cubic", "left: said", "true", "default", "left: said", "true", "time")
    sm.plan(sm.sample_problem())
    wrong, silent, short, times = [], [], [], []
    for name, problem in problems(seed):
        if len(times) == most:
            break
        try:
            cubic, cubic_time = planned(replace(problem, null_motion=sm.PolynomialNullMotion(3)))
            default, default_time = planned(replace(problem, null_motion=sm.RefinedNullMotion()))
            if not default.certificate.verified:
                print(f"{name}: {default.certificate.verdict}", flush=True)
                continue
            fine, _ = planned(replace(problem, null_motion=finest(problem)), warm_start=default)
        except sm.SelfmotionError as error:
            console.print(f"{name}: {error}", markup=False)
            continue
        cells = []
        for plan in (cubic, default):
            report = plan.report
            said = None if report.remaining is None else report.remaining / report.cost
            true = 1.0 - fine.report.cost / report.cost
            cells += [f"{report.cost:.6g}{'' if plan.certificate.verified else ' (not verified)'}",
                      "none" if said is None else f"{said:.3%}", f"{true:.3%}"]  # fmt: skip
            if said is not None and plan.certificate.verified and fine.certificate.verified:
                if NOISE < true < SMALL and abs(said - true) > EXACT * true + NOISE:
                    wrong.append(name)
                if said < NOTHING and true > SOMETHING:
                    silent.append(name)
        if fine.certificate.verified:
            short.append(1.0 - fine.report.cost / default.report.cost)
            times.append(default_time / cubic_time)
        table.add_row(name, *cells, f"{cubic_time:.2f} → {default_time:.2f} s")
        print(" | ".join([name, *cells, f"{cubic_time:.2f} → {default_time:.2f}"]), flush=True)
    console.print(table)
    console.print(
        f"estimates off by more than {EXACT:.0%} where the truth is below {SMALL:.0%}: "
        f"{len(wrong)} ({', '.join(wrong)})\n"
        f"said to be below {NOTHING:.1%} where the truth is above {SOMETHING:.1%}: {len(silent)} "
        f"({', '.join(silent)})\n"
        f"default above the spline of 64: median {np.median(short):.3%}, most {max(short):.3%}, "
        f"within 0.2 %: {sum(item <= 2e-3 for item in short)} of {len(short)}\n"
        f"time of the default over that of the cubic: median {np.median(times):.2f}, "
        f"most {max(times):.2f}, in all {np.mean(times):.2f} on average"
    )


if __name__ == "__main__":
    typer.run(main)

"""What each number of the planner decides: `python benchmarks/sensitivity.py`.

The numbers at the heads of files of `planner`, `nodes`, `search` and `transfer`, and the fields of
settings there, are doubled and halved, one at a time, and a few problems are planned that lead
through these. Prints how many plans change, which are lost or found, how their costs change, and
the processor time. A number that changes nothing may go, or follow from another one. Numbers that
are compiled into kernels are left out.
"""

from __future__ import annotations

import argparse
import ast
import importlib
import inspect
import sys
import time
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from typing import Any

import moves
import numpy as np
import random_problems
import starts
import suite

import selfmotion as sm
from selfmotion.basics import silent

# What a problem leads to: its cost, None for no motion, and whether it is verified.
Outcome = tuple[float | None, bool]
# The package of a folder that has not its name.
PACKAGES = {"planning": "planner"}
# Random paths that limits bind on, that have no motion as a whole, or none at all.
HARD = (18, 22, 24, 25, 37, 49, 52)
FREE = (3, 4, 11, 16)


def planned(problem: sm.Problem, **options: Any) -> Callable[[], Outcome]:
    """Return what plans a problem."""

    def outcome() -> Outcome:
        plan = sm.plan(problem, **options)
        return plan.report.cost, plan.certificate.verified

    return outcome


def suited(name: str) -> Callable[[], Outcome]:
    """Return what plans a problem of the suite."""
    problem = suite.load(suite.DATA / name)

    def outcome() -> Outcome:
        plan, _ = suite.plan(problem, 0, silent)
        return plan.report.cost, plan.certificate.verified

    return outcome


def moved(name: str, which: int) -> Callable[[], Outcome]:
    """Return what makes one of an arm's transfers among boxes; its cost is its duration."""
    robot, rng = moves.arms()[name], np.random.default_rng(1)
    drawn = [each for each in (moves.transfer(robot, rng) for _ in range(12)) if each]
    clearance, first, last = drawn[which]

    def outcome() -> Outcome:
        move = sm.move(robot, first, last, clearance=clearance, seconds=60.0)
        return None if move.trajectory is None else move.trajectory.duration, move.verified

    return outcome


def random_path(number: int) -> sm.Problem:
    """Return a random path of a Panda or an xArm 7."""
    robot = sm.load_robot(("panda", "xarm7")[number % 3])
    return random_problems.random_problem(robot, np.random.default_rng([5, number]))


def works(folder: str) -> dict[str, Callable[[], Outcome]]:
    """Return problems that lead through a folder."""
    if folder == "transfer":
        each = (("panda", 1), ("ur5", 2), ("xarm7", 0), ("panda, table", 0))
        return {f"{name} {which}": moved(name, which) for name, which in each}
    hard = {f"random {k}": planned(random_path(k)) for k in HARD}
    if folder in ("planning", "nodes"):
        return hard | {f"start {k}": planned(starts.random_problem(k)) for k in FREE}
    search = sm.Search(mode="global")
    pointing = replace(starts.random_problem(4), task="pointing")
    shortest = replace(pointing, costs=[sm.costs.PathLength()])
    return {
        **{f"random {k}": hard[f"random {k}"] for k in (24, 37, 49)},
        "curves": planned(starts.random_problem(6), search=search),
        "samples": planned(pointing, search=search),
        "shortest": planned(shortest, search=search),
        **{name: suited(name) for name in ("panda__1cube", "fetch__circle")},
    }


def run(work: dict[str, Callable[[], Outcome]]) -> tuple[dict[str, Outcome], float]:
    """Return what comes of problems, and the time of the processor [s]."""
    began, found = time.process_time(), {}
    for name, each in work.items():
        try:
            found[name] = each()
        except sm.SelfmotionError:
            found[name] = None, False
    return found, time.process_time() - began


def scaled(value: Any, factor: float) -> Any:
    """Return a number or several times a factor, whole ones rounded to at least 1."""
    if isinstance(value, tuple):
        return tuple(scaled(each, factor) for each in value)
    return max(1, round(value * factor)) if isinstance(value, int) else value * factor


def numbers(module: Any) -> list[str]:
    """Return the names of the numbers at the head of a module, and of fields of its settings."""
    found = []
    for node in ast.parse(inspect.getsource(module)).body:
        for target in node.targets if isinstance(node, ast.Assign) else ():
            names = [each.id for each in ast.walk(target) if isinstance(each, ast.Name)]
            for name in names:
                value = getattr(module, name)
                if _is_number(value):
                    found.append(name)
                elif is_dataclass(value) and not isinstance(value, type):
                    numeric = (x.name for x in fields(value) if _is_number(getattr(value, x.name)))
                    found += [f"{name}.{field}" for field in numeric]
    return found


def changed(module: Any, name: str, factor: float) -> Any:
    """Return the value of a module's attribute with a number of it, by its name, times a factor."""
    name, _, field = name.partition(".")
    value = getattr(module, name)
    if not field:
        return scaled(value, factor)
    return replace(value, **{field: scaled(getattr(value, field), factor)})


def _is_number(value: Any) -> bool:
    if isinstance(value, tuple):
        return all(_is_number(each) for each in value)
    return isinstance(value, int | float) and not isinstance(value, bool)


def compared(before: dict[str, Outcome], after: dict[str, Outcome]) -> str:
    """Return in words how plans have changed."""
    changed = [name for name in before if after[name] != before[name]]
    lost = [name for name in changed if before[name][1] and not after[name][1]]
    won = [name for name in changed if after[name][1] and not before[name][1]]
    costs = [(before[name][0], after[name][0]) for name in changed]
    changes = [100.0 * (new / old - 1.0) for old, new in costs if old and new]
    if not changed:
        return "nothing"
    said = f"{len(changed)} of {len(before)}"
    said += f", {min(changes):+.2g} to {max(changes):+.2g} %" if changes else ""
    said += f", lost {', '.join(lost)}" if lost else ""
    return said + (f", found {', '.join(won)}" if won else "")


def main() -> None:
    """Print a row for each number."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="*", default=["planning", "nodes", "search", "transfer"])
    parser.add_argument("--only", default="", help="numbers whose name has this in it")
    options = parser.parse_args()
    for folder in options.folders:
        work = works(folder)
        # What is compiled on first use is nobody's time.
        run(work)
        before, usual = run(work)
        package = importlib.import_module(f"selfmotion.planning.{PACKAGES.get(folder, folder)}")
        modules = {
            name: module
            for name, module in sys.modules.items()
            if name.startswith(f"{package.__name__}.")
        }
        for where, module in sorted(modules.items()):
            for name in numbers(module):
                if options.only not in name:
                    continue
                whole = name.split(".")[0]
                value = getattr(module, whole)
                # Where it is imported to as well; private ones are not.
                users = [each for each in modules.values() if getattr(each, whole, None) is value]
                users = [module] if name.startswith("_") else users
                for factor in (2.0, 0.5):
                    new = changed(module, name, factor)
                    for each in users:
                        setattr(each, whole, new)
                    after, seconds = run(work)
                    for each in users:
                        setattr(each, whole, value)
                    print(
                        f"{where.removeprefix('selfmotion.'):24} {name:36} x {factor:3}: "
                        f"{compared(before, after)}, time x {seconds / usual:.2f}",
                        flush=True,
                    )


if __name__ == "__main__":
    main()

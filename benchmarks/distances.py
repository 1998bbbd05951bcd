"""Distances of random pairs of bodies, judged by support functions: 100,000 poses.

`python benchmarks/distances.py`: bodies of all kinds, in pairs that keep their requests to coal as
those of a plan do. A distance is right when its normal separates the bodies by as much, and its
nearest points belong to them; a depth, when no other direction separates them by more.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import track

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from support.independent_distances import Trial, free_body


def main(
    count: Annotated[int, typer.Option(help="How many poses of pairs.")] = 100_000,
    seed: Annotated[int, typer.Option(help="Of the random numbers.")] = 0,
) -> None:
    """Draw, judge, and tell what is wrong."""
    console, rng = Console(), np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        robot = free_body(Path(folder))
    faults: list[str] = []
    # Each trial: 5 kinds of bodies, one each, against each other; 40 configurations.
    trials = -(-count // (25 * 40))
    for _ in track(range(trials), "poses", console=console, transient=True):
        trial = Trial.made(robot, rng, 1)
        faults += trial.faults(robot, rng, 40, 10.0 ** rng.uniform(-4.0, -1.0))
    for kinds, number in Counter(fault.split(":")[0] for fault in faults).most_common():
        example = next(fault for fault in faults if fault.startswith(kinds))
        console.print(f"{number} × {example}", markup=False, soft_wrap=True)
    console.print(f"{trials * 1000} poses, {len(faults)} of them wrong")
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    typer.run(main)

"""Random fast lines of a Franka Research 3: whose velocities its maker's limits by position refuse.

`make bench NAME=fr3_limits`. Each is planned by the limits of the URDF alone, and with
`PositionDependentVelocityLimits`; both motions are sampled at the 1 kHz of the controller and
between, and judged by a restatement of the maker's formula that shares nothing with the product
(`tests/support/franka.py`).
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import track

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import selfmotion as sm
from support import franka

# Samples per second at which motions are judged: four to a cycle of the controller.
RATE = 4000.0
# Beyond a limit by rounding [rad/s].
ROUNDING = 1e-9
ALONE = (sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits())
KINDS = {
    "by the URDF alone": ALONE,
    "with the maker's limits": (*ALONE, sm.constraints.PositionDependentVelocityLimits()),
}


def judged(problem: sm.Problem) -> str:
    """Return what came of a problem: not verified, refused by the maker's limits, or neither."""
    try:
        plan = sm.plan(problem)
    except sm.errors.SelfmotionError as error:
        return f"no plan: {type(error).__name__}"
    if not plan.certificate.verified:
        return "not verified"
    t = plan.trajectory.sample_times(RATE)
    q, qd = plan.trajectory(t), plan.trajectory(t, 1)
    return "refused" if franka.refusals(q, qd, ROUNDING) else "accepted"


def main(
    count: Annotated[int, typer.Option(help="Number of lines.")] = 1000,
    first: Annotated[int, typer.Option(help="Seed of the first one.")] = 0,
) -> None:
    robot, began = sm.load_robot("fr3"), time.process_time()
    found = {kind: Counter[str]() for kind in KINDS}
    wrong = []
    for seed in track(range(first, first + count), "lines", disable=not sys.stdout.isatty()):
        problem = franka.fast_line(robot, seed)
        for kind, constraints in KINDS.items():
            outcome = judged(problem.changed(constraints=list(constraints)))
            found[kind][outcome] += 1
            if outcome == "refused" and len(constraints) > len(ALONE):
                wrong.append(seed)
    console = Console(width=120, highlight=False)
    for kind, outcomes in found.items():
        said = ", ".join(f"{number} {name}" for name, number in sorted(outcomes.items()))
        console.print(f"{count} lines planned {kind}: {said}")
    seconds = (time.process_time() - began) / (len(KINDS) * count)
    console.print(f"{seconds:.2f} s of the processor for each plan and its judgement")
    if wrong:
        console.print(f"verified, but refused: seeds {wrong}")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    np.seterr(all="raise", under="ignore")
    typer.run(main)

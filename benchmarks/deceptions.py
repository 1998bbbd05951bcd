"""Motions made to deceive by who reads the source: `make bench NAME=fuzz-deceptions`.

2,004 motions of random cells that vanish where the certificate looks, or have features far narrower
than its intervals; each asks for one thing (a path, a band, a torque, a distance, a feed …), beside
what kinematics and dynamics of the tests' own say that it takes. None that does not keep it may be
verified; of those that do, 1 % may stay undecided.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from support.deceptions import ALL_KINDS, deceive

# Of motions that are true, so many may stay undecided.
UNDECIDED = 0.01


def main(
    count: Annotated[int, typer.Option(help="How many motions of each kind.")] = 167,
    seed: Annotated[int, typer.Option(help="Of the first one.")] = 0,
    kinds: Annotated[str, typer.Option(help="Which of them.")] = ",".join(ALL_KINDS),
) -> None:
    """Make motions, certify, and tell counts."""
    console, totals = Console(soft_wrap=True, markup=False, highlight=False), Counter[str]()
    for kind in kinds.split(","):
        ends = Counter[str]()
        for number in range(seed, seed + count):
            with tempfile.TemporaryDirectory() as folder:
                found = deceive(kind, number, Path(folder))
            ends["motions"] += 1
            ends["verified"] += found.certificate.verified
            ends["untrue"] += found.share > 1.0
            ends["true"] += found.share < 1.0
            ends["false"] += found.is_false
            ends["undecided"] += found.is_strict
            if found.is_false or found.is_strict:
                what = "FALSE" if found.is_false else "STRICT"
                verdict = found.certificate.verdict
                console.print(f"{what} {found.share:.4g} {found.told} | {verdict}")
        console.print(f"{kind}: {dict(ends)}")
        totals += ends
    console.print(
        f"{totals['motions']} motions, {totals['untrue']} of them untrue: {totals['false']} false "
        f"verdicts; of {totals['true']} true ones {totals['undecided']} not verified"
    )
    sys.exit(int(totals["false"] > 0 or totals["undecided"] > UNDECIDED * totals["true"]))


if __name__ == "__main__":
    typer.run(main)

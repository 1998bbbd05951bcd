"""Plans thousands of generated problems and judges each plan anew.

`make bench NAME=fuzz-generated`.

Arms of 2 to 9 joints, paths, tasks, constraints and obstacles of all kinds, numbers that cannot be
meant now and then. Each problem has to end in a plan whose verdict an independent judge confirms,
or in a typed error; within 60 s.
"""

from __future__ import annotations

import sys
import warnings
from collections import Counter
from pathlib import Path
from typing import Annotated

import hypothesis
import numpy as np
import typer
from rich.console import Console

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from support.generated import End, end_of
from support.strategies import Generated, problems


def drawn(count: int, seed: int) -> list[Generated]:
    """Return descriptions of problems, no two of them equal."""
    found: dict[Generated, None] = {}

    @hypothesis.seed(seed)
    @hypothesis.settings(
        max_examples=500,
        database=None,
        deadline=None,
        phases=[hypothesis.Phase.generate],
        suppress_health_check=list(hypothesis.HealthCheck),
    )
    @hypothesis.given(problems())
    def draw(words: Generated) -> None:
        found[words] = None

    while len(found) < count:
        draw = hypothesis.seed(seed + len(found))(draw)
        draw()
    return list(found)[:count]


def main(
    count: Annotated[int, typer.Option(help="How many problems.")] = 5000,
    seed: Annotated[int, typer.Option(help="Of the first problem.")] = 0,
    evaluations: Annotated[int, typer.Option(help="Limit for each start.")] = 60,
) -> None:
    """Draw, plan, judge, and tell what is wrong."""
    warnings.simplefilter("error")
    console, ends = Console(), list[End]()
    for number, words in enumerate(drawn(count, seed)):
        end = end_of(words, max_evaluations=evaluations)
        ends.append(end)
        if end.is_wrong or end.strict:
            name = "STRICT" if end.strict else end.kind
            console.print(f"{number} {name}: {end.text}\n    {words}", markup=False, soft_wrap=True)
        if (number + 1) % 250 == 0:
            console.print(f"{number + 1}: {dict(Counter(end.kind for end in ends))}", markup=False)
    kinds, seconds = Counter(end.kind for end in ends), [end.seconds for end in ends]
    console.print(
        f"{count} problems: {dict(kinds)}; {sum(end.strict for end in ends)} valid with 1 % to "
        f"spare but not verified; {np.median(seconds):.2f} s each (median), {max(seconds):.1f} s "
        f"at most",
        markup=False,
        soft_wrap=True,
    )
    sys.exit(1 if any(end.is_wrong for end in ends) else 0)


if __name__ == "__main__":
    typer.run(main)

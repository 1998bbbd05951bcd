"""Plans the paper's planar problem 10,000 times in one process, and tells its resident memory.

`make bench NAME=memory`: at a tenth, half and all of them, or of those that fit into five minutes;
exit code 1 where the second half takes more than 1 MB.
"""

import gc
import os
import sys
import time
from pathlib import Path
from typing import Annotated

import typer

import selfmotion as sm

# What allocators keep or give back from one plan to the next [MB].
_NOISE = 1.0


def resident() -> float:
    """Return the resident memory of this process [MB]."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def main(
    count: Annotated[int, typer.Option(help="How many plans.")] = 10_000,
    minutes: Annotated[float, typer.Option(help="Stop after so long.")] = 5.0,
) -> None:
    """Plan, and tell the memory."""
    used, began = [], time.monotonic()
    while len(used) < count and time.monotonic() - began < 60.0 * minutes:
        # A new problem each time, with caches of its own.
        problem = sm.sample_problem()
        sm.plan(problem).require()
        used.append(resident() if len(used) % 10 == 9 else 0.0)
    done = len(used)
    shares = {share: max(10, round(share * done) // 10 * 10) for share in (0.1, 0.5, 1.0)}
    told = [f"{used[at - 1]:.1f} MB after {at}" for at in shares.values()]
    within = "" if done == count else f", stopped after {minutes:g} min"
    print(f"{done} plans of {count}{within}: resident memory {', '.join(told)}")
    sys.exit(1 if used[shares[1.0] - 1] - used[shares[0.5] - 1] > _NOISE else 0)


if __name__ == "__main__":
    typer.run(main)

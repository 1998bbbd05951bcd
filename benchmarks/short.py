"""A short form of every benchmark: does it still run? `make short`.

Each target of the Makefile that runs a file of this folder runs it here with few problems, for a
minute at most, one after the other. A target without a line here is a failure, and so is a run that
ends in an error: what a few problems come to is printed by each and not judged.
"""

from __future__ import annotations

import re
import subprocess
import sys
import time
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

HERE = Path(__file__).parent
MAKEFILE = HERE.parent / "Makefile"
# A run is ended after so long [s]: a minute, and what compiles.
PATIENCE = 180.0
# File → arguments of its short form.
SHORT: dict[str, list[str]] = {
    "acceptance.py": ["--count", "2"],
    "arms.py": [
        "--list",
        "example-robot-data",
        "--only",
        "panda_description",
        "--out",
        "out/short/chains.md",
    ],
    "batch.py": ["--count", "12", "--same", "2"],
    "binding.py": ["--kind", "jerk"],
    "bought_margins.py": ["--count", "1", "--displacements", "2"],
    "certificate.py": ["--count", "1"],
    "changed_programs.py": ["--number", "20"],
    "constrained.py": ["--only", "1"],
    "corrections.py": ["--count", "1", "--displacements", "2"],
    "deceptions.py": ["--count", "2"],
    "distances.py": ["--count", "200"],
    "fastest.py": ["--count", "1"],
    "feeds.py": ["--count", "4"],
    "fuzz.py": ["--count", "4"],
    "fuzz_cells.py": ["--count", "4"],
    "fuzz_files.py": ["--count", "60"],
    "fuzz_realtime.py": ["--count", "4"],
    "fuzz_tasks.py": ["--count", "4"],
    "generated.py": ["--count", "40"],
    "job.py": ["--strokes", "4", "--out", "out/short/frame.program"],
    "job_killed.py": ["--times", "1"],
    "kept_folders.py": ["--each", "1"],
    "kept_seams.py": ["--count", "3"],
    "known.py": ["--count", "1"],
    "latency.py": ["--steps", "100", "--cases", "1"],
    "lifts.py": ["--count", "1"],
    "lost.py": ["--every", "300"],
    "made.py": ["--count", "1", "--out", "out/short/made"],
    "margins.py": ["--count", "2", "--displacements", "2"],
    "memory.py": ["--count", "60"],
    "moved_parts.py": ["--count", "1"],
    "moves.py": ["--each", "1"],
    "mutants.py": ["--count", "1", "--part", "optimiser"],
    "paces.py": ["--count", "1"],
    "place.py": ["--count", "1", "--many", "8"],
    "places.py": ["--count", "4", "--no-truth", "--out", "out/short/places.csv"],
    "pockets.py": ["--many", "10", "--planned", "1"],
    "programs.py": ["--number", "2"],
    "rails.py": ["--number", "1"],
    "random_jobs.py": ["--count", "2"],
    "raster.py": ["--only", "small"],
    "relaxed.py": ["--count", "6"],
    "remaining.py": ["--most", "2"],
    "sensitivity.py": ["transfer", "--only", "_SHORTCUTS"],
    "spirals.py": ["4"],
    "starts.py": ["--count", "2", "--out", "out/short/starts.csv"],
    "suite.py": ["--folder", "benchmarks/data/panda__1cube", "--out", "out/short/suite"],
}
# What has no short form, and why.
WHOLE = {
    "first_plan.py": "compiles every kernel anew, some minutes",
    "run.py": "the timings of the first table, by pytest-benchmark",
    "peers/run_peers.py": "installs other tools",
    "peers/run_cells.py": "installs other tools",
}


def targets() -> list[str]:
    """Return the files of this folder that the Makefile runs, in its order."""
    found = re.findall(r"python benchmarks/(\S+\.py)", MAKEFILE.read_text())
    return [name for name in dict.fromkeys(found) if name != Path(__file__).name]


def main(
    only: Annotated[list[str] | None, typer.Option(help="These files only.")] = None,
) -> None:
    """Run the short forms, and say which of them end in an error."""
    console, failed = Console(soft_wrap=True, highlight=False, markup=False), list[str]()
    (HERE.parent / "out" / "short").mkdir(parents=True, exist_ok=True)
    for name in only or targets():
        if name in WHOLE:
            console.print(f"{name:20s} left out: {WHOLE[name]}")
            continue
        if name not in SHORT:
            failed.append(name)
            console.print(f"{name:20s} has no short form: give it a line in short.py")
            continue
        began = time.monotonic()
        command = [sys.executable, str(HERE / name), *SHORT[name]]
        try:
            ended = subprocess.run(
                command, cwd=HERE.parent, capture_output=True, text=True, timeout=PATIENCE
            )
            # What says by its code that a problem was not solved has run all the same.
            wrong = "Traceback" in ended.stderr or ended.returncode not in (0, 1)
            said = (ended.stdout.strip() or ended.stderr.strip()).splitlines()[-1:] or [""]
        except subprocess.TimeoutExpired:
            wrong, said = True, [f"no end in {PATIENCE:g} s"]
        failed += [name] if wrong else []
        told = "FAILS" if wrong else "runs"
        console.print(f"{name:20s} {told} {time.monotonic() - began:5.0f} s  {said[0][:120]}")
        if wrong and "no end" not in said[0]:
            console.print(ended.stderr[-2000:])
    console.print(f"{len(failed)} of the targets fail: {', '.join(failed) or 'none'}")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    typer.run(main)

"""Every benchmark and fuzz by its name: `make bench NAME=places`; without a name, a list of them.

`make short` runs the short form of each, with few problems, for about a minute: whether it still
runs. There a run that ends in an error is a failure; what few problems come to is not judged.
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

HERE = Path(__file__).parent
ROOT = HERE.parent
# Time limit of a short form [s]: a minute, and compilation.
PATIENCE = 180.0


@dataclass(frozen=True)
class Run:
    """A file of this folder, and its arguments.

    Attributes
    ----------
    file : str
    arguments : str
    short : str
        Arguments of the short form.
    whole : str
        Why there is no short form; empty where there is one.
    """

    file: str
    arguments: str = ""
    short: str = ""
    whole: str = ""


class Benchmark:
    """A benchmark: what it measures, its runs in order, and packages that it needs besides ours."""

    def __init__(self, doc: str, *runs: Run, needs: tuple[str, ...] = ()) -> None:
        self.doc, self.runs, self.needs = doc, runs, needs


BENCHMARKS = {
    "timings": Benchmark(
        "the first table of docs/pages/performance.md",
        Run("run.py", whole="the timings of the first table, by pytest-benchmark"),
        needs=(".[bench]",),
    ),
    "constrained": Benchmark(
        "problems whose constraints bind, against an earlier revision",
        Run("constrained.py", short="--only 1"),
    ),
    "binding": Benchmark(
        "limits of jerk, bodies and self-collision: with what binds against without",
        Run("binding.py", short="--kind jerk"),
    ),
    "relaxed": Benchmark(
        "200 problems with tolerances, judged by kinematics of the tests, against the same without",
        Run("relaxed.py", short="--count 6"),
    ),
    "remaining": Benchmark(
        "the default null motion against splines of 64 intervals",
        Run("remaining.py", short="--most 2"),
    ),
    "batch": Benchmark(
        "two processes against one, and what a plan costs besides planning",
        Run("batch.py", short="--count 12 --same 2"),
    ),
    "starts": Benchmark(
        "free starts against the best of everything tried, 60 paths",
        Run("starts.py", short="--count 2 --out out/short/starts.csv"),
    ),
    "first-plan": Benchmark(
        "pip install, the first plan on a machine, and what is compiled in it",
        Run("first_plan.py", whole="installs the package in an environment of its own"),
    ),
    "places": Benchmark(
        "a seam at 300 places around three arms, each 'no' held against an exhaustive search",
        Run("places.py", short="--count 4 --no-truth --out out/short/places.csv"),
    ),
    "corrections": Benchmark(
        "how far parts may stand elsewhere when planned again, held against random displacements",
        Run("corrections.py", short="--count 1 --displacements 2"),
    ),
    "known": Benchmark(
        "18 kinds of 30 problems that have a known motion: what is not found, and what is false",
        Run("known.py", "--out out/known.csv", short="--count 1"),
    ),
    "lost": Benchmark(
        "costs and verdicts of all these problems against what is kept: what is lost, and dearer",
        Run("lost.py", short="--every 300"),
    ),
    "fr3_limits": Benchmark(
        "1,000 fast lines of a Franka Research 3, judged by its maker's limits of velocity",
        Run("fr3_limits.py", short="--count 3"),
    ),
    "margins": Benchmark(
        "by how much part, tool and base may be displaced: 200 plans, 10,000 displacements, judged",
        Run("margins.py", short="--count 2 --displacements 2"),
    ),
    "bought": Benchmark(
        "margins of 5 mm and 0.5° of 40 plans, displaced and judged; what they have to cost",
        Run("bought_margins.py", short="--count 1 --displacements 2"),
    ),
    "view": Benchmark(
        "the page of `selfmotion view`: from the release of a handle or slider to the verdict",
        Run("view.py", short="--repeats 1"),
    ),
    "view_browser": Benchmark(
        "the same page in Chromium: each handle dragged, each slider moved, and what it shows last",
        Run("view_browser.py", short="--repeats 1 --only Panda"),
    ),
    "redundancy_map": Benchmark(
        "redundancy maps of the suite's problems against brute force, pixel by pixel",
        Run(
            "redundancy_map.py",
            short="--only panda__1cube --columns 2 --rows 31 --starts 32",
        ),
    ),
    "place": Benchmark(
        "the best place of a part: 30 problems, against places everywhere; 10 maps, against plans",
        Run("place.py", "--many 400", short="--count 1 --many 8"),
        Run("place.py", "--maps 5 --count 10", whole="the run above is its short form"),
    ),
    "fastest": Benchmark(
        "60 paces against linear programmes; fastest motions of 20 paths, against retimed plans",
        Run("paces.py", short="--count 1"),
        Run("paces.py", "--jerk 100", whole="the run above is its short form"),
        Run("fastest.py", short="--count 1"),
    ),
    "feeds": Benchmark(
        "200 random feeds: refused before planning where no arm has them, kept where verified",
        Run("feeds.py", short="--count 4"),
    ),
    "moves": Benchmark(
        "100 transfers among boxes, some against 50 tries of OMPL",
        Run("moves.py", "--peer 3", short="--each 1"),
        needs=("ompl==2.0.1",),
    ),
    "raster": Benchmark(
        "rasters of 700 poses that no single motion follows, in parts",
        Run("raster.py", short="--only small"),
    ),
    "rails": Benchmark(
        "what a metre of a rail is to count: three rails, four weights",
        Run("rails.py", short="--number 1"),
    ),
    "numbers": Benchmark(
        "what each number of the planner decides: doubled and halved, what changes",
        Run("sensitivity.py", short="transfer --only _SHORTCUTS"),
    ),
    "lifts": Benchmark(
        "paths of an arm on a torso lift, each with a known motion",
        Run("lifts.py", short="--count 1"),
    ),
    "spirals": Benchmark(
        "loops of a spiral, from a few to an hour of them",
        Run("spirals.py", short="4"),
    ),
    "fuzz-job": Benchmark(
        "random jobs that leave posts; one that is killed at 20 random times, and begun again",
        Run("random_jobs.py", short="--count 2"),
        Run("job_killed.py", short="--times 1"),
        Run("job_killed.py", "--workers 2", whole="the run above is its short form"),
    ),
    "fuzz-pockets": Benchmark(
        "200 random programs of pockets and holes, held against an interpreter of its own",
        Run("pockets.py", short="--many 10 --planned 1"),
    ),
    "fuzz-programs": Benchmark(
        "100 random plans as programs, played by an independent judge; 1,000 changed programs",
        Run("programs.py", short="--number 2"),
        Run("changed_programs.py", short="--number 20"),
    ),
    "fuzz-kept": Benchmark(
        "50 folders of jobs and 50 of batches, each spoilt in one way and begun again",
        Run("kept_folders.py", short="--each 1"),
    ),
    "job": Benchmark(
        "a frame of 132 strokes: order, plans, moves past what was made",
        Run("job.py", short="--strokes 4 --out out/short/frame.program"),
    ),
    "moved": Benchmark(
        "30 jobs whose part was moved, planned again from what is kept",
        Run("moved_parts.py", short="--count 1"),
    ),
    "kept": Benchmark(
        "100 jobs of which a seam was added, removed or moved: what did not change is kept",
        Run("kept_seams.py", short="--count 3"),
    ),
    "latency": Benchmark(
        "10,000 steps of the replanner: percentiles, misses, and the cost of short sight",
        Run("latency.py", short="--steps 100 --cases 1"),
    ),
    "suite": Benchmark(
        "path problems made elsewhere, planned and scored",
        Run("suite.py", short="--folder benchmarks/data/panda__1cube --out out/short/suite"),
    ),
    "suite-made": Benchmark(
        "12 problems made at random that have a known motion, planned and scored",
        Run("made.py", "--out out/made", short="--count 1 --out out/short/made"),
        Run(
            "suite.py",
            "--folder out/made --out out/suite-made",
            whole="it has the short form of 'suite'",
        ),
    ),
    "fuzz-paths": Benchmark(
        "200 random paths, judged by an independent checker",
        Run("fuzz.py", short="--count 4"),
    ),
    "fuzz-tasks": Benchmark(
        "200 position and pointing tasks among boxes, judged by the suite's judge",
        Run("fuzz_tasks.py", short="--count 4"),
    ),
    "fuzz-cells": Benchmark(
        "200 random cells of two chains, judged by kinematics of the tree",
        Run("fuzz_cells.py", short="--count 4"),
    ),
    "fuzz-certificate": Benchmark(
        "900 motions made to deceive, judged independently; the price of proof",
        Run("certificate.py", short="--count 1"),
    ),
    "fuzz-deceptions": Benchmark(
        "2,004 motions made to deceive who reads the source, against an oracle",
        Run("deceptions.py", short="--count 2"),
    ),
    "fuzz-generated": Benchmark(
        "5,000 generated problems: confirmed verdicts and typed errors only",
        Run("generated.py", short="--count 40"),
    ),
    "fuzz-realtime": Benchmark(
        "1,000 scenarios of pushes, late steps, jumps and faults, in a closed loop",
        Run("fuzz_realtime.py", short="--count 4"),
    ),
    "fuzz-files": Benchmark(
        "20,000 spoiled files of all kinds: read, or refused in one line",
        Run("fuzz_files.py", short="--count 60"),
    ),
    "arms": Benchmark(
        "docs/chains.md: how many robot descriptions load, plan and are verified; needs a network",
        Run(
            "arms.py",
            short="--list example-robot-data --only panda_description --out out/short/chains.md",
        ),
        needs=(".[arms]",),
    ),
    "mutants": Benchmark(
        "faults put into the parts that all else stands on, and how many tests catch",
        Run("mutants.py", short="--count 1 --part optimiser"),
        needs=(".[mutants]",),
    ),
    "memory": Benchmark(
        "10,000 plans in one process, and its memory",
        Run("memory.py", short="--count 60"),
    ),
    "acceptance": Benchmark(
        "200 random plans, driven at 1 kHz by what the makers publish of their arms",
        Run("acceptance.py", short="--count 2"),
    ),
    "distances": Benchmark(
        "100,000 distances of bodies of all kinds, judged without GJK",
        Run("distances.py", short="--count 200"),
    ),
    "peers": Benchmark(
        "other tools on the same paths and cells, in environments of their own",
        Run("peers/run_peers.py", whole="installs other tools"),
        Run("peers/run_cells.py", whole="installs other tools"),
    ),
}


def command(run: Run, *, short: bool) -> list[str]:
    """Return the command of a run."""
    arguments = shlex.split(run.short if short else run.arguments)
    return [sys.executable, str(HERE / run.file), *arguments]


def environment() -> dict[str, str]:
    """Return variables with one thread for linear algebra: so times can be compared."""
    return {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def install(needs: tuple[str, ...]) -> None:
    """Install packages, or extras of ours, by the pinned versions."""
    if needs:
        pip = [sys.executable, "-m", "pip", "install", "--quiet", "--constraint", "constraints.txt"]
        names = [part for name in needs for part in (["-e", name] if name[0] == "." else [name])]
        subprocess.run([*pip, *names], cwd=ROOT, check=True)


def run_whole(name: str) -> int:
    """Run a benchmark, and return the first code that is not 0."""
    install(BENCHMARKS[name].needs)
    for run in BENCHMARKS[name].runs:
        ended = subprocess.run(command(run, short=False), cwd=ROOT, env=environment())
        if ended.returncode:
            return ended.returncode
    return 0


def run_short(names: list[str], console: Console) -> int:
    """Run short forms, and return how many of them end in an error."""
    failed = list[str]()
    (ROOT / "out" / "short").mkdir(parents=True, exist_ok=True)
    for name in names:
        # Other tools are only compared with in the whole form.
        install(tuple(x for x in BENCHMARKS[name].needs if x.startswith(".")))
        for run in BENCHMARKS[name].runs:
            if run.whole:
                console.print(f"{name:16s} {run.file:20s} left out: {run.whole}")
            elif not _ends_well(name, run, console):
                failed.append(name)
    console.print(f"{len(failed)} fail: {', '.join(failed) or 'none'}")
    return len(failed)


def _ends_well(name: str, run: Run, console: Console) -> bool:
    start, env = time.monotonic(), environment()
    try:
        ended = subprocess.run(
            command(run, short=True),
            cwd=ROOT,
            env=env,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )
    except subprocess.TimeoutExpired:
        console.print(f"{name:16s} {run.file:20s} FAILS: not finished after {PATIENCE:g} s")
        return False
    # Exit code 1 says that a problem was not solved: the benchmark has run all the same.
    well = "Traceback" not in ended.stderr and ended.returncode in (0, 1)
    last = (ended.stdout.strip() or ended.stderr.strip()).splitlines()[-1:] or [""]
    seconds, verdict = time.monotonic() - start, "runs" if well else "FAILS"
    console.print(f"{name:16s} {run.file:20s} {verdict} {seconds:5.0f} s  {last[0][:110]}")
    if not well:
        console.print(ended.stderr[-2000:])
    return well


def main(
    names: Annotated[list[str] | None, typer.Argument(help="Benchmarks to run.")] = None,
    short: Annotated[
        bool, typer.Option("--short", help="The short forms, of all where none is named.")
    ] = False,
) -> None:
    """Run benchmarks, or list them."""
    console = Console(soft_wrap=True, highlight=False, markup=False)
    for name in names or []:
        if name not in BENCHMARKS:
            console.print(f"no benchmark is named '{name}'; there are {', '.join(BENCHMARKS)}")
            raise typer.Exit(2)
    if short:
        raise typer.Exit(1 if run_short(names or list(BENCHMARKS), console) else 0)
    if not names:
        table = Table("NAME", "what it measures", title="make bench NAME=…")
        for name, benchmark in BENCHMARKS.items():
            table.add_row(name, benchmark.doc)
        console.print(table)
    for name in names or []:
        if code := run_whole(name):
            raise typer.Exit(code)


if __name__ == "__main__":
    typer.run(main)

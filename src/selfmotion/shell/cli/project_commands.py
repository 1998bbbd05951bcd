"""The commands `demo`, `study` and `warm-up`: what the project shows of itself, and prepares."""

import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numba.core import event

import selfmotion as sm
from selfmotion.basics import ALL_WORKS, compile_in_background
from selfmotion.realtime.warm import CompilationCounter, small_works
from selfmotion.shell.cli import options, outputs, summaries, tables
from selfmotion.shell.cli.app import (
    BEGIN,
    NOT_VERIFIED,
    VERIFIED,
    StageDisplay,
    app,
    plan_with_progress,
    stages,
    terminal,
)


def panda_past_a_box() -> sm.Problem:
    """Return a problem on which the minimum-norm motion hits an obstacle.

    A Panda draws a circle with its hand pointing ahead, beside a box that its forearm would hit;
    it ends as it began, at rest, within all limits that its maker publishes.
    """
    panda = sm.load_robot("panda")
    start = np.array(sm.NAMED_ARMS["panda"].home)
    circle = sm.paths.Circle.around(panda.pose(start), 0.15, 5.0, normal=(1.0, 0.0, 0.0))
    box = sm.obstacles.Box("box", np.array([0.1, -0.2, 0.75]), np.full(3, 0.1))
    constraints = (
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
        sm.constraints.JointAccelerationLimits(),
        sm.constraints.JointJerkLimits(),
        sm.constraints.ClosedPath(),
    )
    apart = sm.constraints.Clearance((box,), 0.01)
    return sm.Problem(panda, circle, "pointing", start, constraints=constraints, clearance=apart)


@app.command(epilog="Example: selfmotion demo --out out", rich_help_panel=BEGIN)
def demo(
    out: options.OneOutOption = Path("out"),
) -> None:
    """Plan, check and replay the paper's planar arm, and a Panda that draws circles past a box."""
    out = out or Path("out")
    panda = panda_past_a_box()
    problems = {"planar": sm.sample_problem(), "panda": panda}
    verified = True
    for name, problem in problems.items():
        terminal.print(name, style="bold", markup=False)
        result = plan_with_progress(problem)
        summaries.show_plan(result, terminal)
        files = [out / f"{name}.npz", out / f"{name}.csv"]
        outputs.write(result, files, out / f"{name}.html", terminal)
        verified = verified and result.certificate.verified
    tracked = sm.plan_by(panda, sm.baselines.PseudoInverse()).certificate
    terminal.print(
        f"the pseudo-inverse on the same problem: {tracked.verdict}", markup=False, soft_wrap=True
    )
    raise typer.Exit(VERIFIED if verified else NOT_VERIFIED)


@app.command(epilog="Example: selfmotion study --out out/study", rich_help_panel=BEGIN)
def study(
    out: options.OneOutOption = Path("out/study"),
    reduced: Annotated[
        bool, typer.Option("--reduced", help="Fewer starts, chains and arms: half a minute.")
    ] = False,
) -> None:
    """Re-run the paper: figures, tables and claims, as one HTML page, PNGs and JSON.

    Takes minutes. Needs matplotlib (the extra `plots`).
    """
    from selfmotion.paper.study import PARTS, Scale, require_matplotlib, run, write

    # Before minutes of work that could not be shown.
    require_matplotlib()
    scale = Scale.reduced() if reduced else Scale.full()
    with StageDisplay(stages) as display:
        result = run(scale, lambda part: display.stage(part, PARTS.index(part) + 1, len(PARTS)))
    files = write(result, out or Path("out/study"))
    tables.show_claims(result.claims, terminal)
    terminal.print(f"wrote {files[0]} and {len(files) - 1} files beside it", markup=False)


@app.command("warm-up", epilog="Example: selfmotion warm-up", rich_help_panel=BEGIN)
def warm_up() -> None:
    """Compile all numerical kernels now, once per machine, so that no plan waits for them."""
    began = time.perf_counter()
    counter = CompilationCounter()
    background = compile_in_background(ALL_WORKS)
    with event.install_listener("numba:compile", counter), StageDisplay(stages) as display:
        works = list(small_works())
        for number, (name, work) in enumerate(works):
            display.stage(f"kernels for {name}", number + 1, len(works))
            work()
    count = counter.count + (0 if background is None else int(background.communicate()[0] or 0))
    seconds = time.perf_counter() - began
    outcome = "nothing was left to compile" if not count else f"{count} kernels"
    terminal.print(f"{outcome}, {seconds:.0f} s", markup=False)

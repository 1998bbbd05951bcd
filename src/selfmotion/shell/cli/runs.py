"""Commands that plan many problems, or what is shown of the project itself."""

import time
from collections.abc import Container, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from numba.core import event

import selfmotion as sm
from selfmotion import basics, realtime
from selfmotion.basics import ALL_WORKS, compile_in_background
from selfmotion.realtime.warm import Compiled, small_works
from selfmotion.shell.cli import documents, options, outputs, result_json, summaries, tables
from selfmotion.shell.cli.app import (
    BEGIN,
    FILES,
    LOOP,
    NOT_VERIFIED,
    PLAN,
    VERIFIED,
    BatchDisplay,
    StageDisplay,
    app,
    check_cluster,
    complain,
    executor_at,
    plan_with_progress,
    print_json,
    stages,
    terminal,
)
from selfmotion.shell.documents import parse_setting

if TYPE_CHECKING:
    from selfmotion.work.batch import Item

# Keys of problem files that are about a whole plan.
_OF_PLANS = ("null_motion", "rest", *documents.HOW_TO_PLAN)


def panda_past_a_box() -> sm.Problem:
    """Return a problem that the pseudo-inverse runs into.

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


@app.command(
    epilog="Example: selfmotion batch cell.toml --workers 2 --out out/batch", rich_help_panel=PLAN
)
def batch(
    files: options.DocumentsArgument,
    out: options.OneOutOption = Path("out/batch"),
    workers: options.WorkersOption = None,
    dask: options.DaskOption = None,
    deadline: options.DeadlineOption = None,
    settings: options.SetOption = None,
    replays: Annotated[
        int, typer.Option(min=0, help="Write replays of so many of the best plans.")
    ] = 3,
    allow_code: options.AllowCodeOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Plan many problems into a folder, with a table ranked by cost; what was killed resumes.

    By default there is a process for each core. Exit code 0 if some combination of each file is
    verified.
    """
    from selfmotion.work.batch import plan_items

    check_cluster(dask, workers)
    out = out or Path("out/batch")
    several = [_items_of(file, settings, len(files) > 1, out, allow_code) for file in files]
    items = [item for each in several for item in each]
    names = [item.name for item in items]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise sm.errors.ProblemError(f"two problem files are called '{twice}'; rename one of them")
    try:
        with executor_at(dask) as executor, BatchDisplay(stages) as display:
            result = plan_items(
                items,
                executor,
                out=out,
                workers=workers,
                replays=replays,
                deadline=deadline,
                progress=display.show,
            )
    except KeyboardInterrupt:
        complain(f"stopped; what is finished is in '{out}': run again to go on")
        raise typer.Exit(NOT_VERIFIED) from None
    if as_json:
        print_json(result_json.batch_json(result))
    else:
        tables.show_batch(result, terminal)
    verified = {row.name for row in result.rows if row.verified}
    raise typer.Exit(VERIFIED if is_answered(several, verified) else NOT_VERIFIED)


def _changes(settings: Sequence[str] | None, folder: Path) -> dict[str, Any]:
    """Return the values by keys of ``KEY=VALUE``; files in them are named from a folder."""
    pairs = [parse_setting(text, folder) for text in settings or ()]
    options.refuse_twice("--set", [key for key, _ in pairs])
    return dict(pairs)


def _items_of(
    file: Path, settings: Sequence[str] | None, is_one_of_many: bool, out: Path, allow_code: bool
) -> list["Item"]:
    """Return what a file asks to plan; of many files, one that cannot be read is a row, too."""
    from selfmotion.shell.documents import grid_items
    from selfmotion.work.batch import unread_item

    try:
        found = list(grid_items(file, _changes(settings, file.parent), allow_code=allow_code))
        has_outputs = bool(basics.read_document(file).get("outputs"))
    except sm.errors.FileFormatError as error:
        if not is_one_of_many:
            raise
        return [unread_item(file, error)]
    if has_outputs:
        _print_note(f"note: {file}: outputs are left out: the plans of a batch go to '{out}'")
    return found


def is_answered(several: Sequence[Sequence["Item"]], verified: Container[str]) -> bool:
    """Whether of each file some combination is verified: others out of reach are an answer, too."""
    return all(any(item.name in verified for item in each) for each in several)


@app.command(epilog="Example: selfmotion robots", rich_help_panel=FILES)
def robots(as_json: options.JsonOption = False) -> None:
    """List the arms known by name: joints, tool frame, and redundancy for each task."""
    arms = {name: sm.load_robot(name) for name in sm.NAMED_ARMS}
    if as_json:
        print_json(result_json.robots_json(arms))
    else:
        tables.show_robots(arms, terminal)


@app.command(epilog="Example: selfmotion demo --out out", rich_help_panel=BEGIN)
def demo(
    out: options.OneOutOption = Path("out"),
) -> None:
    """Plan, check and replay the paper's planar arm, and a Panda that draws circles past a box."""
    out = out or Path("out")
    problems = {"planar": sm.sample_problem(), "panda": panda_past_a_box()}
    verified = True
    for name, problem in problems.items():
        terminal.print(name, style="bold", markup=False)
        result = plan_with_progress(problem)
        summaries.show_plan(result, terminal)
        files = [out / f"{name}.npz", out / f"{name}.csv"]
        outputs.write(result, files, out / f"{name}.html", terminal)
        verified = verified and result.certificate.verified
    tracked = sm.plan_by(problem, sm.baselines.PseudoInverse()).certificate
    terminal.print(
        f"the pseudo-inverse on the same problem: {tracked.verdict}", markup=False, soft_wrap=True
    )
    raise typer.Exit(VERIFIED if verified else NOT_VERIFIED)


def _print_note(text: str) -> None:
    stages.print(text, markup=False, soft_wrap=True)


@app.command(
    epilog="Example: selfmotion follow cell.toml --listen 127.0.0.1:5005", rich_help_panel=LOOP
)
def follow(
    file: options.DocumentArgument,
    listen: Annotated[
        str, typer.Option(help="host:port to wait for states at.")
    ] = "127.0.0.1:5005",
    settings: options.SetOption = None,
    allow_code: options.AllowCodeOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Follow a path in a closed loop with a controller: states come by UDP, set-points go back.

    A state is t, q, q̇ as doubles; the answer a row t, q, q̇, q̈ for each cycle, which ends at rest
    in case that the next one is late. The path begins with the first state; an empty datagram ends
    it. The table loop of the file (or --set loop.period=0.01) has horizon, period, cycle, latency,
    silence and seconds. Exit code 0 if every segment was planned.
    """
    from selfmotion.shell.cli import following

    document = documents.document_of(file, settings)
    loop = following.loop_of(document, file)
    problem = documents.of_file(file, documents.DocumentOptions(settings), allow_code).problem
    left = [key for key in document if key in _OF_PLANS]
    if left:
        _print_note(f"note: {file}: {', '.join(left)}: of plans, and left out while the arm moves")
    replanner = following.replanner_of(problem, **loop.of_replanner)
    # The arm goes as far as it can; better to know before it moves.
    if beyond := following.out_of_reach(problem):
        _print_note(f"note: {beyond}")
    with following.listening(listen) as port:
        # Nothing compiles once the arm moves.
        sm.warm_up(replanner)
        stages.print(f"waits for states at {listen}", markup=False)
        link = following.Link(port, problem.path, replanner.limits, _print_note, loop)
        try:
            realtime.follow(replanner, link.read, link.write, lead=loop.latency)
        except KeyboardInterrupt:
            link.ended = "stopped"
    if as_json:
        print_json(link.summary)
    else:
        following.show_link(link, terminal)
    raise typer.Exit(VERIFIED if link.is_followed else NOT_VERIFIED)


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
    counted, other = Compiled(), compile_in_background(ALL_WORKS)
    with event.install_listener("numba:compile", counted), StageDisplay(stages) as display:
        works = list(small_works())
        for number, (name, work) in enumerate(works):
            display.stage(f"kernels for {name}", number + 1, len(works))
            work()
    count = counted.count + (0 if other is None else int(other.communicate()[0] or 0))
    seconds = time.perf_counter() - began
    told = "nothing was left to compile" if not count else f"{count} kernels"
    terminal.print(f"{told}, {seconds:.0f} s", markup=False)

"""Commands about many seams in one program."""

from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any, NoReturn

import typer

import selfmotion as sm
from selfmotion import basics
from selfmotion.shell.cli import (
    documents,
    options,
    outputs,
    summaries,
    tables,
)
from selfmotion.shell.cli.app import (
    NOT_VERIFIED,
    PLAN,
    VERIFIED,
    StageDisplay,
    app,
    check_cluster,
    complain,
    executor_at,
    print_json,
    stages,
    terminal,
)
from selfmotion.shell.documents import SeamJob
from selfmotion.shop import controllers

# Suffix of a saved program.
PROGRAM = ".program"
# Suffix of saved parts of a motion.
PARTS = ".parts"
# End of the name of a timetable.
TIMETABLE = ".timetable.csv"


@app.command(
    epilog="Example: selfmotion job frame.toml --out frame.program --out frame.yaml",
    rich_help_panel=PLAN,
)
def job(
    file: options.DocumentArgument,
    out: options.OutOption = None,
    html: options.HtmlOption = None,
    folder: options.FolderOption = None,
    before: options.FromOption = None,
    deadline: options.DeadlineOption = None,
    workers: options.WorkersOption = None,
    dask: options.DaskOption = None,
    settings: options.SettingsOption = None,
    changes: options.SetOption = None,
    allow_code: options.AllowCodeOption = False,
    verbose: options.VerboseOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Plan many seams as one program: order, directions, and the moves in between.

    A .timetable.csv as --out says what happens when. A job that was stopped goes on from --folder.
    """
    wanted = [*(out or []), *([] if html is None else [html])]
    _check_wanted(wanted, settings)
    check_cluster(dask, workers)
    # Ctrl-C while kernels are loaded is lost, unless it is noted.
    with basics.held_interruption():
        work = documents.seams_of_file(file, changes, allow_code)
        earlier = None if before is None else sm.load_program(before)
        program_settings = outputs.program_settings(settings)
        # Before anything is planned.
        _check_programs(work, wanted, program_settings)
        remarks = work.remarks
    outputs.print_notes(remarks)
    kept = folder or Path("out") / f"{file.stem}.job"
    program = _planned(work, kept, dask, workers, warm_start=earlier, deadline=deadline)
    if work.at_feed is not None and not as_json:
        _print_feed(program)
    _show(program, as_json, verbose, remarks)
    _write_wanted(program, wanted, program_settings, as_json)
    raise typer.Exit(VERIFIED if program.verified else NOT_VERIFIED)


def _planned(
    work: SeamJob, kept: Path, dask: str | None, workers: int | None, **given: Any
) -> sm.Program:
    """Return the program of a job, on a cluster or in processes; what is finished is `kept`."""
    from selfmotion.work.batch import processes

    here: Any = processes(workers) if workers and workers > 1 else nullcontext()
    try:
        with executor_at(dask) as cluster, here as pool, StageDisplay(stages) as display:
            return work.plan(folder=kept, executor=cluster or pool, progress=display.stage, **given)
    except KeyboardInterrupt:
        complain(f"stopped; what is finished is in '{kept}': run again to go on")
        raise typer.Exit(NOT_VERIFIED) from None


def _check_wanted(wanted: Sequence[Path], settings: Path | None) -> None:
    """Raise where a file cannot be written, or settings are of none of them."""
    for target in wanted:
        _check(target)
    if settings is not None and not any(_switches(target) for target in wanted):
        raise sm.errors.ProblemError(
            "--settings has no effect: it is of controllers' programs (--out .script, .src, .mod)"
        )


def _check_programs(
    work: SeamJob, wanted: Sequence[Path], program_settings: sm.files.ProgramSettings | None
) -> None:
    """Raise where a controller's program could not be written of a job."""
    if program_settings is None and not any(_switches(target) for target in wanted):
        return
    settings = program_settings or sm.files.ProgramSettings()
    happens = {event: seam.name for seam in work.seams for event, _ in seam.events}
    controllers.check_signals(happens, settings)
    for target in wanted:
        if target.suffix.lower() in controllers.PROGRAMS:
            form = controllers.PROGRAMS[target.suffix.lower()]
            controllers.check_controller(work.robot, form, settings)


def _print_feed(program: sm.Program) -> None:
    feeds = [feed.asked for plan in program.plans.values() for feed in plan.path.feeds]
    text = f"feed: {max(feeds):g} m/s, the highest that was found at which all seams are kept"
    terminal.print(text, markup=False, soft_wrap=True)


def _write_wanted(
    program: sm.Program,
    wanted: Sequence[Path],
    settings: sm.files.ProgramSettings | None,
    as_json: bool,
) -> None:
    """Write a program into all files, but those that a motion with gaps has no place in."""
    # What is only of programs of targets is said for these, where there are some.
    has_targets = any(target.suffix.lower() in controllers.PROGRAMS for target in wanted)
    for target in wanted:
        unsound = outputs.left_out(program)
        if unsound and outputs.is_motion(target) and not _is_timetable(target):
            outputs.print_left_out(target, terminal, unsound, quiet=as_json)
            continue
        of_stream = settings is not None and not settings.by_poses
        streamed = of_stream and has_targets and target.suffix.lower() == ".script"
        write_program(program, target, settings.streamed if settings and streamed else settings)
        if not as_json:
            terminal.print(f"wrote {target}", markup=False, soft_wrap=True)
            outputs.print_large(target, terminal)


def _check(file: Path) -> None:
    if not (file.suffix in (PROGRAM, ".html", *controllers.SUFFIXES) or _is_timetable(file)):
        suffixes = ", ".join(controllers.SUFFIXES)
        raise sm.errors.FileFormatError(
            f"{file}: --out writes .program, .timetable.csv, .html (a replay) or the motion "
            f"({suffixes})"
        )


def _switches(file: Path) -> bool:
    """Whether a file says what events switch."""
    return file.suffix.lower() in (*controllers.PROGRAMS, ".script")


def _is_timetable(file: Path) -> bool:
    return file.name.endswith(TIMETABLE)


def write_program(
    program: sm.Program, file: Path, settings: sm.files.ProgramSettings | None = None
) -> None:
    """Write a program as what the name of a file says."""
    if file.suffix == PROGRAM:
        program.save(file)
    elif _is_timetable(file):
        sm.files.write_timetable(program, file)
    elif file.suffix == ".html":
        from selfmotion.shell.replay import write_replay

        write_replay(program, file)
    else:
        used = settings if _switches(file) else None
        with StageDisplay(stages) as display:
            sm.files.write_motion(program, file, settings=used, progress=display.stage)


def finish_parts(
    job: sm.files.PlanRequest, out: list[Path], as_json: bool, verbose: bool
) -> NoReturn:
    """Plan a motion in parts, print it, write its files, and end."""
    wanted = [*job.outputs, *out]
    for file in wanted:
        if file.suffix not in (PARTS, ".html", *controllers.SUFFIXES):
            suffixes = ", ".join(controllers.SUFFIXES)
            raise sm.errors.FileFormatError(
                f"{file}: of parts --out writes {PARTS} (all of it), .html or the motion "
                f"({suffixes})"
            )
    with StageDisplay(stages) as display:
        parts = job.in_parts(progress=display.stage)
    _show_parts(parts, as_json, verbose, job.remarks)
    for file in wanted:
        unsound = outputs.left_out(parts)
        if unsound and outputs.is_motion(file):
            outputs.print_left_out(file, terminal, unsound, quiet=as_json)
            continue
        if file.suffix == PARTS:
            parts.save(file)
        elif file.suffix == ".html":
            from selfmotion.shell.replay import write_replay

            write_replay(parts, file)
        else:
            sm.files.write_motion(parts, file)
        if not as_json:
            terminal.print(f"wrote {file}", markup=False, soft_wrap=True)
            outputs.print_large(file, terminal)
    raise typer.Exit(VERIFIED if parts.verified else NOT_VERIFIED)


def _show(program: sm.Program, as_json: bool, verbose: bool, remarks: Sequence[str] = ()) -> None:
    if as_json:
        data = summaries.program_json(program) | {"remarks": list(remarks)}
        print_json(data)
    else:
        (tables if verbose else summaries).show_program(program, terminal)


def _show_parts(parts: sm.Parts, as_json: bool, verbose: bool, remarks: Sequence[str] = ()) -> None:
    if as_json:
        data = {"verified": parts.verified, "verdict": parts.verdict, "cuts": list(parts.cuts)}
        print_json(data | {"remarks": list(remarks)})
    else:
        terminal.print(repr(parts) if verbose else parts.summary, markup=False, soft_wrap=True)


def check(file: Path, as_json: bool, verbose: bool) -> NoReturn:
    """Print what is known of a program or of parts, read and judged anew, and end."""
    planned: sm.Program | sm.Parts
    if file.suffix == PARTS:
        planned = sm.files.load_parts(file)
        _show_parts(planned, as_json, verbose)
    else:
        planned = sm.load_program(file)
        _show(planned, as_json, verbose)
    raise typer.Exit(VERIFIED if planned.verified else NOT_VERIFIED)

"""The command `selfmotion job`: plan many seams as one program."""

from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import typer

import selfmotion as sm
from selfmotion import basics
from selfmotion.shell.cli import documents, options, outputs, result_json, summaries, tables
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

    --out FILE.timetable.csv writes the times of seams and events. An interrupted job is resumed
    from --folder.
    """
    targets = [*(out or []), *([] if html is None else [html])]
    _check_targets(targets, settings)
    check_cluster(dask, workers)
    # Ctrl-C would be lost while compiled kernels load: it is held, and raised afterwards.
    with basics.held_interruption():
        seam_job = documents.seams_of_file(file, changes, allow_code)
        warm_start = None if before is None else sm.load_program(before)
        program_settings = outputs.program_settings(settings)
        # Before anything is planned.
        _check_programs(seam_job, targets, program_settings)
        remarks = seam_job.remarks
    outputs.print_notes(remarks)
    folder = folder or Path("out") / f"{file.stem}.job"
    program = _planned(seam_job, folder, dask, workers, warm_start=warm_start, deadline=deadline)
    if seam_job.at_feed is not None and not as_json:
        _print_feed(program)
    show_program(program, as_json, verbose, remarks)
    _write_targets(program, targets, program_settings, as_json)
    raise typer.Exit(VERIFIED if program.verified else NOT_VERIFIED)


def _planned(
    seam_job: SeamJob, folder: Path, dask: str | None, workers: int | None, **settings: Any
) -> sm.Program:
    """Plan a job, on a cluster or in processes; finished steps are saved in `folder`."""
    from selfmotion.work.batch import processes

    local_pool: Any = processes(workers) if workers and workers > 1 else nullcontext()
    try:
        with executor_at(dask) as cluster, local_pool as pool, StageDisplay(stages) as display:
            return seam_job.plan(
                folder=folder, executor=cluster or pool, progress=display.stage, **settings
            )
    except KeyboardInterrupt:
        complain(f"stopped; what is finished is in '{folder}': run again to go on")
        raise typer.Exit(NOT_VERIFIED) from None


def _check_targets(targets: Sequence[Path], settings: Path | None) -> None:
    """Raise where a target has an unknown suffix, or `settings` apply to none of the targets."""
    for target in targets:
        outputs.check_suffix(
            target, PROGRAM, ".html", what=".program, .timetable.csv, .html (a replay)"
        )
    if settings is not None and not any(_has_outputs(target) for target in targets):
        raise sm.errors.ProblemError(
            "--settings has no effect: it is of controllers' programs (--out .script, .src, .mod)"
        )


def _check_programs(
    seam_job: SeamJob, targets: Sequence[Path], settings: sm.files.ProgramSettings | None
) -> None:
    """Raise where a controller's program could not be written for the job's events or arm."""
    if settings is None and not any(_has_outputs(target) for target in targets):
        return
    settings = settings or sm.files.ProgramSettings()
    seam_of_event = {event: seam.name for seam in seam_job.seams for event, _ in seam.events}
    controllers.check_signals(seam_of_event, settings)
    for target in targets:
        if target.suffix.lower() in controllers.PROGRAMS:
            language = controllers.PROGRAMS[target.suffix.lower()]
            controllers.check_controller(seam_job.robot, language, settings)


def _print_feed(program: sm.Program) -> None:
    feeds = [feed.asked for plan in program.plans.values() for feed in plan.path.feeds]
    text = f"feed: {max(feeds):g} m/s, the highest that was found at which all seams are kept"
    terminal.print(text, markup=False, soft_wrap=True)


def _write_targets(
    program: sm.Program,
    targets: Sequence[Path],
    settings: sm.files.ProgramSettings | None,
    as_json: bool,
) -> None:
    """Write the program to all targets, but no motion that is not verified or has gaps."""
    has_programs = any(target.suffix.lower() in controllers.PROGRAMS for target in targets)

    def write(target: Path) -> None:
        # Beside a program of targets, the settings of targets do not apply to a stream.
        is_stream = target.suffix.lower() == ".script" and has_programs
        if settings is not None and is_stream and not settings.by_poses:
            write_program(program, target, settings.streamed)
        else:
            write_program(program, target, settings)

    outputs.write_each(program, targets, write, quiet=as_json)


def _has_outputs(file: Path) -> bool:
    """Whether a format has the outputs that events switch."""
    return file.suffix.lower() in (*controllers.PROGRAMS, ".script")


def write_program(
    program: sm.Program, file: Path, settings: sm.files.ProgramSettings | None = None
) -> None:
    """Write a program in the format that the file's suffix names."""
    if file.suffix == PROGRAM:
        program.save(file)
    elif outputs.is_timetable(file):
        sm.files.write_timetable(program, file)
    elif file.suffix == ".html":
        from selfmotion.shell.replay import write_replay

        write_replay(program, file)
    else:
        used = settings if _has_outputs(file) else None
        with StageDisplay(stages) as display:
            sm.files.write_motion(program, file, settings=used, progress=display.stage)


def show_program(
    program: sm.Program, as_json: bool, verbose: bool, remarks: Sequence[str] = ()
) -> None:
    """Print a program: a summary, or all of it."""
    if as_json:
        data = result_json.program_json(program) | {"remarks": list(remarks)}
        print_json(data)
    else:
        (tables if verbose else summaries).show_program(program, terminal)

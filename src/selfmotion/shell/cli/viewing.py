"""The command that shows a plan while its problem is changed."""

from pathlib import Path
from typing import Annotated

import typer

import selfmotion as sm
from selfmotion.basics import DOCUMENT_SUFFIXES
from selfmotion.shell.cli import jobs, options, outputs, parts
from selfmotion.shell.cli.app import LOOK, app, stages, terminal
from selfmotion.shop import controllers

# What a page can show.
_SUFFIXES = (
    *DOCUMENT_SUFFIXES,
    *(".npz", jobs.PROGRAM, parts.PARTS, *controllers.READ_PROGRAMS),
)


@app.command(epilog="Example: selfmotion view cell.toml", rich_help_panel=LOOK)
def view(
    file: options.DocumentArgument,
    robot: options.RobotOption = None,
    settings: options.SettingsOption = None,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port of this machine; 0 for a free one.")
    ] = 0,
    no_open: Annotated[
        bool, typer.Option("--no-open", help="Print the address only; open no browser.")
    ] = False,
    allow_code: options.AllowCodeOption = False,
) -> None:
    """Drag the part, the base, obstacles on a page, slide numbers, and see the plan follow.

    Of a job all of its seams are planned, with the moves between them. A plan's own problem is
    changed, and saved with its plan; a program is shown as it is, and judged as `check` does, a
    controller's by the `--robot` that it was made of. The page is served on this machine only, to
    who has its address; the file changes when it is saved. Ends with Ctrl-C. Needs the extra
    `view`.
    """
    from selfmotion.shell import view as pages

    pages.check_server()
    if file.suffix.lower() not in _SUFFIXES:
        raise sm.errors.ProblemError(
            f"{file}: has suffix '{file.suffix}', expected a problem file or a job file (.toml, "
            f".json, .yaml), a plan (.npz), a {jobs.PROGRAM} or {parts.PARTS} file, or a program "
            f"of a controller with its {jobs.PROGRAM} as --robot"
        )
    asked = outputs.program_settings(settings)
    with stages.status("planning …"):
        job = None if robot is None else Path(robot)
        session = pages.opened(file, allow_code=allow_code, job=job)
    session.settings = asked
    pages.serve(session, port=port, opens=not no_open, told=_tell)


def _tell(address: str) -> None:
    terminal.print(f"the page is at {address}", markup=False, soft_wrap=True, highlight=False)
    stages.print("Ctrl-C ends it; the address is for you alone", markup=False)

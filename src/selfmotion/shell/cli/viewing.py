"""The command that shows a plan while its problem is changed."""

from pathlib import Path
from typing import Annotated

import typer

import selfmotion as sm
from selfmotion.shell.cli import documents, options
from selfmotion.shell.cli.app import LOOK, app, stages, terminal


@app.command(epilog="Example: selfmotion view cell.toml", rich_help_panel=LOOK)
def view(
    file: Annotated[Path, typer.Argument(help="A problem file (.toml, .json).")],
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port of this machine; 0 for a free one.")
    ] = 0,
    no_open: Annotated[
        bool, typer.Option("--no-open", help="Print the address only; open no browser.")
    ] = False,
    allow_code: options.AllowCodeOption = False,
) -> None:
    """Drag the part, the base, obstacles on a page, slide numbers, and see the plan follow.

    The page is served on this machine only, to who has its address; the file changes when it is
    saved. Ends with Ctrl-C. Needs the extra `view`.
    """
    from selfmotion.shell import view as pages

    pages.check_server()
    if file.suffix not in (*documents.SUFFIXES, ".yaml", ".yml"):
        raise sm.errors.ProblemError(
            f"{file}: has suffix '{file.suffix}', expected a problem file (.toml or .json); "
            f"`selfmotion replay` shows plans and programs"
        )
    with stages.status("planning …"):
        session = pages.Session(file, allow_code=allow_code)
    pages.serve(session, port=port, opens=not no_open, told=_tell)


def _tell(address: str) -> None:
    terminal.print(f"the page is at {address}", markup=False, soft_wrap=True, highlight=False)
    stages.print("Ctrl-C ends it; the address is for you alone", markup=False)

"""The command line: where commands are registered, and how they end."""

import sys
import traceback
from typing import Annotated, Any

import typer
from rich.console import Console

import selfmotion as sm
from selfmotion.basics import version
from selfmotion.cli import tables
from selfmotion.cli.display import StageDisplay
from selfmotion.cli.summaries import in_shell

# Under which commands are listed.
PLAN, LOOK, FILES = "Plan", "Inspect plans", "Files"
LOOP, BEGIN = "While the arm moves", "To begin with"

app = typer.Typer(
    help="Plan the joint motion of a redundant arm along a tool motion.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def _print_version(asked: bool) -> None:
    if asked:
        typer.echo(f"selfmotion {version()}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Print the version.", callback=_print_version, is_eager=True
        ),
    ] = False,
) -> None:
    pass


# What commands print, and apart from it, so that it can be piped, how far they are.
terminal = tables.console()
stages = Console(stderr=True, highlight=False)

VERIFIED, NOT_VERIFIED, BAD_INPUT, FAILED = 0, 1, 2, 3
# What shells expect of a command that Ctrl-C ended.
INTERRUPTED = 130


def main() -> None:
    """Run the command; exit code 2 and one line for bad input, 3 for a fault of ours.

    130 and a line where it was stopped before there was anything to keep.
    """
    try:
        app()
    except SystemExit as end:
        if end.code == INTERRUPTED:
            complain("stopped before there was anything to keep")
        raise
    except sm.SelfmotionError as error:
        complain(f"error: {in_shell(str(error))}")
        sys.exit(BAD_INPUT)
    except Exception:
        # Not bad input, and no verdict: whoever reads exit codes must not take it for one.
        traceback.print_exc()
        complain("selfmotion failed; this is a fault of the program, not of what it was given")
        sys.exit(FAILED)


def complain(text: str) -> None:
    """Print a line about what went wrong."""
    Console(stderr=True, highlight=False).print(text, style="red", markup=False, soft_wrap=True)


def plan_with_progress(problem: sm.Problem, **options: Any) -> sm.Plan:
    """Plan, and show how far it is."""
    with StageDisplay(stages) as display:
        return sm.plan(problem, callback=display.iteration, progress=display.stage, **options)


def fastest_with_progress(job: sm.files.Job, **options: Any) -> sm.Fastest:
    """Look for the fastest motion of a job, and show how far it is."""
    with StageDisplay(stages) as display:
        return job.fastest(progress=display.stage, **options)

"""Motions in parts, and saved programs: what commands print and write of them."""

from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

import typer

import selfmotion as sm
from selfmotion.shell.cli import jobs, outputs
from selfmotion.shell.cli.app import (
    NOT_VERIFIED,
    VERIFIED,
    StageDisplay,
    print_json,
    stages,
    terminal,
)

# Suffix of saved parts of a motion.
PARTS = ".parts"


def finish_parts(
    request: sm.files.PlanRequest, out: Sequence[Path], as_json: bool, verbose: bool
) -> NoReturn:
    """Plan a motion in parts, print it, write its files, and exit."""
    targets = [*request.outputs, *out]
    for target in targets:
        outputs.check_suffix(target, PARTS, ".html", what=f"{PARTS} (all of it), .html")
    with StageDisplay(stages) as display:
        parts = request.in_parts(progress=display.stage)
    _show_parts(parts, as_json, verbose, request.remarks)
    outputs.write_each(parts, targets, lambda target: _write(parts, target), quiet=as_json)
    raise typer.Exit(VERIFIED if parts.verified else NOT_VERIFIED)


def check_saved(file: Path, as_json: bool, verbose: bool) -> bool:
    """Load a program or parts, print the verdict, and return whether they are verified."""
    if file.suffix == PARTS:
        parts = sm.files.load_parts(file)
        _show_parts(parts, as_json, verbose)
        return parts.verified
    program = sm.load_program(file)
    jobs.show_program(program, as_json, verbose)
    return program.verified


def _write(parts: sm.Parts, file: Path) -> None:
    """Write parts in the format that the file's suffix names."""
    if file.suffix == PARTS:
        parts.save(file)
    elif file.suffix == ".html":
        from selfmotion.shell.replay import write_replay

        write_replay(parts, file)
    else:
        sm.files.write_motion(parts, file)


def _show_parts(parts: sm.Parts, as_json: bool, verbose: bool, remarks: Sequence[str] = ()) -> None:
    if as_json:
        data = {"verified": parts.verified, "verdict": parts.verdict, "cuts": list(parts.cuts)}
        print_json(data | {"remarks": list(remarks)})
    else:
        terminal.print(repr(parts) if verbose else parts.summary, markup=False, soft_wrap=True)

"""The command `selfmotion batch`: many problems into one folder."""

from collections.abc import Container, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import selfmotion as sm
from selfmotion import basics
from selfmotion.shell.cli import documents, options, outputs, result_json, tables
from selfmotion.shell.cli.app import (
    NOT_VERIFIED,
    PLAN,
    VERIFIED,
    BatchDisplay,
    app,
    check_cluster,
    complain,
    executor_at,
    print_json,
    stages,
    terminal,
)
from selfmotion.shell.documents import parse_setting

if TYPE_CHECKING:
    from selfmotion.work.batch import Item


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
        int, typer.Option(min=0, help="Number of best plans to write replays of.")
    ] = 3,
    allow_code: options.AllowCodeOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Plan many problems into a folder, with a table ranked by cost.

    By default there is a process for each core. A run that was killed goes on where it stopped.
    Exit code 0 if some combination of each file is verified.
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
    """Return what ``--set KEY=VALUE`` says, by key; relative file names are those of `folder`."""
    pairs = [parse_setting(text, folder) for text in settings or ()]
    documents.refuse_same_keys(pairs)
    return dict(pairs)


def _items_of(
    file: Path, settings: Sequence[str] | None, is_one_of_many: bool, out: Path, allow_code: bool
) -> list["Item"]:
    """Return the items that a file asks to plan.

    Where it is one of several files and cannot be read, one item that says so.
    """
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
        outputs.print_notes([f"{file}: outputs are left out: the plans of a batch go to '{out}'"])
    return found


def is_answered(several: Sequence[Sequence["Item"]], verified: Container[str]) -> bool:
    """Whether each file has a verified combination: that others are out of reach is an answer."""
    return all(any(item.name in verified for item in each) for each in several)

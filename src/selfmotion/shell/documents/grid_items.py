"""The problems of a file's grid, as items of a batch."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from selfmotion.basics import FileFormatError, ProblemError, read_document
from selfmotion.planning.planner import PlanRequest
from selfmotion.shell.documents.overrides import grid_documents, set_key, write_combination
from selfmotion.shell.documents.problem_file import plan_request_of
from selfmotion.work.batch import Item


def grid_items(
    file: Path, changes: Mapping[str, Any] | None = None, *, allow_code: bool = False
) -> list[Item]:
    """Return an item for each problem of a file's ``[grid]``, or the one of a file without.

    With `changes`, values by their keys, in all of them.

    Raises
    ------
    FileFormatError
        The file cannot be read, or its grid is none. What is wrong with single problems is said
        by their rows.
    ProblemError
        A changed key is one of the grid.
    """
    cache: dict[str, Any] = {}
    document, changes = read_document(file), changes or {}
    grid = document.get("grid")
    twice = [key for key in changes if isinstance(grid, Mapping) and key in grid]
    if twice:
        raise ProblemError(
            f"{file}: {twice[0]} is a key of its grid, and set as well: leave out one"
        )
    try:
        for key, value in changes.items():
            set_key(document, key, value)
        found = grid_documents(document)
    except FileFormatError as error:
        raise FileFormatError(f"{file}: {error}") from error
    digits = len(str(len(found) - 1))

    def maker(document: dict[str, Any]) -> Callable[[], PlanRequest]:
        return lambda: plan_request_of(document, file, allow_code=allow_code, cache=cache)

    return [
        Item(
            f"{file.stem}-{k:0{digits}d}" if settings else file.stem,
            maker(one),
            settings,
            file,
            _writer(file, {**changes, **settings}),
        )
        for k, (one, settings) in enumerate(found)
    ]


def _writer(file: Path, settings: Mapping[str, Any]) -> Callable[[Path], None] | None:
    """Return what writes a file with other values; None where it is as it was."""
    return partial(write_combination, file, settings) if settings else None

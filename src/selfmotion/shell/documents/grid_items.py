"""The problems of a file's grid, as items of a batch."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from selfmotion.basics import FileFormatError, read_document
from selfmotion.planning.planner import PlanRequest
from selfmotion.shell.documents.overrides import grid_documents, write_combination
from selfmotion.shell.documents.problem_file import plan_request_of
from selfmotion.work.batch import Item


def grid_items(file: Path, *, allow_code: bool = False) -> list[Item]:
    """Return an item for each problem of a file's ``[grid]``, or the one of a file without.

    Raises
    ------
    FileFormatError
        The file cannot be read, or its grid is none. What is wrong with single problems is said
        by their rows.
    """
    cache: dict[str, Any] = {}
    document = read_document(file)
    try:
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
            partial(write_combination, file, settings) if settings else None,
        )
        for k, (one, settings) in enumerate(found)
    ]
